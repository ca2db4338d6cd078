//! lumislice turns a mesh and the light it should scatter into printer-ready voxels of resin.
//!
//! It implements Hašan, Fuchs, Matusik, Pfister and Rusinkiewicz, *Physical Reproduction of Materials with
//! Specified Subsurface Scattering* (SIGGRAPH 2010), with voxels in place of polygon layers.
//!
//! # Three things to do with it
//!
//! What does a stack of resins reflect?
//!
//! ```
//! use lumislice::optics::{MaterialSet, Model, Stack, predict};
//! use lumislice::watch::Unwatched;
//!
//! let set = MaterialSet::builtin("synthetic")?;
//! let named: Stack<String> = "white:0.5,support:1.0".parse()?;
//! let stack = set.stack(&named)?.over(set.resin("black").map(|(id, _)| id));
//! let light = predict(&set, &stack, &Model::KubelkaMunk, &Unwatched)?.light.remove(0);
//! let albedo = light.reflection_hankel[0];
//! assert!((albedo - 0.560).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Which stack reflects like this?
//!
//! ```
//! use lumislice::appearance::material_target;
//! use lumislice::optics::MaterialSet;
//! use lumislice::search::{MatchOptions, Matcher, Objective, SearchOptions};
//! use lumislice::watch::Unwatched;
//!
//! let set = MaterialSet::builtin("synthetic")?;
//! let target = material_target(&[0.4], &[0.5], 1, &set.grid)?; // albedo, mean free path in mm
//! let core = set.resin("black").map(|(id, _)| id);
//! let search = SearchOptions { core, depth: 3, objective: Objective::default(), ..SearchOptions::default() };
//! let matcher = Matcher::new(&set, &MatchOptions { search, ..MatchOptions::default() })?;
//! let found = matcher.match_targets(&[target], &Unwatched)?.remove(0);
//! println!("{} over black", set.named(&found.stacking()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where do its layers lie in a mesh?
//!
//! ```
//! use lumislice::appearance::{LayerField, LayerStack};
//! use lumislice::glam::DVec3;
//! use lumislice::mesh::{LoadOptions, close, load};
//! use lumislice::slice::{ObjectField, Slicer};
//! use lumislice::voxel::{Lattice, MaterialId};
//!
//! let slab = close(load("samples/slab.stl".as_ref(), &LoadOptions::default())?.mesh)?;
//! let far = slab.mesh.positions.iter().fold(DVec3::ZERO, |far, p| far.max(*p));
//! let lattice = Lattice::covering(far, DVec3::splat(0.5))?;
//! let [shell, core] = [0, 1].map(MaterialId::from_resin);
//! let layers = LayerField::Uniform(LayerStack::new([(shell, 1.0)], core));
//! let object = ObjectField::new(&slab, lattice, layers).ok_or("a mesh without triangles")?;
//! Slicer::new(lattice, vec![object]).for_each_slab(0..lattice.dims[2], |slices| {
//!     assert_eq!(slices.voxel([0, 0, slices.slices().start]), shell);
//!     Ok::<(), std::convert::Infallible>(())
//! })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/` has the three as programs.
//!
//! # The pipeline
//!
//! ```text
//!   job.toml ──► job      parse, resolve paths and presets, validate before work starts
//!                 │
//!   ┌─────────────┼───────────────────┐
//! mesh          optics              appearance
//! triangles,    resins: profiles,   what each surface point should reflect:
//! UVs,          Hankel transform,   profiles per texel, k-means clusters
//! textures      slabs, stacking
//!   │             │                   │
//!   │             └──► search ◄───────┘
//!   │                  one stacking per cluster
//!   │                    │
//!   │                  appearance       layer table: layer boundaries at every texel
//!   ▼                    │
//! sdf   closest surface point, signed distance (exact)
//!   │                    │
//! voxel lattice, 8×8×8 bricks
//!   └─────────┬──────────┘
//!           slice   bricks of material ids, slab after slab, streamed into files
//! ```
//!
//! One idea carries it: **depth and nearest surface point at any position in space**. [`sdf`] answers that query,
//! [`appearance`] turns it into a material. Voxels and meshes are two samplings of that one field.
//!
//! # Conventions
//!
//! Lengths are millimetres. Spatial frequencies are rad/mm. Signed distance is **negative inside**; depth = −distance.
//! A layer owns depth in [top, bottom). Frames are right-handed, z is up and the build direction:
//!
//! ```text
//!        z (build)                     image of slice k, seen from above
//!        │   y                          x = i ──►
//!        │  ╱                        ┌──────────────┐ row 0   = largest j
//!        │ ╱                         │              │
//!        └──────── x                 └──────────────┘ last row = j 0
//!   voxel (i, j, k) has its centre at origin + (index + ½) · pitch, pitch per axis
//! ```
//!
//! # Features
//!
//! | feature | adds | brings in |
//! | --- | --- | --- |
//! | `cli`, default | the program `lumislice`; implies `measure` | clap, indicatif, ctrlc |
//! | `measure` | `lumislice::measure`: resins from photographs | readers of TIFF and EXIF |
//! | `raw` | camera raw files, of which the decoder is LGPL-2.1; implies `measure` | rawler |
//!
//! A program that slices by itself needs none of them: `default-features = false`.

// Files are the same bytes on every processor.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub use glam;

pub mod appearance;
pub mod blame;
pub mod colour;
pub mod container;
mod disjoint_sets;
mod encoding;
pub mod job;
pub mod look;
mod machine;
#[cfg(feature = "measure")]
pub mod measure;
pub mod mesh;
mod numeric;
pub mod optics;
pub mod output;
mod page;
mod parallel;
mod picture;
pub mod plot;
pub mod preview;
mod regular_file;
pub mod sdf;
pub mod search;
pub mod slice;
mod toml_reader;
pub mod voxel;
pub mod watch;
pub mod words;

#[cfg(test)]
#[path = "../tests/common/shapes.rs"]
mod test_shapes;
