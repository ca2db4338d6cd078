//! `lumislice compare`: does the print look as promised?

use std::path::{Path, PathBuf};

use clap::{Args, builder::TypedValueParser};
use lumislice::{
    job::{
        Job, RunError,
        compare::{
            self, CompareError, CompareRequest, Comparison, JobFit, ObjectRequest, Spread, compare_into,
            compare_object_into,
        },
        look::PictureOptions,
    },
    output::{Existing, OutputFolder},
};

use super::{
    Answer, Result,
    cache::CacheArgs,
    document,
    failure::refuse,
    look::{View, parse_view},
    materials::{Corrected, Materials, prepared},
    print_words,
    progress::Bars,
    table::{number, table},
    warn_of,
};

/// Compare prints with the factored dataset they were made from.
///
/// Slabs are seen from above under even light, a shadow edge and a projected spot. With --job any shape that a map is
/// wrapped on is seen by a camera under the lamps of a look, its target and its prediction spread over the mesh.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Folders of finished jobs, slabs with target.kind = "bssrdf"; with --job the folder of that job, or none for its
    /// own voxels.
    #[arg(value_name = "OUT", help_heading = "Input")]
    jobs: Vec<PathBuf>,
    /// A job with target.kind = "bssrdf", of objects of any shape.
    #[arg(long, value_name = "JOB.toml", conflicts_with_all = ["dataset", "materials", "photons"], help_heading = "Input")]
    job: Option<PathBuf>,
    /// Folder that `lumislice factor` wrote and the jobs print.
    #[arg(long, value_name = "FOLDER", help_heading = "Input")]
    map: PathBuf,
    /// The dataset that the map was factored from: light by the 4D data themselves.
    #[arg(long, value_name = "DATASET", help_heading = "Input")]
    dataset: Option<PathBuf>,
    /// Resins by their coefficients: a material file, or the name of a built-in set; default: the set that the first
    /// job names.
    #[arg(long, value_name = "FILE|SET", help_heading = "Input")]
    materials: Option<PathBuf>,
    /// Photons through the voxels of each job, per light and channel; 0 leaves them out.
    #[arg(long, value_name = "N", default_value_t = 10_000_000, help_heading = "Light")]
    photons: u64,
    /// Seed of the photons.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Light")]
    seed: u64,
    /// Edge of a picture, pixels.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 240,
        value_parser = clap::value_parser!(u32).range(16..=4096).map(|n| n as usize),
        requires = "job",
        help_heading = "Objects"
    )]
    size: usize,
    /// Samples of every pixel: photons go from the camera.
    #[arg(
        long,
        value_name = "N",
        default_value_t = PictureOptions::default().samples,
        value_parser = clap::value_parser!(u32).range(2..=1_000_000),
        requires = "job",
        help_heading = "Objects"
    )]
    samples: u32,
    /// Where the camera stands: azimuth (counter-clockwise from +x) and elevation (2 to 90) in degrees.
    #[arg(
        long,
        value_name = "AZ,EL",
        value_parser = parse_view,
        allow_hyphen_values = true,
        requires = "job",
        help_heading = "Objects"
    )]
    view: Option<View>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Folder for sheet.html, sheet.png, edge.png (of slabs), comparison.json, and the numbers behind the pictures:
    /// radiosity.npy, noise.npy, places.csv.
    #[arg(short, long, value_name = "FOLDER", help_heading = "Output")]
    output: PathBuf,
    /// Replace the files that an earlier run wrote into FOLDER; only those its manifest lists.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Print comparison.json instead of a table.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<Answer> {
    let existing = Existing::overwrite(args.overwrite);
    OutputFolder::check(&args.output, &compare::OWNER, existing).map_err(CompareError::from)?;
    let materials = args.materials.as_deref().map(Materials::read).transpose()?.map(|materials| materials.file);
    if let Some(job) = &args.job {
        return objects(args, job, existing);
    }
    if args.photons == 1 {
        refuse!("--photons: found 1, expected 0 or at least 2");
    }
    let request = CompareRequest {
        map: args.map.clone(),
        jobs: args.jobs.clone(),
        dataset: args.dataset.clone(),
        materials,
        photons: args.photons,
        seed: args.seed,
    };
    let bars = Bars::new(args.json);
    let comparison = compare_into(&request, &args.output, existing, &bars);
    bars.finish();
    show(args, &comparison?)
}

/// Compares what the objects of a job show.
fn objects(args: &CompareArgs, job: &Path, existing: Existing) -> Result<Answer> {
    let folder = match args.jobs.as_slice() {
        [] => None,
        [folder] => Some(folder.as_path()),
        more => refuse!("OUT: found {} folders with --job, expected that of the job or none", more.len()),
    };
    let job = Job::load(job).map_err(RunError::from)?;
    let bars = Bars::new(args.json);
    let prepared = prepared(job, &args.cache, Corrected::As(&args.jobs), &bars)?;
    let pictures = PictureOptions {
        size: args.size,
        samples: args.samples,
        view_deg: args.view.map_or(PictureOptions::default().view_deg, |view| view.0),
        seed: args.seed,
        ..PictureOptions::default()
    };
    let request = ObjectRequest { map: &args.map, prepared: &prepared, folder, pictures };
    let comparison = compare_object_into(&request, &args.output, existing, &bars);
    bars.finish();
    show(args, &comparison?)
}

fn show(args: &CompareArgs, comparison: &Comparison) -> Result<Answer> {
    warn_of(&comparison.warnings, args.json);
    if document(args.json, comparison)? {
        return Ok(Answer::Yes);
    }
    print_words(&summary(comparison, &args.output.join("sheet.html").display().to_string()))?;
    Ok(Answer::Yes)
}

fn summary(comparison: &Comparison, page: &str) -> String {
    let mut rows = Vec::new();
    for stage in &comparison.stages {
        let goal = std::iter::once((&comparison.stages[0].name, &stage.differences));
        for (against, apart) in goal.chain(stage.against.iter().map(|(name, apart)| (name, apart))) {
            for (light, apart) in comparison.lights.iter().zip(apart) {
                rows.push(vec![
                    stage.name.clone(),
                    against.clone(),
                    (*light).to_owned(),
                    format!("{:+.4}", apart.bias),
                    format!("{:.4}", apart.rms),
                    number(apart.correlation, 4),
                ]);
            }
        }
    }
    let header = ["stage", "against", "light", "bias", "rms", "correlation"];
    let pictures = table(&header, &rows);
    let what = if comparison.view_deg.is_some() { "pixels" } else { "texels" };
    format!("{} × {} {what}, {page}\n{pictures}{}", comparison.width, comparison.height, fits(comparison))
}

/// How well each job's stackings fit the clusters.
fn fits(comparison: &Comparison) -> String {
    if comparison.jobs.is_empty() {
        return String::new();
    }
    let row = |job: &JobFit| {
        let spread = |of: Spread| [of.mean, of.worst].map(|value| format!("{value:.1e}"));
        let ([mean, worst], [scalar, scalar_worst]) = (spread(job.transport), spread(job.kubelka_munk));
        vec![job.name.clone(), mean, worst, scalar, scalar_worst, number(Some(job.albedo_rms), 4)]
    };
    let header = ["stackings of", "objective", "worst", "by Kubelka–Munk", "worst", "albedo rms"];
    let rows: Vec<_> = comparison.jobs.iter().map(row).collect();
    format!(
        "\n{}objective: squared difference from the clusters' profiles as they are, summed over frequencies, mean \
            over texels; \
         a job with gamut-map or another dc-weight aims elsewhere\n",
        table(&header, &rows)
    )
}
