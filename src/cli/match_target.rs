//! `lumislice match`: the stack of layers that reflects most like a target.

use std::path::PathBuf;

use anyhow::{anyhow, bail};
use clap::Args;
use lumislice::{
    job::{NamedLimit, Progress, SUPPORT, SUPPORT_MIN_DEPTH_MM, StackingOptions},
    optics::{FrequencyGrid, ProfileFile},
    search::{BlockTable, Match, SearchError, SearchOptions, SearchTarget, match_target},
    target::NormalizedDiffusion,
};
use serde_json::json;

use super::{
    Answer, leave_at_once,
    materials::Materials,
    print, print_json,
    progress::Bars,
    say,
    table::{number, table},
};

/// Mean free paths that make sense, as in a job.
const MEAN_FREE_PATH_MM: std::ops::RangeInclusive<f64> = 1e-4..=1000.0;

/// Find the stack of layers that reflects most like a target.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("wanted").required(true).multiple(false).args(["target", "albedo"]))]
pub struct MatchArgs {
    /// Resins: a material file (TOML), or the name of a built-in set.
    #[arg(long, value_name = "FILE|SET", help_heading = "Target")]
    materials: PathBuf,
    /// Profile to match, CSV with r_mm,reflection_per_mm2; once for all channels, or once for each.
    #[arg(long, value_name = "PROFILE.csv", help_heading = "Target")]
    target: Vec<PathBuf>,
    /// Albedo to match, 0 to 1; one number for all channels, or one for each: 0.6,0.5,0.4.
    #[arg(long, value_name = "A", value_delimiter = ',', requires = "mean_free_path_mm", help_heading = "Target")]
    albedo: Vec<f64>,
    /// Mean free path 1/σt of the material to match, mm; one number, or one for each channel.
    #[arg(long, value_name = "L", value_delimiter = ',', requires = "albedo", help_heading = "Target")]
    mean_free_path_mm: Vec<f64>,
    /// Resin of the half-space below the stack; default: nothing lies there and no light returns.
    #[arg(long, value_name = "RESIN", help_heading = "Stack")]
    core: Option<String>,
    /// Thickest stack, mm.
    #[arg(long, value_name = "MM", default_value_t = 5.0, help_heading = "Stack")]
    max_thickness_mm: f64,
    /// Depth a resin keeps from the surface, RESIN:MM; support keeps 0.2 mm unless told otherwise. Repeatable.
    #[arg(long, value_name = "RESIN:MM", value_parser = parse_min_depth, help_heading = "Stack")]
    min_depth: Vec<(String, f64)>,
    /// Units the thickest stack is divided into, 1 to 4096.
    #[arg(long, value_name = "N", default_value_t = 64, help_heading = "Search")]
    units: usize,
    /// Blocks a stack may be made of, 1 to 12; each further one multiplies the time.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = parse_depth, help_heading = "Search")]
    depth: usize,
    /// Weight of the albedo against the other coefficients, 0 or more.
    #[arg(long, value_name = "W", default_value_t = 1.0, help_heading = "Search")]
    dc_weight: f64,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

fn parse_min_depth(text: &str) -> Result<(String, f64), String> {
    let fault = || "expected RESIN:MM, the depth in mm, 0 to 100".to_owned();
    let (name, mm) = text.rsplit_once(':').ok_or_else(fault)?;
    let mm: f64 = mm.trim().parse().map_err(|_| fault())?;
    let valid = !name.trim().is_empty() && (0.0..=100.0).contains(&mm);
    if valid { Ok((name.trim().to_owned(), mm)) } else { Err(fault()) }
}

fn parse_depth(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|depth| (1..=12).contains(depth)).ok_or_else(|| "expected 1 to 12".to_owned())
}

/// Runs the command.
pub fn run(args: &MatchArgs) -> anyhow::Result<Answer> {
    let materials = Materials::read(&args.materials)?;
    let target = args.target(materials.file.channels().len())?;
    let core = args.core.as_deref().map(|name| materials.file.resin_index(name)).transpose()?;
    let limits = args.limits(&materials)?;
    let bars = Bars::new(args.json);
    let set = materials.load(&bars)?;
    let options = SearchOptions {
        max_thickness_mm: args.max_thickness_mm,
        units: args.units,
        depth: args.depth,
        dc_weight: args.dc_weight,
        limits,
        core,
        max_nodes: None,
    };
    // Nothing is being written, and a search does not listen.
    leave_at_once();
    bars.stage("search", 0);
    let resins: Vec<_> = set.resins.iter().map(|resin| resin.kubelka_munk.clone()).collect();
    let found = BlockTable::new(&resins, &options).and_then(|table| match_target(&table, &target));
    bars.finish();
    let found = match found {
        Ok(found) => found,
        Err(error @ SearchError::Infeasible { .. }) => {
            if args.json {
                print_json(&json!({ "stack": null, "reason": error.to_string() }))?;
            }
            say(&format!("no: {error}"));
            return Ok(Answer::No);
        }
        Err(error) => return Err(error.into()),
    };
    let layers: Vec<(&str, f64)> =
        found.stacking.layers.iter().map(|layer| (set.resins[layer.resin].name.as_str(), layer.thickness_mm)).collect();
    if args.json {
        let stack: Vec<_> =
            layers.iter().map(|(material, mm)| json!({ "material": material, "thickness_mm": mm })).collect();
        print_json(&json!({
            "stack": stack,
            "objective": { "km": found.objective, "transport": null, "monte_carlo": null },
            "bound": found.bound,
            "proven": found.proven,
            "nodes": found.nodes,
        }))?;
    } else {
        print(&args.report(&found, &target, &layers, &set.channels))?;
    }
    Ok(Answer::Yes)
}

impl MatchArgs {
    /// What is to be matched, on the grid of all resins.
    fn target(&self, channels: usize) -> anyhow::Result<SearchTarget> {
        let grid = FrequencyGrid::default();
        let per_channel = |flag: &str, given: usize| match given {
            1 => Ok(()),
            n if n == channels => Ok(()),
            n => Err(anyhow!("{flag}: found {n} values, expected 1 or {channels}, one for each channel")),
        };
        let of = |values: &[f64], channel: usize| values[channel.min(values.len() - 1)];
        if !self.target.is_empty() {
            per_channel("--target", self.target.len())?;
            let spectra = self.target.iter().map(|path| {
                let Some(reflection) = ProfileFile::read(path)?.reflection else {
                    bail!("{}: header: found no reflection_per_mm2 column, expected one", path.display());
                };
                Ok(reflection.hankel(&grid).values)
            });
            let spectra = spectra.collect::<anyhow::Result<Vec<_>>>()?;
            let channels = (0..channels).map(|channel| spectra[channel.min(spectra.len() - 1)].clone());
            return Ok(SearchTarget { channels: channels.collect() });
        }
        per_channel("--albedo", self.albedo.len())?;
        per_channel("--mean-free-path-mm", self.mean_free_path_mm.len())?;
        if let Some(found) = self.albedo.iter().find(|albedo| !(0.0..=1.0).contains(*albedo)) {
            bail!("--albedo: found {found}, expected 0 to 1");
        }
        if let Some(found) = self.mean_free_path_mm.iter().find(|mm| !MEAN_FREE_PATH_MM.contains(*mm)) {
            let (least, most) = (MEAN_FREE_PATH_MM.start(), MEAN_FREE_PATH_MM.end());
            bail!("--mean-free-path-mm: found {found}, expected {least} to {most} mm");
        }
        let spectra = (0..channels).map(|channel| {
            let material = NormalizedDiffusion::new(of(&self.albedo, channel), of(&self.mean_free_path_mm, channel));
            Ok(material?.spectrum(&grid))
        });
        Ok(SearchTarget { channels: spectra.collect::<anyhow::Result<_>>()? })
    }

    fn limits(&self, materials: &Materials) -> anyhow::Result<Vec<lumislice::search::ResinLimit>> {
        let mut limits: Vec<NamedLimit> = Vec::new();
        let limit = |resin: &str, min_depth_mm: f64| NamedLimit {
            resin: resin.to_owned(),
            min_depth_mm,
            min_mm: 0.0,
            max_mm: f64::INFINITY,
        };
        for (resin, mm) in &self.min_depth {
            materials.file.resin_index(resin)?;
            if limits.iter().any(|other| other.resin == *resin) {
                bail!("--min-depth: found {resin} a second time, expected each resin once");
            }
            limits.push(limit(resin, *mm));
        }
        if limits.iter().all(|limit| limit.resin != SUPPORT) {
            limits.push(limit(SUPPORT, SUPPORT_MIN_DEPTH_MM));
        }
        let names: Vec<_> = materials.file.resin_names().collect();
        let options = StackingOptions {
            max_thickness_mm: self.max_thickness_mm,
            units: self.units,
            depth: self.depth,
            dc_weight: self.dc_weight,
            core: self.core.clone(),
            limits,
        };
        Ok(options.resin_limits(&names))
    }

    fn report(&self, found: &Match, target: &SearchTarget, layers: &[(&str, f64)], channels: &[String]) -> String {
        let rows: Vec<_> = layers.iter().map(|(name, mm)| vec![(*name).to_owned(), format!("{mm:.4}")]).collect();
        let below = self.core.as_ref().map_or("nothing".to_owned(), |core| format!("a half-space of {core}"));
        let mut text = format!("from the observer down, over {below}:\n{}", table(&["layer", "mm"], &rows));
        let rms = |channel: usize| {
            let (r, t) = (&found.reflection[channel], &target.channels[channel]);
            let squares: f64 = r.iter().zip(t).map(|(r, t)| (r - t) * (r - t)).sum();
            (squares / r.len() as f64).sqrt()
        };
        let rows: Vec<_> = channels
            .iter()
            .enumerate()
            .map(|(channel, name)| {
                let albedo = |spectra: &[Vec<f64>]| number(spectra[channel].first().copied(), 4);
                vec![name.clone(), albedo(&target.channels), albedo(&found.reflection), format!("{:.5}", rms(channel))]
            })
            .collect();
        text += &table(&["channel", "albedo asked", "predicted", "rms of a coefficient"], &rows);
        let proof = if found.proven { "proven the best of its space" } else { "not proven the best" };
        text + &format!("objective {:.6e} (Kubelka-Munk), {proof}, {} nodes\n", found.objective, found.nodes)
    }
}
