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
//! | `differences` | how far prints are from what was asked for, noise taken off |
//! | `edges` | what shows by a shadow's edge, asked and printed |
//! | `surface` | spots of the surface, and what is expected there |
//! | `by_area` | points of all surfaces, evenly over their area |
//! | `alone`   | a finished folder without its job |

mod alone;
mod asked;
mod by_area;
mod differences;
mod edges;
mod mitsuba;
mod patch;
mod pictures;
pub(in crate::job) mod shade;
mod surface;
mod voxels;

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use super::run_error::LookError;
pub use alone::FinishedFolder;
pub(in crate::job) use by_area::{ByArea, SurfacePoint};
use edges::EdgeShape;
pub use mitsuba::{OWNER as MITSUBA, write_mitsuba};
pub use pictures::PictureOptions;
pub(in crate::job) use pictures::{ObjectLight, object_light};
use surface::Expected;
pub(in crate::job) use surface::{SPOT_RADIUS_MM, SurfaceSpot, normal_and_area};
pub(in crate::job) use voxels::LOOK_VOXELS;

pub use super::record::{Differences, EdgeRecord, Fit, LookSummary, SpotRecord, Spread};
use super::{
    Manifest, Prepared,
    finished::{Finding, read_manifest},
    manifest::LOOK,
};
use crate::{
    look::{Radiosity, Scene, Spot, Volume},
    optics::Estimate,
    output::{Existing, GENERATOR, OutputError, OutputFolder, Owner, pretty},
    preview::PreviewFile,
    watch::{StopOnly, Watch},
};

/// Version of `look.json`'s form.
pub const LOOK_VERSION: u32 = 1;
/// Worst spots that are listed.
const WORST: usize = 5;
/// Distances from a shadow's edge that a look tells, mm, negative in the shadow.
pub const EDGE_MM: [f64; 11] = [-2.0, -1.0, -0.5, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0, 2.0];

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
    /// Whether to tell what shows by a shadow's edge.
    pub edges: bool,
    /// Pictures; `None`: numbers only.
    pub pictures: Option<PictureOptions>,
}

impl Default for LookOptions {
    /// At 10,000 walks a printed albedo of 0.4 is known to 0.003.
    fn default() -> Self {
        Self { spots: 100, at: Vec::new(), walks: 10_000, seed: 1, edges: true, pictures: None }
    }
}

impl LookOptions {
    /// What a job shows of itself when it is sliced: a few seconds. At 4,000 walks noise hid what half of the places of
    /// a good print are off by.
    pub fn quick() -> Self {
        let pictures = Some(PictureOptions::quick());
        Self { spots: 60, walks: 20_000, edges: false, pictures, ..Self::default() }
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
    /// Printed against asked, in each channel; `None` where nothing was asked for, or no spot is lit. Where a spot sees
    /// a share V of the sky, against what a surface of the asked albedo ρ would show there, V ρ / (1 − (1 − V) ρ).
    /// Spots that hardly see it ([`SpotRecord::is_lit`]) count in none of these numbers.
    pub against_asked: Option<Vec<Fit>>,
    /// Printed against predicted, in each channel, likewise; empty where no prediction is known.
    pub against_predicted: Vec<Fit>,
    /// Where colours were asked for: their differences.
    #[serde(default)]
    pub delta_e_2000: Option<Differences>,
    /// How far single spots are from what was asked for, as shares of that; `None` where nothing was or none is lit.
    #[serde(default)]
    pub relative: Option<Spread>,
    /// Distances from a shadow's edge at which the spots have values, mm, negative in the shadow: [`EDGE_MM`], or none.
    #[serde(default)]
    pub edge_mm: Vec<f64>,
    /// Printed against asked over all spots and these distances, in each channel; `None` where nothing was asked for or
    /// no edges were looked at.
    #[serde(default)]
    pub edges_against_asked: Option<Vec<Fit>>,
    /// Indices of the spots that are farthest from what was asked for (or predicted), the worst first.
    pub worst: Vec<usize>,
    /// The spots: those at random, then those that were named.
    pub spots: Vec<SpotRecord>,
    /// The pictures.
    #[serde(skip)]
    pub pictures: Vec<PreviewFile>,
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
        Some(folder) => voxels::read_volume(folder, &finished_manifest(folder)?, prepared, watch)?,
    };
    prepared.lit(volume)
}

fn finished_manifest(folder: &Path) -> Result<Manifest, LookError> {
    let fault = |finding: Finding| LookError::folder(folder, finding.to_string(), "the manifest of a finished job");
    read_manifest(folder)?.map_err(fault)
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
    let piece = prepared.between_mirrors(scene)?;
    let judged = piece.as_ref().unwrap_or(scene);
    let mut spots = prepared.random_spots(judged, options.spots, options.seed);
    spots.extend(options.at.iter().filter_map(|at| prepared.spot_near(judged, *at)));
    let shapes = if options.edges { edges::asked(prepared, &spots) } else { vec![None; spots.len()] };
    watch.go_on()?;
    let with_goal =
        |(spot, edge): (SurfaceSpot, Option<EdgeShape>)| Goal { expected: prepared.expected(&spot), spot, edge };
    let goals: Vec<Goal> = spots.into_iter().zip(shapes).map(with_goal).collect();
    let warnings = prepared.job.is_coarse.then(|| {
        format!(
            "a quick look: voxels of {:.2} mm, few stackings, nothing corrected; the print will come nearer to what is \
             asked",
            prepared.lattice.pitch.max_element()
        )
    });
    let is_piece = piece.is_some().then(|| {
        "a box that is layered from its top counts as a piece of a larger one: numbers are those between its mirror \
         images, on more of its core; pictures show it standing free, where its sides and underside let light in"
            .to_owned()
    });
    let warnings = warnings.into_iter().chain(is_piece).collect();
    let about = About { job: &prepared.job.name, channels: &prepared.materials.channels, warnings };
    let mut look = look_at_spots(about, judged, &goals, options, watch)?;
    let pictures = options.pictures.map(|options| pictures::pictures(Some(prepared), scene, &options, watch));
    look.pictures = pictures.transpose()?.unwrap_or_default();
    Ok(look)
}

/// Spots, and walks from each, that tell the time of a walk.
const PILOT: (usize, u64) = (64, 1000);

impl Prepared {
    /// Seconds of a walk in all channels through `volume`, its voxels on any lattice; `None` where resins have no
    /// coefficients or nothing shows.
    ///
    /// # Errors
    /// [`LookError::Stopped`].
    pub(in crate::job) fn seconds_of_a_walk(
        &self,
        volume: Volume,
        watch: &dyn Watch,
    ) -> Result<Option<f64>, LookError> {
        if !self.materials.has_coefficients() {
            return Ok(None);
        }
        let scene = self.scene_of(volume)?;
        let (spots, walks) = PILOT;
        let sites: Vec<Spot> = self.random_spots(&scene, spots, 1).into_iter().map(|spot| spot.spot).collect();
        if sites.is_empty() {
            return Ok(None);
        }
        let began = Instant::now();
        scene.printed_albedo(&sites, walks, 1, &StopOnly(watch))?;
        Ok(Some(began.elapsed().as_secs_f64() / (sites.len() as u64 * walks) as f64))
    }
}

/// A spot and what should show there.
struct Goal {
    spot: SurfaceSpot,
    /// Without a prediction where none is known.
    expected: Expected,
    edge: Option<EdgeShape>,
}

/// What a look says of its job.
struct About<'a> {
    job: &'a str,
    channels: &'a [String],
    warnings: Vec<String>,
}

/// The numbers of a look, without pictures. Opens a stage of spots.
fn look_at_spots(
    about: About<'_>,
    scene: &Scene,
    goals: &[Goal],
    options: &LookOptions,
    watch: &dyn Watch,
) -> Result<Look, LookError> {
    watch.stage("light", goals.len() as u64);
    let sites: Vec<Spot> = goals.iter().map(|goal| goal.spot.spot.clone()).collect();
    let edge_mm = if options.edges { &EDGE_MM[..] } else { &[] };
    let printed = scene.radiosity(&sites, edge_mm, options.walks, options.seed, watch)?;
    let record = |(Goal { spot, expected, edge }, printed): (&Goal, Vec<Option<Radiosity>>)| {
        let printed: Vec<Radiosity> = printed.into_iter().collect::<Option<_>>()?;
        let expected = expected.clone();
        let sky = shade::sky(scene, &spot.middle, 0.0);
        let estimates: Vec<Estimate> = printed.iter().map(|channel| channel.albedo).collect();
        let colours = |asked: &[f64]| differences::of_colours(&shade::all_shown(asked, sky), &estimates);
        Some(SpotRecord {
            object: spot.object,
            position_mm: spot.middle.point.to_array(),
            normal: spot.middle.normal.to_array(),
            delta_e_2000: expected.asked.as_deref().and_then(colours),
            edge: options.edges.then(|| edges::record(spot, edge.as_ref(), expected.asked.as_deref(), &printed)),
            asked: expected.asked,
            predicted: expected.predicted,
            sky,
            standard_error: estimates.iter().map(|albedo| albedo.standard_error).collect(),
            printed: estimates.iter().map(|albedo| albedo.mean).collect(),
        })
    };
    let spots: Vec<SpotRecord> = goals.iter().zip(printed).filter_map(record).collect();
    let channels = about.channels.to_vec();
    let (lit, numbers): (Vec<&SpotRecord>, Vec<usize>) =
        spots.iter().zip(0..).filter(|(spot, _)| spot.is_lit()).unzip();
    let all = |goal: &dyn Fn(&SpotRecord) -> Option<Vec<f64>>| -> Option<Vec<Vec<f64>>> {
        lit.iter().map(|spot| goal(spot)).collect::<Option<_>>().filter(|goals: &Vec<_>| !goals.is_empty())
    };
    let asked = all(&|spot| Some(spot.shows(spot.asked.as_deref()?)));
    let predicted = all(&|spot| Some(spot.shows(&spot.predicted)).filter(|known| known.len() == channels.len()));
    let mut worst: Vec<usize> = Vec::new();
    if let Some(goal) = asked.as_ref().or(predicted.as_ref()) {
        // By what the print as a whole is judged by: colour differences, or shares of the brightness.
        let coloured = asked.is_some() && lit.iter().all(|spot| spot.delta_e_2000.is_some());
        let off = |at: usize| {
            let seen = lit[at].delta_e_2000.filter(|_| coloured);
            seen.unwrap_or_else(|| differences::share_off(lit[at], &goal[at]))
        };
        worst.extend(0..lit.len());
        worst.sort_by(|a, b| off(*b).total_cmp(&off(*a)));
        worst.truncate(WORST);
        worst.iter_mut().for_each(|at| *at = numbers[*at]);
    }
    let colours: Option<Vec<f64>> = lit.iter().map(|spot| spot.delta_e_2000).collect();
    let against = |goal: &Vec<Vec<f64>>| differences::fits(&lit, goal, channels.len());
    Ok(Look {
        delta_e_2000: colours.and_then(Differences::of),
        relative: asked.as_ref().and_then(|asked| Spread::of_spots(&lit, asked)),
        edge_mm: edge_mm.to_vec(),
        edges_against_asked: edges::against_asked(&lit, channels.len()),
        generator: GENERATOR.to_owned(),
        version: LOOK_VERSION,
        job: about.job.to_owned(),
        walks: options.walks,
        seed: options.seed,
        spot_radius_mm: SPOT_RADIUS_MM,
        against_asked: asked.as_ref().map(against),
        against_predicted: predicted.as_ref().map(against).unwrap_or_default(),
        channels,
        warnings: about.warnings,
        worst,
        spots,
        pictures: Vec::new(),
    })
}

impl Look {
    /// How many spots hardly see the sky ([`SpotRecord::is_lit`]) and count in no mean.
    pub fn unlit(&self) -> usize {
        self.spots.iter().filter(|spot| !spot.is_lit()).count()
    }

    /// Its numbers without its spots but the worst.
    pub fn summary(&self) -> LookSummary {
        let unlit = self.unlit();
        LookSummary {
            spots: self.spots.len() - unlit,
            unlit,
            walks: self.walks,
            against_asked: self.against_asked.clone(),
            against_predicted: self.against_predicted.clone(),
            delta_e_2000: self.delta_e_2000,
            relative: self.relative,
            worst: self.worst.iter().map(|&spot| SpotRecord { edge: None, ..self.spots[spot].clone() }).collect(),
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
        output.finish_with_list(&OWNER, 1)
    }
}

/// What `look` writes.
pub const OWNER: Owner = Owner { command: "look", names: &[LOOK, "soft.png", "edge.png", "behind.png", "spot.png"] };
