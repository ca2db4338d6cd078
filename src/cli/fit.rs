//! `lumislice material fit`: totals of an integrating sphere, or photographs of a coupon, into a material file.

use std::path::{Path, PathBuf};

use clap::Args;
use lumislice::measure::{
    CARD_ERROR, Coupon, CouponFit, Photographs, Reading, Totals, TotalsFit, fit_coupon, fit_totals, plus_minus,
};
use serde_json::{Value, json};

use super::{
    Answer, Result, document, failure::refuse, note, output_file::OutputFile, print, progress::Bars, table::table,
};

/// Fit coefficients: a resin's to total reflectance and transmittance of sheets (integrating sphere,
/// spectrophotometer), or those of all resins of a printed coupon to photographs of it.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// The resin, the instrument and the table of values (TOML); docs/measure.md lists every key.
    #[arg(value_name = "SHEETS.toml", required_unless_present = "coupon", help_heading = "Values")]
    sheets: Option<PathBuf>,
    /// The coupon.json that `material coupon` wrote; goes with --photo and --card.
    #[arg(
        long,
        value_name = "COUPON.json",
        requires_all = ["photo", "card", "card_albedo"],
        conflicts_with = "sheets",
        help_heading = "Photographs"
    )]
    coupon: Option<PathBuf>,
    /// A photograph of the coupon, straight from above in a tent's even light; linear, 16-bit PNG or TIFF, or EXR.
    /// Several are averaged, however the coupon is turned in them.
    #[arg(long, value_name = "PICTURE", requires = "coupon", help_heading = "Photographs")]
    photo: Vec<PathBuf>,
    /// The same with a matt card in the coupon's place, at the same exposure.
    #[arg(long, value_name = "PICTURE", requires = "coupon", help_heading = "Photographs")]
    card: Option<PathBuf>,
    /// The card's albedo, 0 to 1; one number for all channels.
    #[arg(long, value_name = "SHARE", value_parser = share, requires = "coupon", help_heading = "Photographs")]
    card_albedo: Option<f64>,
    /// One standard deviation of the card's albedo, 0 to 1: all fields are off by it together. Without: a hundredth of
    /// it.
    #[arg(long, value_name = "SHARE", value_parser = share, requires = "coupon", help_heading = "Photographs")]
    card_error: Option<f64>,
    /// The same with the lens covered.
    #[arg(long, value_name = "PICTURE", requires = "coupon", help_heading = "Photographs")]
    dark: Option<PathBuf>,
    /// Whether the camera sees what the coupon's surface mirrors of the tent.
    #[arg(
        long,
        value_name = "WHICH",
        value_parser = ["included", "excluded"],
        default_value = "excluded",
        requires = "coupon",
        help_heading = "Photographs"
    )]
    specular: String,
    /// One standard deviation of a field's value as a share of it, beside the pixels' noise.
    #[arg(
        long,
        value_name = "SHARE",
        value_parser = share,
        default_value_t = 0.01,
        requires = "coupon",
        help_heading = "Photographs"
    )]
    relative_error: f64,
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

fn share(text: &str) -> std::result::Result<f64, String> {
    let share = text.parse().ok().filter(|share| *share > 0.0 && *share <= 1.0);
    share.ok_or_else(|| format!("found `{text}`, expected a share above 0 and at most 1"))
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<Answer> {
    if args.output.exists() && !args.overwrite {
        refuse!("{}: found a file of that name, expected none (--overwrite replaces it)", args.output.display());
    }
    match (&args.sheets, &args.coupon, &args.card, args.card_albedo) {
        (Some(sheets), ..) => run_sheets(args, sheets),
        (None, Some(coupon), Some(card), Some(card_albedo)) => {
            let photographs = Photographs {
                coupon: args.photo.clone(),
                card: card.clone(),
                dark: args.dark.clone(),
                card_albedo,
                card_error: args.card_error.map_or(CARD_ERROR, |error| error / card_albedo),
                specular: args.specular == "included",
                relative_error: args.relative_error,
            };
            run_coupon(args, coupon, &photographs)
        }
        _ => refuse!("found neither SHEETS.toml nor --coupon, expected one of them"),
    }
}

fn run_coupon(args: &FitArgs, file: &Path, photographs: &Photographs) -> Result<Answer> {
    let coupon = Coupon::read(file)?;
    let output = OutputFile::open(&args.output)?;
    let bars = Bars::new(args.json);
    let fits =
        Reading::of(&coupon, photographs).and_then(|reading| Ok((fit_coupon(&coupon, &reading, &bars)?, reading)));
    bars.finish();
    let (fits, reading) = fits?;
    output.finish(coupon.toml(&reading, &fits)?.as_bytes())?;
    let notes = coupon.notes(&reading, &fits)?;
    notes.iter().for_each(|text| note(text));
    let resins = || coupon.resins.iter().enumerate();
    if document(args.json, &coupon_record(args, &coupon, &reading, &fits, &notes))? {
        return Ok(Answer::Yes);
    }
    let row = |place: usize, fit: &CouponFit| {
        let [scattering, absorption] =
            fit.coefficients_with_errors(place).map(|(value, error)| plus_minus(value, error));
        vec![coupon.resins[place].name.clone(), fit.channel.clone(), scattering, absorption]
    };
    let rows: Vec<Vec<String>> = resins().flat_map(|(place, _)| fits.iter().map(move |fit| row(place, fit))).collect();
    let head = ["resin", "channel", "scattering (1 - g) per mm", "absorption per mm"];
    let missed: Vec<_> = fits.iter().map(|fit| format!("{} {:.4}", fit.channel, fit.residual)).collect();
    let fields = coupon.fields.len();
    print(&format!(
        "{}{fields} fields, missed by so much of the light, rms: {}\n{}\n",
        table(&head, &rows),
        missed.join(", "),
        args.output.display()
    ))?;
    Ok(Answer::Yes)
}

/// The document of a coupon's fits.
fn coupon_record(args: &FitArgs, coupon: &Coupon, reading: &Reading, fits: &[CouponFit], notes: &[String]) -> Value {
    let fit = |fit: &CouponFit| {
        let resin = |(place, resin): (usize, &lumislice::measure::CouponResin)| {
            let [(reduced, its), (absorption, error)] = fit.coefficients_with_errors(place);
            json!({
                "resin": resin.name,
                "reduced_scattering_per_mm": reduced,
                "reduced_scattering_error": its,
                "absorption_per_mm": absorption,
                "absorption_error": error,
                "scattering_per_mm": fit.coefficients[place].sigma_s,
                "g": fit.coefficients[place].g,
            })
        };
        json!({
            "channel": fit.channel,
            "residual_rms": fit.residual,
            "misfit": fit.misfit,
            "resins": coupon.resins.iter().enumerate().map(resin).collect::<Vec<_>>(),
        })
    };
    json!({
        "material_file": args.output,
        "pixels_per_mm": reading.pixels_per_mm,
        "marks_off_mm": reading.marks_off_mm,
        "channels": fits.iter().map(fit).collect::<Vec<_>>(),
        "notes": notes,
    })
}

/// The document of the fits of sheets.
fn sheets_record(args: &FitArgs, totals: &Totals, fits: &[TotalsFit], notes: &[String]) -> Value {
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
    json!({
        "resin": totals.resin.name,
        "material_file": args.output,
        "channels": fits.iter().map(fit).collect::<Vec<_>>(),
        "notes": notes,
    })
}

fn run_sheets(args: &FitArgs, sheets: &Path) -> Result<Answer> {
    let totals = Totals::read(sheets)?;
    let output = OutputFile::open(&args.output)?;
    let bars = Bars::new(args.json);
    let fits = fit_totals(&totals, &bars);
    bars.finish();
    let fits = fits?;
    output.finish(totals.toml(&fits).as_bytes())?;
    let notes = totals.notes(&fits);
    notes.iter().for_each(|text| note(text));
    if document(args.json, &sheets_record(args, &totals, &fits, &notes))? {
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
