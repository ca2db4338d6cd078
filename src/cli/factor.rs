//! `lumislice factor`: from a measured BSSRDF to local profiles and clusters.

use std::path::PathBuf;

use clap::Args;
use lumislice::{
    appearance::bssrdf::{BssrdfError, ClusterCount, FactorOptions},
    job::factor::{self, FactorError, FactorRequest, Factored, factor_into},
    output::{Existing, OutputFolder},
    words::counted,
};

use super::{Answer, Result, document, failure::refusal, print_words, progress::Bars, tell::events, warn};

/// Factor a measured BSSRDF into a profile per texel, and group the profiles.
#[derive(Debug, Args)]
pub struct FactorArgs {
    /// A folder with dataset.toml, the path of that file, or a .npz.
    #[arg(value_name = "DATASET", help_heading = "Dataset")]
    dataset: PathBuf,
    /// Turn red, green and blue into luminance (Rec. 709).
    #[arg(long, help_heading = "Dataset")]
    luminance: bool,
    /// Expected second difference of ln P from ring to ring, above 0; less is smoother.
    #[arg(long, value_name = "LN", default_value_t = FactorOptions::default().roughness, help_heading = "Fit")]
    roughness: f64,
    /// Most rounds of the fit.
    #[arg(long, value_name = "N", default_value_t = FactorOptions::default().rounds as u64,
          value_parser = clap::value_parser!(u64).range(1..=100), help_heading = "Fit")]
    rounds: u64,
    /// Also fit one profile for all texels, and one scaled per texel, and tell their errors.
    #[arg(long, help_heading = "Fit")]
    compare: bool,
    /// Number of clusters, at most the number of texels; default 100.
    #[arg(short = 'k', long, value_name = "K", conflicts_with = "max_rms", help_heading = "Clusters")]
    clusters: Option<usize>,
    /// As few clusters as keep the root mean square error of the profiles' Hankel coefficients below this.
    #[arg(long, value_name = "RMS", help_heading = "Clusters")]
    max_rms: Option<f64>,
    /// Seed of the clusters.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Clusters")]
    seed: u64,
    /// Weight of the albedo in the distance of two profiles, as in the search.
    #[arg(long, value_name = "W", default_value_t = 1.0, value_parser = parse_weight, help_heading = "Clusters")]
    dc_weight: f64,
    /// Folder to write.
    #[arg(short, long, value_name = "FOLDER", help_heading = "Output")]
    output: PathBuf,
    /// Replace the files that an earlier run wrote into FOLDER; only those its manifest lists.
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    /// Print factored.json instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// The most that a window can leave over and still tell a profile. The clearest of the Monte Carlo sets leaves 39%.
const MOST_BEYOND: f64 = 0.9;

fn parse_weight(text: &str) -> Result<f64, String> {
    let valid = |weight: &f64| (0.0..=1e6).contains(weight);
    text.parse().ok().filter(valid).ok_or_else(|| "expected a number from 0 to 1000000".to_owned())
}

/// Runs the command.
pub fn run(args: &FactorArgs) -> Result<Answer> {
    let existing = Existing::overwrite(args.overwrite);
    OutputFolder::check(&args.output, &factor::OWNER, existing).map_err(FactorError::from)?;
    let request = FactorRequest {
        dataset: args.dataset.clone(),
        luminance: args.luminance,
        options: FactorOptions { roughness: args.roughness, rounds: args.rounds as usize, ..FactorOptions::default() },
        count: args.clusters.map(ClusterCount::Fixed).or(args.max_rms.map(ClusterCount::Within)),
        seed: args.seed,
        dc_weight: args.dc_weight,
        compare: args.compare,
    };
    let bars = Bars::new(args.json);
    let factored = factor_into(&request, &args.output, existing, &bars);
    bars.finish();
    let factored = factored.map_err(|error| match error {
        FactorError::Dataset(BssrdfError::NotThree { .. }) => refusal!("{error} for --luminance"),
        error => error.into(),
    })?;
    if !args.json || events().is_some() {
        warn_of_fits(&factored);
    }
    if document(args.json, &factored)? {
        return Ok(Answer::Yes);
    }
    print_words(&summary(&factored, &args.output.display().to_string()))?;
    Ok(Answer::Yes)
}

fn warn_of_fits(factored: &Factored) {
    for fit in &factored.fits {
        let channel = &fit.channel;
        if !fit.converged {
            let rounds = fit.rounds.len();
            warn(&format!("{channel}: the fit was still moving after {rounds} rounds (--rounds)"));
        }
        fit.doubts.iter().for_each(|doubt| warn(&format!("{channel}: {doubt}")));
        if fit.missing_values > 0 {
            warn(&format!("{channel}: {} values are missing and were left out", fit.missing_values));
        }
        let tail = &fit.tail;
        if tail.continued > 0 {
            let count = tail.continued;
            warn(&format!(
                "{channel}: {count} texels have no measured albedo, their light beyond {:.2} mm is a guess",
                tail.from_mm
            ));
        }
        let all = tail.mean_energy_in_window + tail.mean_energy_in_tail;
        if tail.fitted + tail.stretched > 0 && tail.mean_energy_in_tail > MOST_BEYOND * all {
            let (share, from) = (100.0 * tail.mean_energy_in_tail / all, tail.from_mm);
            warn(&format!(
                "{channel}: {share:.1}% of the albedo lies beyond the windows, which end at {from:.4} mm: is \
                    the pitch in mm?"
            ));
        }
        if tail.none > 0 && tail.none > factored.width * factored.height / 100 {
            let count = tail.none;
            warn(&format!("{channel}: the windows of {count} texels hold more light than their albedo"));
        }
    }
    if factored.texels_without_data > 0 {
        let count = factored.texels_without_data;
        warn(&format!("{count} masked texels have their nearest neighbour's profile"));
    }
}

fn summary(factored: &Factored, folder: &str) -> String {
    let [width, height] = factored.window;
    let mut text = format!(
        "{} × {} texels of {} mm, windows of {width} × {height}, {} in {folder}\n",
        factored.width,
        factored.height,
        factored.pitch_mm,
        counted(factored.clusters.len(), "cluster")
    );
    for fit in &factored.fits {
        let (tail, percent) = (&fit.tail, |share: f64| 100.0 * share);
        text += &format!(
            "  {}: equation 7 misses {:.2}% of the data in {}, {:.2}% beyond the lit texel (noise {:.2}%{})",
            fit.channel,
            percent(fit.relative_error),
            counted(fit.rounds.len(), "round"),
            percent(fit.relative_error_beyond_centre),
            percent(fit.noise()),
            fit.reciprocity.map_or(String::new(), |both| format!(", both ways differ by {:.2}%", percent(both)))
        );
        for simpler in &fit.simpler {
            let (all, beyond) = (percent(simpler.relative_error), percent(simpler.relative_error_beyond_centre));
            text += &format!("; {} {all:.2}%, {beyond:.2}%", simpler.model);
        }
        text += &format!(
            "\n     {:.1}% of the light lies beyond {:.2} mm",
            percent(tail.mean_energy_in_tail / (tail.mean_energy_in_window + tail.mean_energy_in_tail)),
            tail.from_mm
        );
        if let (Some(without), Some(continued), Some(with)) =
            (tail.albedo_rms_error_without, tail.albedo_rms_error_continued, tail.albedo_rms_error_with)
        {
            text += &format!(
                ": albedo off by {without:.4} without it, {continued:.4} if continued, {with:.4} as fitted (rms)"
            );
        }
        text.push('\n');
    }
    text + &format!("  clusters in place of texels change R̂ by {:.1e} (rms)\n", factored.cluster_rms)
}
