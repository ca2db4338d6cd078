//! `lumislice material measure`: photographs of a resin into a material file.

use std::path::{Path, PathBuf};

use clap::Args;
use lumislice::measure::{Capture, ChannelMeasurement, Measurement, SeriesMeasurement, measure, plus_minus};
use serde_json::json;

use super::{
    Answer, Result, document, failure::refuse, note, output_file::OutputFile, print_words, progress::Bars, table::table,
};

/// Measure a resin from photographs: exposure brackets under a point of light, dark series, grey card and screen.
#[derive(Debug, Args)]
pub struct MeasureArgs {
    /// What the pictures show (TOML); docs/measure.md lists every key.
    #[arg(value_name = "CAPTURE.toml", help_heading = "Pictures")]
    capture: PathBuf,
    /// Material file to write; profiles (CSV) and a report (HTML) go beside it, their names begin with its.
    #[arg(short, long, value_name = "MATERIAL.toml", help_heading = "Output")]
    output: PathBuf,
    /// Replace files of the same names.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Runs the command.
pub fn run(args: &MeasureArgs) -> Result<Answer> {
    let capture = Capture::read(&args.capture)?;
    let outputs = args.open_outputs(&capture)?;
    let bars = Bars::new(args.json);
    let measurement = measure(capture, &bars);
    bars.finish();
    let measurement = measurement?;
    let mut contents = measurement.files(&args.stem()?);
    contents.insert(0, (format!("{}-report.html", args.stem()?), measurement.report_html()?));
    for (output, (name, content)) in outputs.into_iter().zip(contents) {
        debug_assert_eq!(output.0, name);
        output.1.finish(content.as_bytes())?;
    }
    for channel in &measurement.channels {
        channel
            .all_findings()
            .for_each(|(series, finding)| note(&format!("{}{series}: {finding}", measurement.prefix(channel))));
    }
    if !document(args.json, &record(&measurement, &args.output))? {
        print_words(&summary(&measurement, &args.output))?;
    }
    Ok(Answer::Yes)
}

impl MeasureArgs {
    /// What the names of all files begin with.
    fn stem(&self) -> Result<String> {
        let toml = self.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
        match self.output.file_stem() {
            Some(stem) if toml => Ok(stem.to_string_lossy().into_owned()),
            _ => refuse!("{}: found a name without .toml, expected that of a material file", self.output.display()),
        }
    }

    /// Reserves every file before the slow work; the material file comes last: where it is, all are.
    fn open_outputs(&self, capture: &Capture) -> Result<Vec<(String, OutputFile)>> {
        let stem = self.stem()?;
        let folder = self.output.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let mut outputs = Vec::new();
        for name in [format!("{stem}-report.html")].into_iter().chain(Measurement::file_names(capture, &stem)) {
            let path = folder.join(&name);
            if path.exists() && !self.overwrite {
                refuse!("{}: found a file of that name, expected none (--overwrite replaces it)", path.display());
            }
            let file = OutputFile::open(&path)?;
            outputs.push((name, file));
        }
        Ok(outputs)
    }
}

fn series(channel: &ChannelMeasurement) -> [(&'static str, &SeriesMeasurement); 2] {
    [("reflection", &channel.reflection), ("transmission", &channel.transmission)]
}

fn summary(measurement: &Measurement, output: &Path) -> String {
    let mut rows = Vec::new();
    for channel in &measurement.channels {
        for (name, series) in series(channel) {
            let scan = &series.scan;
            let reach = scan.extrapolated_from.map_or(series.profile.reach_mm(), |from| scan.edges_mm[from]);
            let half = series.profile.radius_of_energy(0.5);
            rows.push(vec![
                format!("{}{name}", measurement.prefix(channel)),
                plus_minus(series.albedo.value, series.albedo.error),
                half.map_or("-".into(), |radius| format!("{radius:.3}")),
                format!("{reach:.2}"),
                format!("{:.2}, {:.2} ± {:.4}", scan.centre_px[0], scan.centre_px[1], scan.centre_error_px),
                scan.exposures_s.len().to_string(),
            ]);
        }
    }
    let head = ["profile", "albedo", "half within mm", "measured to mm", "centre px", "exposures"];
    table(&head, &rows) + &coefficients(measurement) + &format!("{}\n", output.display())
}

/// What fits each channel's slab, if anything does.
fn coefficients(measurement: &Measurement) -> String {
    let row = |channel: &ChannelMeasurement| {
        let residual = format!("{:.1e}", channel.fit.as_ref().ok()?.residual);
        let found = channel.coefficients()?.map(|(value, error)| plus_minus(value, error));
        let label = format!("{}coefficients", measurement.prefix(channel));
        Some([label].into_iter().chain(found).chain([residual]).collect())
    };
    let rows: Vec<Vec<String>> = measurement.channels.iter().filter_map(row).collect();
    let head = ["fitted", "scattering (1 - g) per mm", "absorption per mm", "g", "residual rms"];
    if rows.is_empty() { String::new() } else { table(&head, &rows) }
}

fn record(measurement: &Measurement, output: &Path) -> serde_json::Value {
    let one = |series: &SeriesMeasurement| {
        let scan = &series.scan;
        json!({
            "albedo": series.albedo.value,
            "albedo_error": series.albedo.error,
            "half_energy_radius_mm": series.profile.radius_of_energy(0.5),
            "extrapolated_from_mm": scan.extrapolated_from.map(|from| scan.edges_mm[from]),
            "centre_px": scan.centre_px,
            "centre_error_px": scan.centre_error_px,
            "gain_e_per_dn": scan.gain_e_per_dn,
            "blur_left": scan.blur_bound,
            "tilt_degrees": scan.tilt.map(|tilt| tilt.degrees),
            "tilt_error_degrees": scan.tilt.map(|tilt| tilt.error),
            "least_tilt_seen_degrees": scan.tilt.map(|tilt| tilt.least()),
            "exposures_s": scan.exposures_s,
        })
    };
    let channel = |channel: &ChannelMeasurement| {
        let findings = channel.all_findings();
        json!({
            "channel": channel.name,
            "reflection": one(&channel.reflection),
            "transmission": one(&channel.transmission),
            "fit": channel.fit.as_ref().ok().map(|fit| json!({
                "scattering_per_mm": fit.coefficients.sigma_s,
                "absorption_per_mm": fit.coefficients.sigma_a,
                "g": fit.coefficients.g,
                "residual_rms": fit.residual,
            })),
            "findings": findings.map(|(series, finding)| format!("{series}: {finding}")).collect::<Vec<_>>(),
        })
    };
    json!({
        "resin": measurement.capture.resin.name,
        "thickness_mm": measurement.capture.resin.thickness_mm,
        "material_file": output,
        "channels": measurement.channels.iter().map(channel).collect::<Vec<_>>(),
    })
}
