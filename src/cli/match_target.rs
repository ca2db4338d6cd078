//! `lumislice match`: the stack of layers that reflects most like a target.

use std::path::PathBuf;

use anyhow::{anyhow, bail};
use clap::Args;
use lumislice::{
    appearance::NormalizedDiffusion,
    colour::{srgb_to_linear, to_channels},
    job::{NamedLimit, Progress, SUPPORT, SUPPORT_MIN_DEPTH_MM, StackingModel, StackingOptions},
    optics::{
        DEFAULT_SEED, FrequencyGrid, KubelkaMunk, Light, MaterialSet, PhotonOptions, Prediction, ProfileFile, Resin,
        Stack, TransportOptions, VolumeCoefficients,
    },
    plot::Figure,
    search::{
        BlockTable, Match, Norm, Objective, RefineOptions, Refiner, SearchError, SearchOptions, SearchTarget,
        match_target, reflection_of,
    },
};
use serde_json::json;

use super::{
    Answer, leave_at_once,
    match_plot::MatchPlot,
    materials::{Materials, go_on, no_coefficients},
    plots::PlotFile,
    print, print_json,
    progress::Bars,
    say,
    table::{number, table},
};

/// Mean free paths that make sense, as in a job.
pub(super) const MEAN_FREE_PATH_MM: std::ops::RangeInclusive<f64> = 1e-4..=1000.0;

/// Find the stack of layers that reflects most like a target.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("wanted").required(true).multiple(false).args(["target", "albedo", "srgb"]))]
#[command(group = clap::ArgGroup::new("colour").multiple(false).args(["albedo", "srgb"]))]
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
    /// Albedo to match as an sRGB colour; its luminance where there is one channel.
    #[arg(long, value_name = "#RRGGBB", value_parser = parse_srgb, requires = "mean_free_path_mm", help_heading = "Target")]
    srgb: Option<[u8; 3]>,
    /// Mean free path 1/σt of the material to match, mm; one number, or one for each channel.
    #[arg(long, value_name = "L", value_delimiter = ',', requires = "colour", help_heading = "Target")]
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
    /// What is minimised: l2 (the paper's sum of squares over frequencies, which favours the broad shape), spatial (the square of the
    /// profile's error over the surface, which favours its centre) or relative (errors as shares of the target, which favours
    /// dark channels).
    #[arg(long, value_enum, default_value_t = NormArg::L2, help_heading = "Search")]
    objective: NormArg,
    /// Weight of the albedo against the other coefficients, 0 or more.
    #[arg(long, value_name = "W", default_value_t = 1.0, help_heading = "Search")]
    dc_weight: f64,
    /// Who judges: km (layers of whole units, proven the best by Kubelka-Munk) or transport (refines that to layers of any thickness in a
    /// model that holds for thin ones too; needs volume coefficients).
    #[arg(long, value_enum, default_value_t = Judge::Km, help_heading = "Search")]
    model: Judge,
    /// Thinnest layer, mm; default 0.027 (transport only).
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Search")]
    min_layer_mm: Option<f64>,
    /// Make thicknesses multiples of so many mm, such as a printer's slice (transport only).
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Search")]
    layer_step_mm: Option<f64>,
    /// Judge the answer by so many photons per channel as well, at least 2.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..), help_heading = "Search")]
    photons: Option<u64>,
    /// Draw the target and what the models predict to F, a .png or .svg.
    #[arg(long, value_name = "F", help_heading = "Output")]
    plot: Option<PathBuf>,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Judge {
    Km,
    Transport,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NormArg {
    L2,
    Spatial,
    Relative,
}

fn parse_srgb(text: &str) -> Result<[u8; 3], String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'));
    number.map(|n| [(n >> 16) as u8, (n >> 8) as u8, n as u8]).ok_or_else(|| "expected #RRGGBB, such as #C08040".into())
}

pub(super) fn parse_layer(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|mm| (0.001..=10.0).contains(mm));
    number.ok_or_else(|| "expected 0.001 to 10 mm".to_owned())
}

pub(super) fn parse_min_depth(text: &str) -> Result<(String, f64), String> {
    let fault = || "expected RESIN:MM, the depth in mm, 0 to 100".to_owned();
    let (name, mm) = text.rsplit_once(':').ok_or_else(fault)?;
    let mm: f64 = mm.trim().parse().map_err(|_| fault())?;
    let valid = !name.trim().is_empty() && (0.0..=100.0).contains(&mm);
    if valid { Ok((name.trim().to_owned(), mm)) } else { Err(fault()) }
}

pub(super) fn parse_depth(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|depth| (1..=12).contains(depth)).ok_or_else(|| "expected 1 to 12".to_owned())
}

/// A stacking and what the models say of it.
struct Judged {
    stacking: Stack,
    /// R̂ per channel in the model that was asked for.
    reflection: Vec<Vec<f64>>,
    km: f64,
    transport: Option<f64>,
    monte_carlo: Option<f64>,
}

/// Runs the command.
pub fn run(args: &MatchArgs) -> anyhow::Result<Answer> {
    args.check()?;
    let mut materials = Materials::read(&args.materials)?;
    let target = args.target(materials.file.channels().len())?;
    let core = args.core.as_deref().map(|name| materials.file.resin_id(name)).transpose()?;
    let limits = args.limits(&materials)?;
    let plot = args.plot.as_deref().map(PlotFile::open).transpose()?;
    let bars = Bars::new(args.json);
    let model = args.fit(&mut materials, &bars)?;
    let set = materials.load(&bars)?;
    let volumes: Option<Vec<_>> = set.resins.iter().map(Resin::volumes).collect();
    let options = SearchOptions {
        max_thickness_mm: args.max_thickness_mm,
        units: args.units,
        depth: args.depth,
        objective: args.objective(),
        limits,
        core,
        max_nodes: None,
    };
    // A search does not listen, and there is nothing to clear away but a plot's place.
    if plot.is_none() {
        leave_at_once();
    }
    bars.stage("search", 0);
    let resins = kubelka_munk(&set);
    let refiner = (model == Judge::Transport).then(|| {
        let volumes = volumes.as_deref().unwrap_or_default();
        Refiner::new(volumes, &set.grid, &options, args.refine_options())
    });
    let found = BlockTable::new(&resins, &options).and_then(|table| match &refiner {
        None => match_target(&table, &target).map(|found| (found, None)),
        Some(refiner) => {
            let mut found = refiner.match_targets(&table, std::slice::from_ref(&target))?;
            Ok(found.pop().map(|(found, refined)| (found, Some(refined))).expect("one target, one answer"))
        }
    });
    bars.finish();
    let (found, refined) = match found {
        Ok(found) => found,
        Err(error @ (SearchError::Infeasible { .. } | SearchError::Steps { .. })) => {
            if args.json {
                print_json(&json!({ "stack": null, "reason": error.to_string() }))?;
            }
            say(&format!("no: {error}"));
            return Ok(Answer::No);
        }
        Err(error) => return Err(error.into()),
    };
    let scorer = Scorer { args, set: &set, volumes: volumes.as_deref(), target: &target, options: &options };
    let mut answer = match refined {
        None => scorer.judge(found.stacking.clone(), found.reflection.clone()),
        Some(refined) => scorer.judge(refined.stacking, refined.reflection),
    };
    let traced = args.photons.map(|photons| scorer.trace(&answer.stacking, photons)).transpose()?;
    answer.monte_carlo = traced.as_ref().map(|traced| scorer.objective(&spectra(traced)));
    if let Some(plot) = plot {
        plot.finish(&scorer.figure(&answer.stacking, traced.as_ref()))?;
    }
    let unrefined = refiner.map(|_| scorer.judge(found.stacking.clone(), found.reflection.clone()));
    if args.json {
        print_json(&scorer.document(&answer, unrefined.as_ref(), &found))?;
    } else {
        print(&scorer.report(&answer, unrefined.as_ref(), &found))?;
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
        let albedo: Vec<f64> = match self.srgb {
            None => self.albedo.clone(),
            Some(srgb) => {
                if !matches!(channels, 1 | 3) {
                    bail!("--srgb: found a set of {channels} channels, expected one of 1 or 3");
                }
                let mut linear = Vec::new();
                to_channels(srgb.map(|value| srgb_to_linear(f32::from(value) / 255.0)), channels, &mut linear);
                linear.into_iter().map(f64::from).collect()
            }
        };
        per_channel("--albedo", albedo.len())?;
        per_channel("--mean-free-path-mm", self.mean_free_path_mm.len())?;
        if let Some(found) = albedo.iter().find(|albedo| !(0.0..=1.0).contains(*albedo)) {
            bail!("--albedo: found {found}, expected 0 to 1");
        }
        if let Some(found) = self.mean_free_path_mm.iter().find(|mm| !MEAN_FREE_PATH_MM.contains(*mm)) {
            let (least, most) = (MEAN_FREE_PATH_MM.start(), MEAN_FREE_PATH_MM.end());
            bail!("--mean-free-path-mm: found {found}, expected {least} to {most} mm");
        }
        let spectra = (0..channels).map(|channel| {
            let material = NormalizedDiffusion::new(of(&albedo, channel), of(&self.mean_free_path_mm, channel));
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
            materials.file.resin_id(resin)?;
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
            objective: self.objective(),
            model: StackingModel::KubelkaMunk,
            core: self.core.clone(),
            limits,
        };
        Ok(options.resin_limits(&names))
    }

    fn objective(&self) -> Objective {
        let norm = match self.objective {
            NormArg::L2 => Norm::L2,
            NormArg::Spatial => Norm::Spatial,
            NormArg::Relative => Norm::Relative,
        };
        Objective { norm, dc_weight: self.dc_weight }
    }

    fn check(&self) -> anyhow::Result<()> {
        if self.model == Judge::Km && (self.min_layer_mm.is_some() || self.layer_step_mm.is_some()) {
            bail!(
                "--min-layer-mm and --layer-step-mm: whole units know neither, expected --model transport beside them"
            );
        }
        Ok(())
    }

    fn refine_options(&self) -> RefineOptions {
        let default = RefineOptions::default();
        let min_layer_mm = self.min_layer_mm.unwrap_or(default.min_layer_mm);
        RefineOptions { min_layer_mm, step_mm: self.layer_step_mm, ..default }
    }

    /// Who asks for transport or photons needs coefficients of every resin; what fits none is left to Kubelka–Munk. The answer is the model
    /// to refine in.
    fn fit(&self, materials: &mut Materials, bars: &Bars) -> anyhow::Result<Judge> {
        if self.model == Judge::Km && self.photons.is_none() {
            return Ok(Judge::Km);
        }
        // Loading says what was refused, and why.
        materials.fit(None, bars)?;
        let file = &materials.file;
        match file.resin_names().find(|name| file.volume(name).is_none()) {
            None => Ok(self.model),
            Some(name) if self.photons.is_some() => Err(no_coefficients(name, &self.materials)),
            Some(_) => {
                say("warning: matching by Kubelka-Munk instead");
                Ok(Judge::Km)
            }
        }
    }
}

pub(super) fn kubelka_munk(set: &MaterialSet) -> Vec<Vec<KubelkaMunk>> {
    let channels = |resin: &Resin| resin.channels.iter().map(|channel| channel.kubelka_munk.clone()).collect();
    set.resins.iter().map(channels).collect()
}

fn spectra(prediction: &Prediction) -> Vec<Vec<f64>> {
    prediction.light.iter().map(|light| light.reflection_hankel.clone()).collect()
}

/// Asks the models about a stacking, and tells people or programs.
struct Scorer<'a> {
    args: &'a MatchArgs,
    set: &'a MaterialSet,
    volumes: Option<&'a [Vec<VolumeCoefficients>]>,
    target: &'a SearchTarget,
    options: &'a SearchOptions,
}

impl Scorer<'_> {
    fn objective(&self, reflection: &[Vec<f64>]) -> f64 {
        self.options.objective.of(reflection, self.target)
    }

    fn judge(&self, stacking: Stack, reflection: Vec<Vec<f64>>) -> Judged {
        let km = self.objective(&reflection_of(&kubelka_munk(self.set), &stacking));
        let transport = self.transport(&stacking).map(|light| self.objective(&spectra(&light)));
        Judged { stacking, reflection, km, transport, monte_carlo: None }
    }

    fn transport(&self, stacking: &Stack) -> Option<Prediction> {
        let stack = self.coefficients(stacking)?;
        let directions = TransportOptions::REFLECTION;
        Some(Prediction::transport(&self.set.channels, &stack, Light::Diffuse, directions))
    }

    fn trace(&self, stacking: &Stack, photons: u64) -> anyhow::Result<Prediction> {
        let stack = self.coefficients(stacking).expect("checked with the arguments");
        let options = PhotonOptions { light: Light::Diffuse, photons, seed: DEFAULT_SEED };
        Ok(Prediction::monte_carlo(&self.set.channels, &stack, options, |_| go_on())?)
    }

    fn figure(&self, stacking: &Stack, monte_carlo: Option<&Prediction>) -> Figure {
        let named: Vec<_> = self.named(stacking).map(|(name, mm)| format!("{name} {mm:.3}")).collect();
        let below = self.args.core.as_ref().map_or("nothing", String::as_str);
        let plot = MatchPlot {
            title: format!("{} mm over {below}", named.join(", ")),
            caption: self.set.provenance.clone(),
            target: self.target,
            grid: &self.set.grid,
            km: Prediction::kubelka_munk(self.set, stacking),
            transport: self.transport(stacking),
            monte_carlo,
        };
        plot.figure()
    }

    /// The stack of coefficients.
    fn coefficients(&self, stacking: &Stack) -> Option<Stack<&[VolumeCoefficients]>> {
        let volumes = self.volumes?;
        Some(stacking.map(|resin| volumes[resin.0].as_slice()))
    }

    fn named<'b>(&'b self, stacking: &'b Stack) -> impl Iterator<Item = (&'b str, f64)> {
        stacking.pairs().map(|(&resin, mm)| (self.set[resin].name.as_str(), mm))
    }

    fn document(&self, answer: &Judged, unrefined: Option<&Judged>, found: &Match) -> serde_json::Value {
        let stack = |judged: &Judged| -> Vec<_> {
            let layers = self.named(&judged.stacking);
            layers.map(|(material, mm)| json!({ "material": material, "thickness_mm": mm })).collect()
        };
        let mut document = json!({
            "stack": stack(answer),
            "objective": { "km": answer.km, "transport": answer.transport, "monte_carlo": answer.monte_carlo },
            "bound": found.bound,
            "proven": found.proven,
            "nodes": found.nodes,
        });
        if let Some(unrefined) = unrefined {
            let objective = json!({ "km": unrefined.km, "transport": unrefined.transport });
            document["unrefined"] = json!({ "stack": stack(unrefined), "objective": objective });
        }
        document
    }

    fn report(&self, answer: &Judged, unrefined: Option<&Judged>, found: &Match) -> String {
        let rows: Vec<_> =
            self.named(&answer.stacking).map(|(name, mm)| vec![name.to_owned(), format!("{mm:.4}")]).collect();
        let below = self.args.core.as_ref().map_or("nothing".to_owned(), |core| format!("a half-space of {core}"));
        let mut text = format!("from the observer down, over {below}:\n{}", table(&["layer", "mm"], &rows));
        let rms = |channel: usize| {
            let (r, t) = (&answer.reflection[channel], &self.target.channels[channel]);
            let squares: f64 = r.iter().zip(t).map(|(r, t)| (r - t) * (r - t)).sum();
            (squares / r.len() as f64).sqrt()
        };
        let channels = self.set.channels.iter().enumerate().map(|(channel, name)| {
            let albedo = |spectra: &[Vec<f64>]| number(spectra[channel].first().copied(), 4);
            let (asked, predicted) = (albedo(&self.target.channels), albedo(&answer.reflection));
            vec![name.clone(), asked, predicted, format!("{:.5}", rms(channel))]
        });
        let rows: Vec<_> = channels.collect();
        text += &table(&["channel", "albedo asked", "predicted", "rms of a coefficient"], &rows);
        let score = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3e}"));
        let row = |name: &str, judged: &Judged| {
            vec![name.to_owned(), score(Some(judged.km)), score(judged.transport), score(judged.monte_carlo)]
        };
        let rows: Vec<_> = match unrefined {
            None => vec![row("these layers", answer)],
            Some(unrefined) => vec![row("these layers", answer), row("in whole units", unrefined)],
        };
        text += &table(&["objective", "Kubelka-Munk", "transport", "Monte Carlo"], &rows);
        let proof = if found.proven { "proven the best" } else { "not proven the best" };
        let whole = if unrefined.is_some() { "in whole units: " } else { "" };
        text + &format!("{whole}{proof} by Kubelka-Munk (bound {:.3e}, {} nodes)\n", found.bound, found.nodes)
    }
}
