//! `lumislice material coupon`: a test piece to print and to photograph.

use std::path::PathBuf;

use clap::Args;
use lumislice::{
    job::{self, Finished, Job, RunError, RunOptions},
    measure::{Coupon, NamedResin},
    output::{Existing, OutputFolder, Owner},
    voxel::Printer,
    words::{dimensions, short},
};
use serde_json::json;

use super::{
    Answer, Result,
    cache::CacheArgs,
    document,
    failure::{Failure, refuse},
    materials::{Corrected, Materials, prepared},
    print,
    progress::Bars,
    warn_of,
};

/// Make a test piece of all resins of a set: a job, its slices, and where its fields are, for `material fit --coupon`.
#[derive(Debug, Args)]
pub struct CouponArgs {
    /// A material file (TOML), or the name of a built-in set: which resins there are, and what is believed of them.
    #[arg(long, value_name = "FILE|SET", help_heading = "Coupon")]
    materials: PathBuf,
    /// Preset of the printer.
    #[arg(long, value_name = "PRESET", default_value = "j750-27um", help_heading = "Coupon")]
    printer: String,
    /// Side of a field, mm, 8 to 40.
    #[arg(long, value_name = "MM", default_value_t = 8.0, help_heading = "Coupon")]
    spacing_mm: f64,
    /// Folder to write: coupon.toml with its meshes, coupon.json, and the slices under print/.
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Replace the files of an earlier coupon in OUT.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Write no slices: `lumislice slice OUT/coupon.toml` makes them.
    #[arg(long, help_heading = "Output")]
    no_slices: bool,
    #[command(flatten)]
    cache: CacheArgs,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const OWNER: Owner = Owner { command: "material coupon", names: &["coupon.toml", "coupon.json", "meshes/"] };
/// Folder of the slices.
const PRINT: &str = "print";

/// Runs the command.
pub fn run(args: &CouponArgs) -> Result<Answer> {
    let printer = Printer::by_name(&args.printer)?;
    let mut materials = Materials::read(&args.materials)?;
    let bars = Bars::new(args.json);
    if let Some(resin) = materials.lacks_coefficients(&bars)? {
        refuse!(
            "{}: resin {resin}: found no coefficients, expected some to start from; rough ones will do",
            args.materials.display()
        );
    }
    let file = &materials.file;
    let resins: Vec<NamedResin> = file
        .resins_printed()
        .filter_map(|(name, printed)| {
            let (rgba, density_g_per_cm3) = file.colour_and_density(name)?;
            let believed = file.volume(name)?.to_vec();
            Some(NamedResin { name: name.to_owned(), rgba, density_g_per_cm3, background: !printed, believed })
        })
        .collect();
    let coupon =
        Coupon::new(file.name(), file.channels(), &resins, (&printer.name, printer.pitch_mm.z), args.spacing_mm)?;
    let source = match materials.built_in {
        true => format!("set = \"{}\"", file.name()),
        false => {
            let whole = match args.materials.canonicalize() {
                Ok(whole) => whole,
                Err(error) => refuse!("{}: cannot be read: {error}", args.materials.display()),
            };
            let Some(whole) = whole.to_str() else {
                refuse!("{}: found a path that is not UTF-8, expected one that a job can name", whole.display());
            };
            format!("file = {}", toml::Value::from(whole))
        }
    };
    let (text, meshes) = coupon.job(&source);
    let existing = Existing::overwrite(args.overwrite);
    let print_folder = args.output.join(PRINT);
    OutputFolder::check(&args.output, &OWNER, existing).map_err(RunError::from)?;
    OutputFolder::check(&print_folder, &job::OWNER, existing).map_err(RunError::from)?;
    let output = OutputFolder::create(&args.output, &OWNER, existing, std::slice::from_ref(&args.materials))
        .map_err(RunError::from)?;
    for (name, content) in &meshes {
        output.write(name, content).map_err(RunError::from)?;
    }
    output.write("coupon.toml", text.as_bytes()).map_err(RunError::from)?;
    output.write("coupon.json", &coupon.json()).map_err(RunError::from)?;
    output.finish_with_list(&OWNER, 1).map_err(RunError::from)?;
    let mut warnings = Vec::new();
    for resin in resins.iter().filter(|resin| resin.background) {
        let name = &resin.name;
        warnings.push(format!("resin {name} is what the printer fills holes with: no field shows it, it is left out"));
    }
    if !args.no_slices {
        let job = Job::load(args.output.join("coupon.toml")).map_err(RunError::from)?;
        let prepared = prepared(job, &args.cache, Corrected::As(&[]), &bars);
        bars.finish();
        let prepared = prepared.map_err(Failure::before_writing)?;
        let result = job::run(&prepared, &print_folder, &RunOptions { existing, slices: None }, &bars);
        bars.finish();
        let Finished { manifest, .. } = result?;
        warnings.extend(manifest.warnings);
    }
    warn_of(&warnings, false);
    let names: Vec<_> = coupon.resins.iter().map(|resin| resin.name.as_str()).collect();
    if document(
        args.json,
        &json!({
            "output": args.output.to_string_lossy(),
            "size_mm": coupon.size_mm,
            "fields": coupon.fields.len(),
            "resins": names,
            "warnings": warnings,
        }),
    )? {
        return Ok(Answer::Yes);
    }
    let folder = args.output.display();
    print(&format!(
        "{} mm, {} fields of {} mm: {}\n{folder}/coupon.toml, {folder}/coupon.json{}\n",
        dimensions(coupon.size_mm),
        coupon.fields.len(),
        short(coupon.spacing_mm),
        names.join(", "),
        if args.no_slices { String::new() } else { format!(", slices in {folder}/{PRINT}") },
    ))?;
    Ok(Answer::Yes)
}
