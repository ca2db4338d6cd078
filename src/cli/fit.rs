//! `lumislice material fit`: totals of an integrating sphere into a material file.

use std::path::PathBuf;

use clap::Args;
use lumislice::measure::{Totals, TotalsFit, fit_totals, plus_minus};
use serde_json::json;

use super::{
    Answer, Result, failure::refuse, output_file::OutputFile, print, print_json, progress::Bars, say, table::table,
};

/// Fit a resin's coefficients to total reflectance and transmittance of sheets: integrating sphere, spectrophotometer.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// The resin, the instrument and the table of values (TOML); docs/measure.md lists every key.
    #[arg(value_name = "SHEETS.toml", help_heading = "Values")]
    sheets: PathBuf,
    /// Material file to write.
    #[arg(short, long, value_name = "MATERIAL.toml", help_heading = "Output")]
    output: PathBuf,
    /// Replace a file of that name.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<Answer> {
    let totals = Totals::read(&args.sheets)?;
    if args.output.exists() && !args.overwrite {
        refuse!("{}: found a file of that name, expected none (--overwrite replaces it)", args.output.display());
    }
    let output = OutputFile::open(&args.output)?;
    let bars = Bars::new(args.json);
    let fits = fit_totals(&totals, &bars);
    bars.finish();
    let fits = fits?;
    output.finish(totals.toml(&fits).as_bytes())?;
    let notes = totals.notes(&fits);
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    if args.json {
        let fit = |fit: &TotalsFit| {
            let [(reduced, its), (absorption, error)] = fit.coefficients_with_errors();
            json!({
                "channel": fit.channel,
                "reduced_scattering_per_mm": reduced,
                "reduced_scattering_error": its,
                "absorption_per_mm": absorption,
                "absorption_error": error,
                "scattering_per_mm": fit.coefficients.sigma_s,
                "g": fit.coefficients.g,
                "residual_rms": fit.residual,
                "misfit": fit.misfit,
                "values": fit.values,
            })
        };
        print_json(&json!({
            "resin": totals.resin.name,
            "material_file": args.output,
            "channels": fits.iter().map(fit).collect::<Vec<_>>(),
            "notes": notes,
        }))?;
        return Ok(Answer::Yes);
    }
    let row = |fit: &TotalsFit| {
        let [scattering, absorption] = fit.coefficients_with_errors().map(|(value, error)| plus_minus(value, error));
        let missed = format!("{:.4}", fit.residual);
        vec![fit.channel.clone(), scattering, absorption, fit.values.to_string(), missed]
    };
    let head = ["channel", "scattering (1 - g) per mm", "absorption per mm", "values", "missed by, rms"];
    let rows: Vec<Vec<String>> = fits.iter().map(row).collect();
    print(&(table(&head, &rows) + &format!("{}\n", args.output.display())))?;
    Ok(Answer::Yes)
}
