//! `lumislice match`: the stack of layers that reflects most like a target.

use std::path::PathBuf;

use clap::Args;
use lumislice::{
    appearance::{material_target, srgb_albedo},
    colour::{delta_e_2000, lab},
    optics::{EdgeResponse, FrequencyGrid, Light, MaterialSet, Mixture, Model, Prediction, Stack, predict},
    plot::Figure,
    search::{
        GLOWS, Judge, Judged, Match, MatchOptions, Matcher, Norm, Objective, RefineOptions, SearchError, SearchOptions,
        SearchTarget, far_glow, far_miss,
    },
    watch::{StopOnly, Unwatched, Watch},
};
use serde_json::json;

use super::{
    Answer, Result,
    cache::CacheArgs,
    document,
    failure::{refusal, refuse},
    leave_at_once,
    match_plot::MatchPlot,
    materials::{Materials, min_depth_limits, no_coefficients},
    plots::PlotFile,
    print,
    progress::Bars,
    say_no,
    table::{number, table},
    warn,
};

/// Find the stack of layers that reflects most like a target.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("wanted").required(true).multiple(false).args(["target", "albedo", "colour"]))]
#[command(group = clap::ArgGroup::new("asked").multiple(false).args(["albedo", "colour"]))]
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
    #[arg(long, value_name = "#RRGGBB", value_parser = parse_srgb, requires = "mean_free_path_mm")]
    #[arg(visible_alias = "color", alias = "srgb", help_heading = "Target")]
    colour: Option<[u8; 3]>,
    /// Mean free path 1/σt of the material to match, mm; one number, or one for each channel.
    #[arg(long, value_name = "L", value_delimiter = ',', requires = "asked", help_heading = "Target")]
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
    /// What is minimised: natural (the error in lightness under natural light, in which the albedo counts most), l2
    /// (the paper's sum of squares over frequencies, which favours the broad shape), spatial (the
    /// square of the profile's error over the surface, which favours its centre) or relative (errors as shares of the
    /// target, which favours dark channels).
    #[arg(long, value_enum, default_value_t = NormArg::Natural, help_heading = "Search")]
    objective: NormArg,
    /// Weight of the albedo against the other coefficients, 0 or more.
    #[arg(long, value_name = "W", default_value_t = 1.0, help_heading = "Search")]
    dc_weight: f64,
    /// Who judges: transport (layers of any thickness in a model that holds for thin ones too; needs volume
    /// coefficients, which are fitted to profiles where there are none) or km (layers of whole units, proven the best
    /// by Kubelka-Munk).
    #[arg(long, value_enum, default_value_t = JudgeArg::Transport, help_heading = "Search")]
    model: JudgeArg,
    /// Thinnest layer, mm; default 0.027 (transport only).
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Search")]
    min_layer_mm: Option<f64>,
    /// Make thicknesses multiples of so many mm, such as a printer's slice (transport only).
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Search")]
    layer_step_mm: Option<f64>,
    /// Make every layer of one resin. Else, by transport and in layers of no steps, the surface is white that is
    /// dithered with the other inks, over clear or support, over white: the same slots for every target, which differ
    /// in thicknesses and shares; not for --objective l2.
    #[arg(long, help_heading = "Search")]
    no_mixtures: bool,
    /// Judge the answer by so many photons per channel as well, at least 2.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..), help_heading = "Search")]
    photons: Option<u64>,
    /// Draw the target and what the models predict to F, a .png or .svg.
    #[arg(long, value_name = "F", help_heading = "Output")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Print one JSON document instead of words.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum JudgeArg {
    Km,
    Transport,
}

impl JudgeArg {
    fn judge(self) -> Judge {
        match self {
            Self::Km => Judge::KubelkaMunk,
            Self::Transport => Judge::Transport,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NormArg {
    Natural,
    L2,
    Spatial,
    Relative,
}

pub(super) fn parse_srgb(text: &str) -> Result<[u8; 3], String> {
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

/// Runs the command.
pub fn run(args: &MatchArgs) -> Result<Answer> {
    args.check()?;
    let mut materials = Materials::read(&args.materials)?;
    let target = args.target(materials.file.channels().len())?;
    let core = args.core.as_deref().map(|name| materials.file.resin_id(name)).transpose()?;
    let limits = min_depth_limits(&materials.file, &args.min_depth)?;
    let plot = args.plot.as_deref().map(PlotFile::open).transpose()?;
    let bars = Bars::new(args.json);
    let judge = args.fit(&mut materials, &bars)?;
    let set = materials.load(&bars)?;
    let search = SearchOptions {
        max_thickness_mm: args.max_thickness_mm,
        units: args.units,
        depth: args.depth,
        objective: args.objective(),
        limits,
        core,
        ..SearchOptions::default()
    };
    let layers = args.refine_options();
    let mixtures = !args.no_mixtures && args.objective != NormArg::L2 && layers.step_mm.is_none();
    let options = MatchOptions { search, judge, layers, mixtures };
    // A search does not listen, and there is nothing to clear away but a plot's place.
    if plot.is_none() {
        leave_at_once();
    }
    bars.stage("search", 0);
    let cache = args.cache.cache();
    let found = Matcher::matched(&set, &options, std::slice::from_ref(&target), &Unwatched, cache.as_ref())
        .map(|mut found| found.swap_remove(0));
    bars.finish();
    let found = match found {
        Ok(found) => found,
        Err(error @ (SearchError::Infeasible { .. } | SearchError::Steps { .. })) => {
            document(args.json, &json!({ "stack": null, "reason": error.to_string() }))?;
            say_no(&error.to_string());
            return Ok(Answer::No);
        }
        Err(error) => return Err(error.into()),
    };
    let objective = &options.search.objective;
    let answer = found.judged(&set, &target, objective);
    let traced = args.photons.map(|photons| {
        let model = Model::MonteCarlo { light: Light::Diffuse, photons, seed: Model::DEFAULT_SEED };
        predict(&set, &answer.stacking, &model, &StopOnly(&bars))
    });
    let traced = traced.transpose()?;
    let shown = Shown {
        args,
        set: &set,
        target: &target,
        monte_carlo: traced.as_ref().map(|traced| objective.of(&traced.reflection(), &target)),
        unrefined: found.unrefined(&set, &target, objective),
        search: found.search.as_ref(),
        answer,
    };
    let look = shown.look();
    look.warn_of_far_misses();
    if let Some(plot) = plot {
        plot.finish(&shown.figure(traced.as_ref())?)?;
    }
    if !document(args.json, &shown.document(&look))? {
        print(&shown.report(&look))?;
    }
    Ok(Answer::Yes)
}

impl MatchArgs {
    /// What is to be matched, on the grid of all resins.
    fn target(&self, channels: usize) -> Result<SearchTarget> {
        let grid = FrequencyGrid::default();
        if !self.target.is_empty() {
            let given = self.target.len();
            if given != 1 && given != channels {
                refuse!("--target: found {given} values, expected 1 or {channels}, one for each channel");
            }
            return Ok(SearchTarget::from_profiles(&self.target, channels, &grid)?);
        }
        if let Some([r, g, b]) = self.colour.filter(|_| channels == 1)
            && r.max(g).max(b) - r.min(g).min(b) > GREY
        {
            warn("the resins have one channel: of the colour only its lightness is matched");
        }
        let albedo: Vec<f64> = match self.colour {
            None => self.albedo.clone(),
            Some(srgb) => srgb_albedo(srgb, channels)
                .ok_or_else(|| refusal!("--colour: found a set of {channels} channels, expected one of 1 or 3"))?,
        };
        let target = material_target(&albedo, &self.mean_free_path_mm, channels, &grid);
        target.map_err(|error| refusal!("--{error}"))
    }

    fn objective(&self) -> Objective {
        let norm = match self.objective {
            NormArg::Natural => Norm::Natural,
            NormArg::L2 => Norm::L2,
            NormArg::Spatial => Norm::Spatial,
            NormArg::Relative => Norm::Relative,
        };
        Objective { norm, dc_weight: self.dc_weight }
    }

    fn check(&self) -> Result<()> {
        if self.model == JudgeArg::Km && (self.min_layer_mm.is_some() || self.layer_step_mm.is_some()) {
            refuse!(
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

    /// Who asks for transport or photons needs coefficients of every resin; what fits none is left to Kubelka–Munk. The
    /// answer is the model to refine in.
    fn fit(&self, materials: &mut Materials, bars: &Bars) -> Result<Judge> {
        if self.model == JudgeArg::Km && self.photons.is_none() {
            return Ok(Judge::KubelkaMunk);
        }
        match materials.lacks_coefficients(bars)? {
            None => Ok(self.model.judge()),
            Some(name) if self.photons.is_some() => Err(no_coefficients(&name, &self.materials)),
            Some(_) => {
                warn("matching by Kubelka-Munk instead");
                Ok(Judge::KubelkaMunk)
            }
        }
    }
}

/// The answer, for people or programs.
struct Shown<'a> {
    args: &'a MatchArgs,
    set: &'a MaterialSet,
    target: &'a SearchTarget,
    answer: Judged,
    /// Its objective by photons.
    monte_carlo: Option<f64>,
    unrefined: Option<Judged>,
    /// The stackings of whole units that were searched, if they were.
    search: Option<&'a Match>,
}

/// What of a target and its answer meets the eye: pairs of asked and predicted.
struct Look {
    albedo: Vec<[f64; 2]>,
    /// Width of a shadow's edge from a tenth to nine tenths of the light; `None` beyond 40 mm.
    edge_mm: Vec<[Option<f64>; 2]>,
    delta_e_2000: f64,
}

impl Look {
    /// Says it where the answer comes out lighter or darker than asked, or its glow wider or narrower.
    fn warn_of_far_misses(&self) {
        if let Some([asked, found]) = far_miss(self.albedo.iter().copied()) {
            warn(&format!(
                "albedo {found:.2} in place of {asked:.2}: the resins reach no nearer within what is allowed, \
                 see `lumislice gamut`"
            ));
        }
        let glowing = self.edge_mm.iter().zip(&self.albedo).filter(|(_, albedo)| albedo.iter().all(|it| *it > GLOWS));
        let widths = glowing.map(|(edge, _)| edge.map(|mm| mm.unwrap_or(EdgeResponse::WIDEST_MM)));
        if let Some([asked, found]) = far_glow(widths) {
            let how = if found < asked { "less far" } else { "farther" };
            let [asked, found] = [asked, found].map(|mm| match mm {
                mm if mm < EdgeResponse::WIDEST_MM => format!("{mm:.2} mm"),
                mm => format!("{mm} mm or more"),
            });
            warn(&format!(
                "a shadow's edge {found} wide in place of {asked}: light goes {how} inside than \
                 asked; beside the albedo the resins reach no nearer within what is allowed, see `lumislice gamut`"
            ));
        }
    }
}

/// Bytes of a colour that differ by no more pass for grey.
const GREY: u8 = 8;

impl Shown<'_> {
    fn look(&self) -> Look {
        let both = || self.target.channels.iter().zip(&self.answer.reflection);
        let albedo: Vec<[f64; 2]> = both().map(|(t, r)| [t, r].map(|spectrum| spectrum[0])).collect();
        let width = |spectrum: &Vec<f64>| EdgeResponse::new(spectrum, &self.set.grid).width_mm();
        let colour = |which: usize| {
            let of = |channel: usize| albedo.get(channel).unwrap_or(&albedo[0])[which];
            lab(if albedo.len() == 3 { [of(0), of(1), of(2)] } else { [of(0); 3] })
        };
        Look {
            edge_mm: both().map(|(t, r)| [width(t), width(r)]).collect(),
            delta_e_2000: delta_e_2000(colour(0), colour(1)),
            albedo,
        }
    }

    fn figure(&self, monte_carlo: Option<&Prediction>) -> Result<Figure> {
        let stacking = &self.answer.stacking;
        let named: Vec<_> = self.named(stacking).iter().map(|(name, mm)| format!("{name} {mm:.3}")).collect();
        let below = self.args.core.as_ref().map_or("nothing", String::as_str);
        let by = |model: Model| predict(self.set, stacking, &model, &Unwatched);
        let plot = MatchPlot {
            title: format!("{} mm over {below}", named.join(", ")),
            caption: self.set.provenance.clone(),
            target: self.target,
            grid: &self.set.grid,
            km: by(Model::KubelkaMunk)?,
            transport: self.set.has_coefficients().then(|| by(Model::REFLECTION)).transpose()?,
            monte_carlo,
        };
        Ok(plot.figure())
    }

    fn named(&self, stacking: &Stack<Mixture>) -> Vec<(String, f64)> {
        // A slot of a family that is left out is no layer.
        let there = stacking.pairs().filter(|(_, mm)| *mm > 0.0);
        there.map(|(mixture, mm)| (self.set.mixture_name(mixture), mm)).collect()
    }

    /// The layers as `predict` and a job's `stack` read them.
    fn spelled(&self) -> String {
        let layers: Vec<_> =
            self.named(&self.answer.stacking).into_iter().map(|(name, mm)| format!("{name}:{mm:.4}")).collect();
        layers.join(",")
    }

    fn document(&self, look: &Look) -> serde_json::Value {
        let Self { answer, search, .. } = self;
        let stack = |judged: &Judged| -> Vec<_> {
            let layers = self.named(&judged.stacking).into_iter();
            layers.map(|(material, mm)| json!({ "material": material, "thickness_mm": mm })).collect()
        };
        let mut document = json!({
            "stack": stack(answer),
            "objective": { "km": answer.kubelka_munk, "transport": answer.transport, "monte_carlo": self.monte_carlo },
            "bound": search.map(|search| search.bound),
            "proven": search.map(|search| search.proven),
            "nodes": search.map(|search| search.nodes),
        });
        let Look { albedo, edge_mm, delta_e_2000 } = look;
        document["look"] = json!({ "albedo": albedo, "edge_mm": edge_mm, "delta_e_2000": delta_e_2000 });
        if let Some(unrefined) = &self.unrefined {
            let objective = json!({ "km": unrefined.kubelka_munk, "transport": unrefined.transport });
            document["unrefined"] = json!({ "stack": stack(unrefined), "objective": objective });
        }
        document
    }

    fn report(&self, look: &Look) -> String {
        let Self { answer, search, .. } = self;
        let rows: Vec<_> =
            self.named(&answer.stacking).into_iter().map(|(name, mm)| vec![name, format!("{mm:.4}")]).collect();
        let below = self.args.core.as_ref().map_or("nothing".to_owned(), |core| format!("a half-space of {core}"));
        let mut text = format!("from the observer down, over {below}:\n{}", table(&["layer", "mm"], &rows));
        text += &format!("as --stack \"{}\"\n", self.spelled());
        let rms = |channel: usize| {
            let (r, t) = (&answer.reflection[channel], &self.target.channels[channel]);
            let squares: f64 = r.iter().zip(t).map(|(r, t)| (r - t) * (r - t)).sum();
            (squares / r.len() as f64).sqrt()
        };
        let Look { albedo, edge_mm, delta_e_2000 } = look;
        let channels = self.set.channels.iter().enumerate().map(|(channel, name)| {
            let [asked, predicted] = albedo[channel].map(|albedo| number(Some(albedo), 4));
            let [edge_asked, edge] = edge_mm[channel].map(|mm| number(mm, 3));
            vec![name.clone(), asked, predicted, edge_asked, edge, format!("{:.5}", rms(channel))]
        });
        let rows: Vec<_> = channels.collect();
        let edge = "shadow's edge asked, mm";
        text += &table(&["channel", "albedo asked", "predicted", edge, "predicted", "rms of a coefficient"], &rows);
        text += &format!("colour difference {delta_e_2000:.2} (CIEDE2000; 1 is just visible)\n");
        let score = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3e}"));
        let row = |name: &str, judged: &Judged, monte_carlo: Option<f64>| {
            vec![name.to_owned(), score(Some(judged.kubelka_munk)), score(judged.transport), score(monte_carlo)]
        };
        let mut rows = vec![row("these layers", answer, self.monte_carlo)];
        rows.extend(self.unrefined.iter().map(|unrefined| row("in whole units", unrefined, None)));
        text += &table(&["objective", "Kubelka-Munk", "transport", "Monte Carlo"], &rows);
        let Some(search) = search else {
            return text + "layers of mixtures: thicknesses and shares fitted by transport, not proven the best\n";
        };
        let proof = if search.proven { "proven the best" } else { "not proven the best" };
        let whole = if self.unrefined.is_some() { "in whole units: " } else { "" };
        text + &format!("{whole}{proof} by Kubelka-Munk (bound {:.3e}, {} nodes)\n", search.bound, search.nodes)
    }
}
