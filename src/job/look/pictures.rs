//! The pictures of a look: asked, printed and their difference, of the whole object under four kinds of light.

use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    LookError,
    asked::{AskedLight, Detail},
};
use crate::{
    colour::{LinearRgb, Rgb, delta_e_2000, lab, linear_to_byte, linear_to_srgb},
    job::{Prepared, RunError},
    look::{Camera, Film, Ground, LAMPS, Lamps, Scene, Shown, Stage, smooth, smooth_chroma},
    preview::{LookPanel, PreviewFile, Scale, look_sheet},
    watch::Watch,
};

/// How to take pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureOptions {
    /// Edge of a panel, pixels.
    pub size: usize,
    /// Samples of every pixel at most.
    pub samples: u32,
    /// Time after which no further samples are begun.
    pub time: Option<Duration>,
    /// Azimuth (counter-clockwise from +x) and elevation of the camera, degrees.
    pub view_deg: [f64; 2],
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for PictureOptions {
    /// In front, a little to the right and above.
    fn default() -> Self {
        Self { size: 640, samples: 64, time: None, view_deg: [-62.0, 16.0], seed: 1 }
    }
}

impl PictureOptions {
    /// Small and soon done: what a job shows of itself.
    pub fn quick() -> Self {
        Self { size: 400, samples: 16, ..Self::default() }
    }

    /// A point for every few pixels of an object some cm high.
    fn detail(&self) -> Detail {
        if self.size > 512 {
            Detail { points_per_mm2: 30.0, rays: 24 }
        } else {
            Detail { points_per_mm2: 10.0, rays: 12 }
        }
    }
}

/// A kind of light: its name in files and in words, and what each lamp adds.
struct Mood {
    file: &'static str,
    name: &'static str,
    lamps: [f32; LAMPS],
}

/// One exposure for all.
const MOODS: [Mood; 4] = [
    Mood { file: "soft", name: "Soft light", lamps: [1.2, 0.0, 0.0, 0.0] },
    Mood { file: "edge", name: "Shadow edge", lamps: [0.15, 1.0, 0.0, 0.0] },
    Mood { file: "behind", name: "Light from behind", lamps: [0.1, 0.0, 1.3, 0.0] },
    Mood { file: "spot", name: "Projected spot", lamps: [0.12, 0.0, 0.0, 1.2] },
];

/// Albedo of the ground: a photographer's grey card, darker than what is mostly asked for, so that a print stands out.
const GROUND: f64 = 0.18;
/// Differences in colour, ΔE2000, that the false colours stand for, with equal steps between them, and in words.
const DELTA_E: [(f64, Rgb, &str); 5] = [
    (0.0, [0xf4, 0xf4, 0xf2], "0"),
    (2.0, [0xf8, 0xe4, 0xa0], "2"),
    (5.0, [0xf0, 0x9a, 0x4a], "5"),
    (10.0, [0xc2, 0x30, 0x30], "10"),
    (20.0, [0x48, 0x10, 0x50], "20+"),
];
/// Difference of encoded values at which the colour of a difference is full.
const FULL: f64 = 0.25;
/// Colours of a print that is as asked, too dark, too bright.
const DIFFERENCE: [Rgb; 3] = [[0xf4, 0xf4, 0xf2], [0x1f, 0x5f, 0xb4], [0xc2, 0x30, 0x20]];

/// What a pixel shows of the job.
#[derive(Clone, Copy)]
struct Seen {
    shown: Shown,
    /// Object, triangle and point of the mesh.
    surface: Option<(usize, u32, DVec3)>,
}

/// Takes the pictures, one file for each kind of light; without a job, of the print alone. Opens a stage of samples.
///
/// # Errors
/// [`LookError::Stopped`] before the first samples are whole; after that a stop ends the samples, and the pictures
/// show what there is.
pub(super) fn pictures(
    job: Option<&Prepared>,
    scene: &Scene,
    options: &PictureOptions,
    watch: &dyn Watch,
) -> Result<Vec<PreviewFile>, LookError> {
    let began = Instant::now();
    let Some(stage) = stage(scene, options) else { return Ok(Vec::new()) };
    watch.stage("look", u64::from(options.samples));
    let mut film = stage.film();
    watch.go_on()?;
    let seen = seen(job, &stage, &film);
    let asked = job.and_then(|job| {
        let light = AskedLight::new(job, &stage, &options.detail(), options.seed)?;
        Some(spread(job, &light, &seen, Which::Asked))
    });
    watch.go_on()?;
    let in_time = || options.time.is_none_or(|time| began.elapsed() < time);
    match stage.expose(&mut film, options.samples, options.seed, watch, in_time) {
        Err(stopped) if film.samples() == 0 => return Err(stopped.into()),
        _ => {}
    }
    let printed = printed(scene, &stage, &film, &seen);
    let is_coarse = job.is_some_and(|job| job.job.is_coarse);
    let shown = Shots { seen: &seen, asked: asked.as_deref(), printed: &printed, samples: film.samples(), is_coarse };
    MOODS.iter().map(|mood| sheet(mood, &stage, &shown)).collect()
}

/// The print on the ground before a camera, with its lamps; `None` where nothing is printed.
pub(super) fn stage<'a>(scene: &'a Scene, options: &PictureOptions) -> Option<Stage<'a>> {
    let bounds = scene.bounds()?;
    let [azimuth, elevation] = options.view_deg.map(f64::to_radians);
    let camera = Camera::new(bounds, azimuth, elevation, [options.size; 2]);
    let middle = 0.5 * options.size as f64;
    let aim = scene.meets(camera.from(middle, middle), -camera.axes[2]).unwrap_or(camera.middle);
    let ground = Ground { z: bounds[0].z, albedo: GROUND };
    Some(Stage { scene, camera, lamps: Lamps::around(&camera, aim), ground, surface: true })
}

/// What every pixel shows.
fn seen(job: Option<&Prepared>, stage: &Stage<'_>, film: &Film) -> Vec<Seen> {
    let width = film.size[0];
    let pixel = |(pixel, met): (usize, &Option<DVec3>)| match met {
        Some(met) => {
            let objects = job.map_or(&[][..], |job| job.slicer().objects());
            let near = objects.iter().enumerate().map(|(object, field)| (object, field.surface().closest(*met)));
            let found = near.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
            let normal = match found {
                Some((object, found)) => {
                    let corners = objects[object].surface().triangles()[found.triangle as usize];
                    super::surface::normal_and_area(&corners).map(|(normal, _)| normal)
                }
                None => stage.scene.normal_near(*met),
            };
            let kind = found.map_or(1, |(object, _)| object as u32 + 1);
            let normal = normal.unwrap_or(stage.camera.axes[2]).as_vec3();
            Seen {
                shown: Shown { position: met.as_vec3(), normal, kind },
                surface: found.map(|(object, found)| (object, found.triangle, found.point)),
            }
        }
        None => {
            let from = stage.camera.from((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            let to = -stage.camera.axes[2];
            let position = from + to * ((stage.ground.z - from.z) / to.z);
            Seen { shown: Shown { position: position.as_vec3(), normal: Vec3::Z, kind: 0 }, surface: None }
        }
    };
    film.met.par_iter().enumerate().map(pixel).collect()
}

/// What of a surface point is shown.
#[derive(Clone, Copy, PartialEq)]
enum Which {
    Asked,
    Predicted,
}

/// What every pixel should show, by channel and lamp; nothing where it shows no object.
fn spread(prepared: &Prepared, light: &AskedLight, seen: &[Seen], which: Which) -> Vec<Option<Vec<[f32; LAMPS]>>> {
    let pixel = |seen: &Seen| {
        let (object, triangle, point) = seen.surface?;
        let (label, _) = prepared.wanted_at(object, triangle, point);
        let expected = prepared.expected_at(object, triangle, point);
        let albedo = if which == Which::Asked { expected.asked? } else { expected.predicted };
        let mut spread = light.spread_at(object, label, point);
        for (lamps, albedo) in spread.iter_mut().zip(albedo) {
            *lamps = lamps.map(|lamp| lamp * albedo as f32);
        }
        Some(spread)
    };
    seen.par_iter().map(pixel).collect()
}

/// What a camera sees of an object under every lamp, by channel and lamp, in units of what a white matt sheet shows.
pub(in crate::job) struct ObjectLight {
    /// Where on a mesh each pixel looks, mm; `None` where it shows no object.
    pub surface: Vec<Option<DVec3>>,
    /// By equation 7 with the targets' profiles.
    pub asked: Vec<Option<Vec<[f32; LAMPS]>>>,
    /// By equation 7 with the profiles predicted for the stackings.
    pub predicted: Vec<Option<Vec<[f32; LAMPS]>>>,
    /// By light through the voxels: mean and variance of every pixel, `[channel][lamp]`, nothing smoothed.
    pub printed: Vec<Vec<(Vec<f32>, Vec<f32>)>>,
    /// Edge of a pixel, mm.
    pub pixel_mm: f64,
}

/// Looks at a job's objects in numbers; `predicted` has Hankel transforms by object, label of the target and channel.
/// `None` where nothing is printed or asked for. Opens a stage of samples.
///
/// # Errors
/// [`LookError::Stopped`].
pub(in crate::job) fn object_light(
    prepared: &Prepared,
    scene: &Scene,
    predicted: &[Vec<Vec<Vec<f64>>>],
    options: &PictureOptions,
    watch: &dyn Watch,
) -> Result<Option<ObjectLight>, LookError> {
    let Some(stage) = stage(scene, options) else { return Ok(None) };
    watch.stage("photons", u64::from(options.samples));
    let mut film = stage.film();
    watch.go_on()?;
    let seen = seen(Some(prepared), &stage, &film);
    let detail = Detail { points_per_mm2: 30.0, rays: 24 };
    let Some(light) = AskedLight::new(prepared, &stage, &detail, options.seed) else { return Ok(None) };
    watch.go_on()?;
    let promised = light.by_profiles(prepared, predicted);
    let [asked, predicted] = [(&light, Which::Asked), (&promised, Which::Predicted)]
        .map(|(light, which)| spread(prepared, light, &seen, which));
    watch.go_on()?;
    stage.expose(&mut film, options.samples, options.seed, watch, || true)?;
    let of_channel = |&channel: &usize| (0..LAMPS).map(|lamp| film.image(channel, lamp)).collect();
    Ok(Some(ObjectLight {
        surface: seen.iter().map(|seen| seen.surface.map(|(_, _, point)| point)).collect(),
        asked,
        predicted,
        printed: scene.distinct().iter().map(of_channel).collect(),
        pixel_mm: stage.camera.pixel_mm,
    }))
}

/// The smoothed film, by lamp, channel and pixel.
fn printed(scene: &Scene, stage: &Stage<'_>, film: &Film, seen: &[Seen]) -> Vec<Vec<Vec<f32>>> {
    let shown: Vec<Shown> = seen.iter().map(|seen| seen.shown).collect();
    let of = |lamp: usize| -> Vec<Vec<f32>> {
        let distinct = 1 + scene.distinct().iter().copied().max().unwrap_or(0);
        let image = |channel: usize| {
            let (mean, variance) = film.image(channel, lamp);
            smooth(&shown, film.size[0], stage.camera.pixel_mm as f32, mean, variance)
        };
        let images: Vec<_> = (0..distinct).map(image).collect();
        let mut channels: Vec<_> = scene.distinct().iter().map(|&channel| images[channel].clone()).collect();
        if distinct > 1 {
            let grain = scene.volume().lattice().pitch.max_element() / stage.camera.pixel_mm;
            smooth_chroma(&shown, film.size[0], grain as f32, &mut channels);
        }
        channels
    };
    (0..LAMPS).map(of).collect()
}

/// Channels as a colour: three are its own, of others the first is grey.
fn colour(channels: &[f32]) -> LinearRgb {
    if let [r, g, b] = *channels { [r, g, b] } else { [channels.first().copied().unwrap_or(0.0); 3] }
}

/// What pictures are made of.
struct Shots<'a> {
    seen: &'a [Seen],
    asked: Option<&'a [Option<Vec<[f32; LAMPS]>>]>,
    printed: &'a [Vec<Vec<f32>>],
    samples: u32,
    /// Of a job that was made coarse.
    is_coarse: bool,
}

/// The false colour of a difference in colour.
fn difference_colour(apart: f64) -> Rgb {
    let above = DELTA_E.iter().position(|step| apart < step.0).unwrap_or(DELTA_E.len() - 1).max(1);
    let [from, to] = [DELTA_E[above - 1], DELTA_E[above]];
    blend(from.1, to.1, ((apart - from.0) / (to.0 - from.0)).clamp(0.0, 1.0))
}

/// Between two colours.
fn blend(from: Rgb, to: Rgb, part: f64) -> Rgb {
    std::array::from_fn(|c| {
        let [from, to] = [from[c], to[c]].map(f64::from);
        (from + (to - from) * part).round() as u8
    })
}

/// The colours of [`DELTA_E`] as they are drawn beside a picture.
fn difference_scale() -> Scale {
    const COLOURS: usize = 256;
    let at = |n: usize| {
        let along = n as f64 / (COLOURS - 1) as f64 * (DELTA_E.len() - 1) as f64;
        let step = (along as usize).min(DELTA_E.len() - 2);
        blend(DELTA_E[step].1, DELTA_E[step + 1].1, along - step as f64)
    };
    Scale { colours: (0..COLOURS).map(at).collect(), ticks: DELTA_E.map(|step| step.2).to_vec() }
}

fn sheet(mood: &Mood, stage: &Stage<'_>, shots: &Shots<'_>) -> Result<PreviewFile, LookError> {
    let Shots { seen, asked, printed, samples, is_coarse } = *shots;
    let channels = stage.scene.channels();
    let sum = |of: &dyn Fn(usize, usize) -> f32| {
        let channel = |channel: usize| (0..LAMPS).map(|lamp| mood.lamps[lamp] * of(channel, lamp)).sum();
        colour(&(0..channels).map(channel).collect::<Vec<f32>>())
    };
    let print = |pixel: usize| sum(&|channel, lamp| printed[lamp][channel][pixel]);
    let want = |pixel: usize| match asked.and_then(|asked| asked[pixel].as_ref()) {
        Some(spread) => sum(&|channel, lamp| spread[channel][lamp]),
        None => print(pixel),
    };
    let is_coloured = channels == 3;
    let bytes = |light: LinearRgb| light.map(|light| linear_to_byte(f64::from(light)));
    let differ = |pixel: usize| {
        if seen[pixel].surface.is_none() {
            return DIFFERENCE[0].map(|byte| byte - 12);
        }
        let level = |light: LinearRgb| -> f64 {
            light.iter().map(|l| linear_to_srgb(f64::from(*l).clamp(0.0, 1.0)) / 3.0).sum()
        };
        if is_coloured {
            let [print, want] = [print(pixel), want(pixel)].map(|light| lab(light.map(|l| f64::from(l.max(0.0)))));
            return difference_colour(delta_e_2000(print, want));
        }
        let apart: f64 = level(print(pixel)) - level(want(pixel));
        blend(DIFFERENCE[0], DIFFERENCE[if apart < 0.0 { 1 } else { 2 }], (apart.abs() / FULL).min(1.0))
    };
    let panel = |name: &str, of: &(dyn Fn(usize) -> Rgb + Sync)| LookPanel {
        name: name.to_owned(),
        pixels: (0..seen.len()).into_par_iter().map(of).collect(),
        scale: None,
    };
    let mut panels = Vec::new();
    if asked.is_some() {
        panels.push(panel("asked", &|pixel| bytes(want(pixel))));
    }
    let name = if is_coarse { "a coarse print, not corrected" } else { "printed" };
    panels.push(panel(name, &|pixel| bytes(print(pixel))));
    if asked.is_some() {
        let (name, scale) = match is_coloured {
            true => ("difference, ΔE2000", Some(difference_scale())),
            false => ("red too bright, blue too dark", None),
        };
        panels.push(LookPanel { scale, ..panel(name, &differ) });
    }
    let note = match is_coarse {
        true => format!("quick look: large voxels, few stackings, no rounds; {samples} samples a pixel, smoothed"),
        false => format!("{samples} samples a pixel, smoothed"),
    };
    let path = format!("look/{}.png", mood.file);
    look_sheet(path, mood.name, &note, stage.camera.size, &panels).map_err(|error| RunError::from(error).into())
}
