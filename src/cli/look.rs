//! `lumislice look`: how a job will look.

use std::{path::PathBuf, time::Duration};

use clap::{Args, builder::TypedValueParser};
use lumislice::{
    glam::DVec3,
    job::{
        Job, ROUNDS, RunError,
        look::{
            self, Differences, FinishedFolder, Fit, Look, LookError, LookOptions, PictureOptions, look_at, scene_for,
            write_mitsuba,
        },
    },
    output::{Existing, OutputFolder},
};

use super::{
    Answer, Result,
    cache::CacheArgs,
    document,
    failure::{Failure, refusal, refuse},
    materials::{Corrected, Materials, prepared},
    note, print_words,
    progress::Bars,
    start::{default_folder, is_mesh},
    table::table,
    warn_of,
};

/// Send light through the voxels of a job: what is asked for beside what is printed.
///
/// Prints the albedo of the print (radiosity per irradiance, under the same light from every direction) at spots of its
/// surface, against the albedo that is asked for there and the one that was predicted for a flat slab.
#[derive(Debug, Args)]
pub struct LookArgs {
    /// A job file, or the folder of a finished job, whose slices are looked at.
    #[arg(value_name = "OUT|JOB.toml")]
    what: PathBuf,
    /// The job that OUT was made from: its meshes, and what it asks for. Without it, what OUT knows: its slices, and
    /// what was asked for at the spots of its look.json.
    #[arg(long, value_name = "JOB.toml", help_heading = "Input")]
    job: Option<PathBuf>,
    /// Resins of OUT without a job, where they are of no built-in set: a TOML file or the name of a set.
    #[arg(long, value_name = "M", conflicts_with = "job", help_heading = "Input")]
    materials: Option<PathBuf>,
    /// Take what rounds of correction found from this folder, where a run of the same job left it; else they are found
    /// anew, to the same numbers. Without this flag they are looked for in OUT, or for a job in the folders that
    /// `slice` writes by default: <job name>-out, here or beside the job.
    #[arg(long, value_name = "FOLDER", conflicts_with = "materials", help_heading = "Work")]
    rounds_from: Option<PathBuf>,
    /// Folder to write pictures and look.json into.
    #[arg(short, long, value_name = "FOLDER", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Replace the files of an earlier look in FOLDER.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Spots at random, evenly over the surface.
    #[arg(long, value_name = "N", default_value_t = LookOptions::default().spots, help_heading = "Work")]
    spots: usize,
    /// One more spot, at the surface point nearest to X,Y,Z mm in the lattice's frame; may be repeated.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_position, allow_hyphen_values = true, help_heading = "Work")]
    at: Vec<DVec3>,
    /// Photons for each spot and channel, at least 2.
    #[arg(
        long,
        value_name = "N",
        default_value_t = LookOptions::default().walks,
        value_parser = clap::value_parser!(u64).range(2..),
        help_heading = "Work"
    )]
    photons: u64,
    /// Seed of spots and photons.
    #[arg(long, value_name = "S", default_value_t = 1, help_heading = "Work")]
    seed: u64,
    /// Write the scene for Mitsuba 3 into this folder: grids of the print, the same camera and lamps.
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    mitsuba: Option<PathBuf>,
    /// Edge of a picture, pixels.
    #[arg(
        long,
        value_name = "N",
        default_value_t = PictureOptions::default().size,
        value_parser = clap::value_parser!(u32).range(16..=4096).map(|n| n as usize),
        help_heading = "Pictures"
    )]
    size: usize,
    /// Samples of every pixel, at most.
    #[arg(
        long,
        value_name = "N",
        default_value_t = PictureOptions::default().samples,
        value_parser = clap::value_parser!(u32).range(1..=1_000_000),
        help_heading = "Pictures"
    )]
    samples: u32,
    /// Begin no further samples after so many seconds.
    #[arg(long, value_name = "S", value_parser = parse_seconds, help_heading = "Pictures")]
    time: Option<Duration>,
    /// Where the camera stands: azimuth (counter-clockwise from +x) and elevation (2 to 90) in degrees.
    #[arg(long, value_name = "AZ,EL", value_parser = parse_view, allow_hyphen_values = true, help_heading = "Pictures")]
    view: Option<View>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

fn parse_position(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if x.is_finite() && y.is_finite() && z.is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("found `{text}`, expected three numbers of mm, X,Y,Z")),
    }
}

/// Azimuth and elevation, degrees.
#[derive(Debug, Clone, Copy)]
pub(super) struct View(pub(super) [f64; 2]);

pub(super) fn parse_view(text: &str) -> Result<View, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[azimuth, elevation]) if azimuth.is_finite() && (2.0..=90.0).contains(&elevation) => {
            Ok(View([azimuth, elevation]))
        }
        _ => Err(format!("found `{text}`, expected an azimuth and an elevation from 2 to 90 degrees, AZ,EL")),
    }
}

fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse::<f64>().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| format!("found `{text}`, expected a number of seconds"))
}

/// Runs the command.
pub fn run(args: &LookArgs) -> Result<Answer> {
    let folder = args.what.is_dir().then_some(args.what.as_path());
    let job = match (folder, &args.job) {
        (None, None) => Some(&args.what),
        (Some(_), job) => job.as_ref(),
        (None, Some(_)) => refuse!("{}: found no folder, expected one with --job", args.what.display()),
    };
    if job.is_none() && args.rounds_from.is_some() {
        refuse!("--rounds-from: found a folder without its job, whose slices are looked at, expected --job beside it");
    }
    if job.is_some() && args.materials.is_some() {
        refuse!("--materials: found a job, which names its resins, expected a folder without");
    }
    let materials = args.materials.as_deref().map(Materials::read).transpose()?.map(|materials| materials.file);
    if let Some(mesh) = job.filter(|job| is_mesh(job)) {
        let mesh = mesh.display();
        refuse!(
            "{mesh}: found a mesh, expected a job (`lumislice init {mesh}` writes one) or the folder of a finished one"
        );
    }
    let job = job.map(|job| Job::load(job).map_err(RunError::from)).transpose()?;
    let existing = Existing::overwrite(args.overwrite);
    if let Some(folder) = &args.output {
        OutputFolder::check(folder, &look::OWNER, existing)?;
    }
    if let Some(folder) = &args.mitsuba {
        OutputFolder::check(folder, &look::MITSUBA, existing)?;
    }
    let bars = Bars::new(args.json);
    let pictures = PictureOptions {
        size: args.size,
        samples: args.samples,
        time: args.time,
        view_deg: args.view.map_or(PictureOptions::default().view_deg, |view| view.0),
        seed: args.seed,
    };
    let options = LookOptions {
        spots: args.spots,
        at: args.at.clone(),
        walks: args.photons,
        seed: args.seed,
        edges: true,
        pictures: args.output.is_some().then_some(pictures),
    };
    let with_job = |job: Job| -> Result<(Look, Vec<PathBuf>), LookError> {
        let folders = rounds_folders(args, &job);
        let prepared = prepared(job, &args.cache, Corrected::As(&folders), &bars)?;
        if let Some(found) = folders.iter().find(|folder| prepared.took_rounds_from(folder)) {
            bars.finish();
            note(&format!("rounds of correction as {} has them", found.join(ROUNDS).display()));
        }
        let scene = scene_for(&prepared, folder, &bars)?;
        if let Some(folder) = &args.mitsuba {
            write_mitsuba(&prepared, &scene, &pictures, folder, existing, &bars)?;
        }
        Ok((look_at(&prepared, &scene, &options, &bars)?, prepared.files()))
    };
    let alone = || -> Result<(Look, Vec<PathBuf>), LookError> {
        let inputs: Vec<PathBuf> = std::iter::once(&args.what).chain(&args.materials).cloned().collect();
        let print = FinishedFolder::read(&args.what, materials.as_ref(), &bars)?;
        if let Some(folder) = &args.mitsuba {
            print.write_mitsuba(&pictures, folder, existing, &inputs, &bars)?;
        }
        Ok((print.look(&options, &bars)?, inputs))
    };
    let result = job.map_or_else(alone, with_job);
    bars.finish();
    let (look, inputs) = match args.mitsuba {
        None => result.map_err(Failure::before_writing)?,
        Some(_) => result?,
    };
    warn_of(&look.warnings, false);
    if look.spots.is_empty() {
        return Err(refusal!("surface: found no spot that shows, expected one at least"));
    }
    if let Some(folder) = &args.output {
        look.write(folder, existing, &inputs)?;
    }
    if document(args.json, &look)? {
        return Ok(Answer::Yes);
    }
    print_words(&summary(&look))?;
    Ok(Answer::Yes)
}

/// Folders that rounds of correction of `job` may lie in, the likeliest first.
fn rounds_folders(args: &LookArgs, job: &Job) -> Vec<PathBuf> {
    if let Some(given) = args.rounds_from.as_deref().or(args.what.is_dir().then_some(&args.what)) {
        return vec![given.to_path_buf()];
    }
    let name = default_folder(job);
    let beside = args.what.with_file_name(&name);
    if beside == name { vec![name] } else { vec![name, beside] }
}

/// Spots that are listed where nothing is known of what they should show.
const FIRST: usize = 10;

pub(super) fn summary(look: &Look) -> String {
    let against = |name: &str, fits: &[Fit]| -> Vec<Vec<String>> {
        let row = |(channel, fit): (&String, &Fit)| {
            vec![
                channel.clone(),
                name.to_owned(),
                format!("{:+.4}", fit.bias),
                format!("{:.4}", fit.rms),
                format!("{:.1}%", 100.0 * fit.relative_rms),
            ]
        };
        look.channels.iter().zip(fits).map(row).collect()
    };
    let mut rows = look.against_asked.as_deref().map_or_else(Vec::new, |fits| against("asked", fits));
    rows.extend(against("predicted", &look.against_predicted));
    rows.extend(
        look.edges_against_asked.as_deref().map_or_else(Vec::new, |fits| against("asked, shadow's edge", fits)),
    );
    let mut text = format!("{}: {} spots under even light\n", look.job, look.spots.len());
    let unlit = look.unlit();
    if unlit > 0 {
        text +=
            &format!("not counted: {unlit} that hardly see the sky; what they show has come through from elsewhere\n");
    }
    if !rows.is_empty() {
        text += &table(&["channel", "printed against", "bias", "rms", "relative"], &rows);
    }
    if let Some(Differences { median, ninety_percent, worst, .. }) = look.delta_e_2000 {
        text += &format!("ΔE2000 to asked: median {median:.2}, 90% below {ninety_percent:.2}, worst {worst:.2}\n");
    }
    let numbers = |values: &[f64]| values.iter().map(|value| format!("{value:.3}")).collect::<Vec<_>>().join(" ");
    let or_dash = |values: &[f64]| if values.is_empty() { "–".to_owned() } else { numbers(values) };
    let row = |index: &usize| {
        let spot = &look.spots[*index];
        vec![
            spot.position_mm.map(|at| format!("{at:.2}")).join(", "),
            spot.asked.as_deref().map_or_else(|| "–".to_owned(), |asked| numbers(&spot.shows(asked))),
            or_dash(&spot.shows(&spot.predicted)),
            numbers(&spot.printed),
            numbers(&spot.standard_error),
        ]
    };
    // Without anything to hold it against there is no worst; the first spots stand for all.
    let known = !look.worst.is_empty();
    let first: Vec<usize> = (0..look.spots.len().min(FIRST)).collect();
    let listed: Vec<_> = if known { &look.worst } else { &first }.iter().map(row).collect();
    text += if known { "\nworst spots\n" } else { "\nspots\n" };
    text += &table(&["position (mm)", "asked", "predicted", "printed", "±"], &listed);
    let hollow = look.spots.iter().any(|spot| spot.sky < 0.99);
    text + if hollow { "asked and predicted: as they show there, with less light in hollows\n" } else { "" }
}
