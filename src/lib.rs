//! lumislice turns a mesh and the light it should scatter into printer-ready voxels of resin.
//!
//! It implements Hašan, Fuchs, Matusik, Pfister and Rusinkiewicz, *Physical Reproduction of Materials with
//! Specified Subsurface Scattering* (SIGGRAPH 2010), with voxels in place of polygon layers.
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

pub mod appearance;
pub mod blame;
pub mod colour;
mod disjoint_sets;
pub mod job;
pub mod look;
#[cfg(feature = "measure")]
pub mod measure;
pub mod mesh;
mod numeric;
pub mod optics;
pub mod output;
mod page;
mod picture;
pub mod plot;
pub mod preview;
pub mod sdf;
pub mod search;
pub mod slice;
mod toml_reader;
pub mod voxel;
pub mod watch;
pub mod words;
