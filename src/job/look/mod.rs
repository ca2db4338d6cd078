//! How a job will look: light through the voxels that are printed, held against what was asked for and what was
//! promised.
//!
//! **In:** a [`Prepared`] job, and its finished folder if the voxels are to come from there. **Out:** a [`Look`]: at
//! spots of the surface the albedo that is asked for, the one that was predicted for an endless flat slab of the
//! stacking there, and the one that is printed, with its standard error.
//!
//! | file | what it does |
//! | --- | --- |
//! | `voxels`  | the volume, from the job's fields or from the slices of a folder |
//! | `pictures`, `asked` | the whole object under four kinds of light, printed and as it should be |
//! | `mitsuba` | the same scene for Mitsuba 3 |
//! | `surface` | spots of the surface, and what is expected there |

mod asked;
mod error;
mod mitsuba;
mod pictures;
pub(in crate::job) mod shade;
mod surface;
mod voxels;

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use error::LookError;
pub use mitsuba::{OWNER as MITSUBA, write_mitsuba};
pub use pictures::PictureOptions;
pub(in crate::job) use surface::SurfaceSpot;

use super::{Prepared, verify::read_manifest};
use crate::{
    look::{Scene, Spot},
    output::{Existing, GENERATOR, OutputError, OutputFolder, Owner, pretty},
    preview::PreviewFile,
    watch::Watch,
};

/// Version of `look.json`'s form.
pub const LOOK_VERSION: u32 = 1;
/// Name of the file that holds a look.
pub const LOOK: &str = "look.json";
/// Worst spots that are listed.
const WORST: usize = 5;

/// What to look at.
#[derive(Debug, Clone, PartialEq)]
pub struct LookOptions {
    /// Spots at random, evenly over the surface.
    pub spots: usize,
    /// Spots near these positions too, mm in the lattice's frame.
    pub at: Vec<DVec3>,
    /// Walks for each spot and channel.
    pub walks: u64,
    /// Same seed, same result.
    pub seed: u64,
    /// Pictures; `None`: numbers only.
    pub pictures: Option<PictureOptions>,
}

impl Default for LookOptions {
    /// At 10,000 walks a printed albedo of 0.4 is known to 0.003.
    fn default() -> Self {
        Self { spots: 100, at: Vec::new(), walks: 10_000, seed: 1, pictures: None }
    }
}

impl LookOptions {
    /// What a job shows of itself when it is sliced: a second or two.
    pub fn quick() -> Self {
        Self { spots: 60, walks: 4_000, pictures: Some(PictureOptions::quick()), ..Self::default() }
    }
}

/// How a job looks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Look {
    /// Program and version.
    pub generator: String,
    /// [`LOOK_VERSION`].
    pub version: u32,
    /// Name of the job.
    pub job: String,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Walks for each spot and channel.
    pub walks: u64,
    /// Their seed.
    pub seed: u64,
    /// Radius of a spot, mm.
    pub spot_radius_mm: f64,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Printed against asked, in each channel; `None` where nothing was asked for. Where a spot sees a share V of the sky,
    /// against what a surface of the asked albedo ρ would show there, V ρ / (1 − (1 − V) ρ).
    pub against_asked: Option<Vec<Fit>>,
    /// Printed against predicted, in each channel, likewise.
    pub against_predicted: Vec<Fit>,
    /// Indices of the spots that are farthest from what was asked for (or predicted), the worst first.
    pub worst: Vec<usize>,
    /// The spots: those at random, then those that were named.
    pub spots: Vec<SpotRecord>,
    /// The pictures.
    #[serde(skip)]
    pub pictures: Vec<PreviewFile>,
}

/// A look in a few numbers, as the manifest has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LookSummary {
    /// Spots that were looked at.
    pub spots: usize,
    /// Walks for each spot and channel.
    pub walks: u64,
    /// Printed against asked, in each channel; `None` where nothing was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against_asked: Option<Vec<Fit>>,
    /// Printed against predicted, in each channel.
    pub against_predicted: Vec<Fit>,
    /// The spots that are farthest from what was asked for (or predicted), the worst first.
    pub worst: Vec<SpotRecord>,
}

/// How far printed albedos are from what they should be, over all spots.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Mean of printed less expected.
    pub bias: f64,
    /// Root mean square of printed less expected, the noise of the walks taken off.
    pub rms: f64,
    /// That over the root mean square of what is expected.
    pub relative_rms: f64,
}

/// One spot. Albedos are per channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpotRecord {
    /// Index of its object.
    pub object: usize,
    /// Its middle, mm in the lattice's frame.
    pub position_mm: [f64; 3],
    /// Outward unit normal there.
    pub normal: [f64; 3],
    /// What is asked for; `None` where a stacking was given.
    pub asked: Option<Vec<f64>>,
    /// What was predicted for an endless flat slab.
    pub predicted: Vec<f64>,
    /// Share of the sky that it sees, 0 to 1: in a hollow print is held against what a surface of that albedo would show
    /// among its like, see [`Look::against_asked`].
    #[serde(default = "whole_sky")]
    pub sky: f64,
    /// Radiosity per irradiance of the print, under even light.
    pub printed: Vec<f64>,
    /// One standard deviation of it.
    pub standard_error: Vec<f64>,
}

/// Looks at a job; with a `folder`, at the slices in it.
///
/// # Errors
/// [`LookError`].
pub fn look(
    prepared: &Prepared,
    folder: Option<&Path>,
    options: &LookOptions,
    watch: &dyn Watch,
) -> Result<Look, LookError> {
    look_at(prepared, &scene_for(prepared, folder, watch)?, options, watch)
}

/// What is printed by a job, or what the slices in a `folder` of it show, with its resins.
///
/// # Errors
/// [`LookError`].
pub fn scene_for(prepared: &Prepared, folder: Option<&Path>, watch: &dyn Watch) -> Result<Scene, LookError> {
    let volume = match folder {
        None => prepared.volume(watch)?,
        Some(folder) => {
            let fault = |finding: super::verify::Finding| LookError::Folder {
                folder: folder.to_owned(),
                found: finding.to_string(),
                expected: "the manifest of a finished job".to_owned(),
            };
            voxels::read_volume(folder, &read_manifest(folder)?.map_err(fault)?, prepared, watch)?
        }
    };
    prepared.lit(volume)
}

/// Looks at what fills a scene, which must be on the lattice of `prepared`: its own print, or another of the same
/// objects.
///
/// # Errors
/// [`LookError::Stopped`].
pub fn look_at(
    prepared: &Prepared,
    scene: &Scene,
    options: &LookOptions,
    watch: &dyn Watch,
) -> Result<Look, LookError> {
    let mut spots = prepared.random_spots(scene, options.spots, options.seed);
    spots.extend(options.at.iter().filter_map(|at| prepared.spot_near(scene, *at)));
    watch.stage("light", spots.len() as u64);
    let sites: Vec<Spot> = spots.iter().map(|spot| spot.spot.clone()).collect();
    let printed = scene.printed_albedo(&sites, options.walks, options.seed, watch)?;
    let record = |(spot, printed): (&SurfaceSpot, Vec<Option<crate::optics::Estimate>>)| {
        let printed: Option<Vec<_>> = printed.into_iter().collect();
        let expected = prepared.expected(spot);
        Some(SpotRecord {
            object: spot.object,
            position_mm: spot.middle.point.to_array(),
            normal: spot.middle.normal.to_array(),
            asked: expected.asked,
            predicted: expected.predicted,
            sky: shade::sky(scene, &spot.middle, 0.0),
            standard_error: printed.iter().flatten().map(|channel| channel.standard_error).collect(),
            printed: printed?.iter().map(|channel| channel.mean).collect(),
        })
    };
    let spots: Vec<SpotRecord> = spots.iter().zip(printed).filter_map(record).collect();
    let pictures = options.pictures.map(|options| pictures::pictures(prepared, scene, &options, watch)).transpose()?;
    let channels = prepared.materials.channels.clone();
    let mut warnings = Vec::new();
    if prepared.materials.resins.iter().any(|resin| resin.refractive_index != 1.0) {
        warnings.push("pictures leave refractive indices out; printed albedos have them".to_owned());
    }
    let shown = |albedo: &[f64], spot: &SpotRecord| -> Vec<f64> {
        albedo.iter().map(|albedo| shade::shown(*albedo, spot.sky)).collect()
    };
    let asked = spots.iter().map(|spot| Some(shown(spot.asked.as_deref()?, spot))).collect::<Option<Vec<_>>>();
    let predicted: Vec<_> = spots.iter().map(|spot| shown(&spot.predicted, spot)).collect();
    let goal = asked.as_ref().unwrap_or(&predicted);
    let off = |spot: usize| {
        let apart = spots[spot].printed.iter().zip(&goal[spot]).map(|(printed, goal)| (printed - goal).powi(2));
        apart.sum::<f64>()
    };
    let mut worst: Vec<usize> = (0..spots.len()).collect();
    worst.sort_by(|a, b| off(*b).total_cmp(&off(*a)));
    worst.truncate(WORST);
    Ok(Look {
        generator: GENERATOR.to_owned(),
        version: LOOK_VERSION,
        job: prepared.job.name.clone(),
        walks: options.walks,
        seed: options.seed,
        spot_radius_mm: surface::SPOT_RADIUS_MM,
        against_asked: asked.as_ref().map(|asked| fits(&spots, asked, channels.len())),
        against_predicted: fits(&spots, &predicted, channels.len()),
        channels,
        warnings,
        worst,
        spots,
        pictures: pictures.unwrap_or_default(),
    })
}

impl Look {
    /// Its numbers without its spots but the worst.
    pub fn summary(&self) -> LookSummary {
        LookSummary {
            spots: self.spots.len(),
            walks: self.walks,
            against_asked: self.against_asked.clone(),
            against_predicted: self.against_predicted.clone(),
            worst: self.worst.iter().map(|&spot| self.spots[spot].clone()).collect(),
        }
    }

    /// Writes `look.json` and the pictures into `folder`; `inputs` are the files that were read.
    ///
    /// # Errors
    /// A folder that may not or cannot be written.
    pub fn write(&self, folder: &Path, existing: Existing, inputs: &[PathBuf]) -> Result<(), OutputError> {
        let output = OutputFolder::create(folder, &OWNER, existing, inputs)?;
        output.write(LOOK, &pretty(self))?;
        for picture in &self.pictures {
            output.write(picture.path.trim_start_matches("look/"), &picture.png)?;
        }
        let list = serde_json::json!({ "generator": GENERATOR, "command": OWNER.command, "version": 1, "files": output.files() });
        output.finish(&pretty(&list))
    }
}

/// What `look` writes.
pub const OWNER: Owner = Owner { command: "look", names: &[LOOK, "soft.png", "edge.png", "behind.png", "spot.png"] };

pub(super) fn whole_sky() -> f64 {
    1.0
}

fn fits(spots: &[SpotRecord], expected: &[Vec<f64>], channels: usize) -> Vec<Fit> {
    let fit = |channel: usize| {
        let n = spots.len().max(1) as f64;
        let (mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0);
        for (spot, expected) in spots.iter().zip(expected) {
            let apart = spot.printed[channel] - expected[channel];
            bias += apart / n;
            squared += apart * apart / n;
            noise += spot.standard_error[channel].powi(2) / n;
            level += expected[channel].powi(2) / n;
        }
        let rms = (squared - noise).max(0.0).sqrt();
        Fit { bias, rms, relative_rms: if level > 0.0 { rms / level.sqrt() } else { 0.0 } }
    };
    (0..channels).map(fit).collect()
}
