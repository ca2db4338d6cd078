//! `lumislice compare`: does the printed slab look as promised?

use std::path::PathBuf;

use clap::Args;
use lumislice::{
    job::compare::{self, CompareError, CompareRequest, Comparison, JobFit, Spread, compare_into},
    output::{Existing, OutputFolder},
};

use super::{
    Answer, Result,
    failure::refuse,
    materials::Materials,
    print, print_json,
    progress::Bars,
    say,
    table::{number, table},
};

/// Compare printed slabs with the factored dataset they were made from: under even light, a shadow edge and a projected
/// spot.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Folders of finished jobs, slabs with target.kind = "bssrdf".
    #[arg(value_name = "OUT", help_heading = "Input")]
    jobs: Vec<PathBuf>,
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
    /// Folder for sheet.html, sheet.png, edge.png, comparison.json, and the numbers behind the pictures: radiosity.npy,
    /// noise.npy, places.csv.
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
    let comparison = comparison?;
    if args.json {
        print_json(&comparison)?;
        return Ok(Answer::Yes);
    }
    comparison.warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
    print(&summary(&comparison, &args.output.join("sheet.html").display().to_string()))?;
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
    format!("{} × {} texels, {page}\n{pictures}{}", comparison.width, comparison.height, fits(comparison))
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
