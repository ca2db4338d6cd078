//! `lumislice material simulate`: profiles from volume coefficients, and a material file that uses them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use lumislice::{
    optics::{MaterialFile, Model, SlabPlan},
    watch::Thousandths,
};

use serde_json::json;

use super::{
    Answer, Result, document,
    failure::{Failure, refuse},
    materials::Materials,
    output_file::OutputFile,
    print,
    progress::Bars,
    table::table,
    warn,
};

/// Simulate slabs of resins given by coefficients: profiles as CSV, and a material file that uses them.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// A material file (TOML), or the name of a built-in set.
    #[arg(value_name = "FILE|SET", help_heading = "Resins")]
    materials: PathBuf,
    /// Simulate this resin only. Repeatable.
    #[arg(long, value_name = "NAME", help_heading = "Resins")]
    resin: Vec<String>,
    /// Thickness of the slabs, mm, at most 100; default: the file's, else chosen by optical thickness.
    #[arg(long, value_name = "MM", value_parser = parse_thickness, help_heading = "Simulation")]
    thickness_mm: Option<f64>,
    /// Photons per slab, at least 2; the built-in profiles have 20000000.
    #[arg(long, value_name = "N", default_value_t = Model::DEFAULT_PHOTONS,
          value_parser = clap::value_parser!(u64).range(2..), help_heading = "Simulation")]
    photons: u64,
    /// Seed of the first slab's random numbers, the others follow; default: that of the built-in profiles.
    #[arg(long, value_name = "N", help_heading = "Simulation")]
    seed: Option<u64>,
    /// Folder to write; default ./<set>-simulated.
    #[arg(short, long, value_name = "FOLDER", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Replace files of the same names in FOLDER.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
}

fn parse_thickness(text: &str) -> Result<f64, String> {
    let valid = |mm: &f64| *mm > 0.0 && *mm <= 100.0;
    text.parse().ok().filter(valid).ok_or_else(|| "expected a thickness in mm, above 0 and at most 100".to_owned())
}

/// Runs the command.
pub fn run(args: &SimulateArgs) -> Result<Answer> {
    let Materials { file, .. } = Materials::read(&args.materials)?;
    let plans = args.plans(&file)?;
    let folder = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}-simulated", file.file_stem())));
    let toml = format!("{}.toml", file.file_stem());
    args.check_folder(&folder, plans.iter().map(|plan| &plan.file).chain([&toml]))?;
    let bars = Bars::new(false);
    let mut rows = Vec::new();
    for (index, plan) in plans.iter().enumerate() {
        let name = format!("{} {} ({} of {})", plan.resin, plan.channel, index + 1, plans.len());
        let profile = plan.simulate(args.photons, &Thousandths::begin(&bars, &name, args.photons));
        bars.finish();
        let profile = profile?;
        let content = profile.profiles().to_csv(&profile.comment());
        OutputFile::open(&folder.join(&plan.file))?.finish(content.as_bytes())?;
        let (r, t) = (profile.reflection(), profile.transmission());
        rows.push(vec![
            plan.file.clone(),
            format!("{}", plan.thickness_mm),
            format!("{:.5} ± {:.5}", r.mean, r.standard_error),
            format!("{:.5} ± {:.5}", t.mean, t.standard_error),
        ]);
    }
    // Last: a folder with a material file is complete.
    OutputFile::open(&folder.join(&toml))?.finish(file.toml_with(&plans).as_bytes())?;
    let path = folder.join(&toml);
    document(false, &json!({ "material_file": path.to_string_lossy() }))?;
    print(&(table(&["profile", "mm", "reflects", "transmits"], &rows) + &format!("{}\n", path.display())))?;
    Ok(Answer::Yes)
}

impl SimulateArgs {
    fn plans(&self, file: &MaterialFile) -> Result<Vec<SlabPlan>> {
        for name in &self.resin {
            file.resin_id(name)?;
            if file.volume(name).is_none() {
                refuse!(
                    "--resin {name}: found no coefficients to simulate, expected scattering-per-mm and \
                        absorption-per-mm"
                );
            }
        }
        for name in file.resin_names().filter(|name| self.resin.is_empty() && file.volume(name).is_none()) {
            warn(&format!("resin {name} has no coefficients and is left out"));
        }
        let mut plans = file.slab_plans(self.seed);
        plans.retain(|plan| self.resin.is_empty() || self.resin.contains(&plan.resin));
        if let Some(thickness_mm) = self.thickness_mm {
            plans.iter_mut().for_each(|plan| plan.thickness_mm = thickness_mm);
        }
        if plans.is_empty() {
            refuse!("{}: found no resin with coefficients, expected one to simulate", self.materials.display());
        }
        Ok(plans)
    }

    /// Creates the folder and refuses to replace anything unasked, before the slow work.
    fn check_folder<'a>(&self, folder: &Path, files: impl Iterator<Item = &'a String>) -> Result<()> {
        if folder.exists() && !folder.is_dir() {
            refuse!("{}: found a file, expected a folder", folder.display());
        }
        let mut paths = files.map(|file| folder.join(file));
        if let Some(path) = paths.find(|path| path.exists() && !self.overwrite) {
            refuse!("{}: found a file of that name, expected none (--overwrite replaces it)", path.display());
        }
        let writing = |error| Failure::writing(folder.display(), error);
        fs::create_dir_all(folder).map_err(writing)?;
        tempfile::tempfile_in(folder).map_err(writing)?;
        Ok(())
    }
}
