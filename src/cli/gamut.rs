//! `lumislice gamut`: what a set of resins can reach, and whether targets lie within.

use std::path::{Path, PathBuf};

use clap::Args;
use lumislice::{
    appearance::material_target,
    job::{
        self, Job,
        file::{MaterialSource, StackingModel, StackingOptions},
    },
    optics::{FrequencyGrid, Grains, MaterialSet, ResinId, Stack},
    plot::{Axis, BLUE, Figure, GREEN, Panel, RED, Series, Shape},
    search::{
        self, ChannelGamut, Found, Gamut, GamutMap, GamutPoint, Lies, MatchOptions, Matcher, Move, Objective,
        RefineOptions, SearchError, SearchOptions, SearchTarget,
    },
    watch::Watch,
};
use serde_json::json;

use super::{
    Answer, Result,
    cache::CacheArgs,
    document,
    failure::{refusal, refuse},
    match_target::{parse_depth, parse_layer, parse_min_depth},
    materials::{Materials, min_depth_limits, no_coefficients},
    output_file::OutputFile,
    plots::PlotFile,
    print,
    progress::Bars,
    say_no,
    table::{number, table},
};

/// Show what albedos and half-energy radii a set of resins can reach, and where targets lie.
///
/// The gamut is that of layers of one resin each. Where layers may be mixtures, as in jobs and matches by default, more
/// is reached: targets outside are searched for with mixtures too, and count as reached where one looks like them.
#[derive(Debug, Args)]
pub struct GamutArgs {
    /// Resins: a material file (TOML), or the name of a built-in set; default: the job's.
    #[arg(long, value_name = "FILE|SET", required_unless_present = "job", help_heading = "Stackings")]
    materials: Option<PathBuf>,
    /// Resin of the half-space below the stackings; default: the job's, else nothing lies there and no light returns.
    #[arg(long, value_name = "RESIN", help_heading = "Stackings")]
    core: Option<String>,
    /// Thickest stacking, mm; default: the job's, else 5.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, help_heading = "Stackings")]
    max_thickness_mm: Option<f64>,
    /// Thinnest layer, mm; default: the job's, else 0.027.
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Stackings")]
    min_layer_mm: Option<f64>,
    /// Layers are multiples of so many mm, such as a printer's slice; default: the job's, else any thickness by
    /// transport, multiples of the thinnest by km.
    #[arg(long, value_name = "MM", value_parser = parse_layer, help_heading = "Stackings")]
    layer_step_mm: Option<f64>,
    /// Most layers in a stacking, 1 to 12; default: the job's depth, else 6.
    #[arg(long, value_name = "N", value_parser = parse_depth, help_heading = "Stackings")]
    depth: Option<usize>,
    /// Least depth of a resin below the surface, RESIN:MM, in place of the job's limits; support keeps 0.2 mm unless
    /// given. Repeatable.
    #[arg(long, value_name = "RESIN:MM", value_parser = parse_min_depth, help_heading = "Stackings")]
    min_depth: Vec<(String, f64)>,
    /// Who places the stackings: transport (needs volume coefficients, given or fitted; the default where all resins
    /// have them) or km; default: the job's.
    #[arg(long, value_enum, help_heading = "Stackings")]
    model: Option<Judge>,
    /// Layers of one resin each only: targets outside are not searched for with mixtures.
    #[arg(long, help_heading = "Stackings")]
    no_mixtures: bool,
    /// A profile whose place to show, CSV with r_mm,reflection_per_mm2, the same in all channels. Repeatable.
    #[arg(long, value_name = "PROFILE.csv", help_heading = "Targets")]
    target: Vec<PathBuf>,
    /// Albedos of targets to show, 0 to 1, the same in all channels: 0.3,0.5.
    #[arg(long, value_name = "A", value_delimiter = ',', requires = "mean_free_path_mm", help_heading = "Targets")]
    albedo: Vec<f64>,
    /// Their mean free paths 1/σt, mm: one for all, or one each.
    #[arg(long, value_name = "MM", value_delimiter = ',', requires = "albedo", help_heading = "Targets")]
    mean_free_path_mm: Vec<f64>,
    /// Show the targets of a job, its clusters or its profiles, in the gamut of its resins and its stackings.
    #[arg(long, value_name = "JOB.toml", help_heading = "Targets")]
    job: Option<PathBuf>,
    /// The plot, F.png or F.svg.
    #[arg(short, long, value_name = "F", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Write the stackings and the boundary to F: channel,place,albedo,half_energy_radius_mm,stack.
    #[arg(long, value_name = "F", help_heading = "Output")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Print one JSON document instead of a table.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Judge {
    Km,
    Transport,
}

/// A target with a name for people.
struct Named {
    name: String,
    /// How much it counts.
    weight: f64,
    target: SearchTarget,
}

/// Runs the command. The answer is no if a target lies outside.
pub fn run(args: &GamutArgs) -> Result<Answer> {
    let job = args.job.as_deref().map(Job::load).transpose()?;
    let named = job.as_ref().map(|job| match &job.materials {
        MaterialSource::Set(name) => PathBuf::from(name),
        MaterialSource::File(path) => path.as_ref().to_path_buf(),
    });
    let Some(named) = args.materials.clone().or(named) else { refuse!("--materials: found none, expected one") };
    let mut materials = Materials::read(&named)?;
    let stacking = job.as_ref().map(|job| &job.stacking);
    let core_name = args.core.as_deref().or(stacking.map(StackingOptions::core_name));
    let core = core_name.map(|name| materials.file.resin_id(name)).transpose()?;
    let limits = match stacking {
        Some(stacking) if args.min_depth.is_empty() => {
            stacking.resin_limits(&materials.file.resin_names().collect::<Vec<_>>())
        }
        _ => min_depth_limits(&materials.file, &args.min_depth)?,
    };
    let default = SearchOptions::default();
    let thickest = stacking.map_or(default.max_thickness_mm, |stacking| stacking.max_thickness_mm);
    let deepest = stacking.map_or(default.depth, |stacking| stacking.depth);
    let search = SearchOptions {
        max_thickness_mm: args.max_thickness_mm.unwrap_or(thickest),
        depth: args.depth.unwrap_or(deepest),
        limits,
        core,
        ..default
    };
    let plot = args.output.as_deref().map(PlotFile::open).transpose()?;
    let csv = args.csv.as_deref().map(OutputFile::open).transpose()?;
    let mut targets = args.targets(materials.file.channels().len())?;
    let bars = Bars::new(args.json);
    // A job by transport makes do with Kubelka–Munk where a resin has no coefficients, and so does its gamut.
    let by_job = stacking.filter(|stacking| stacking.model == StackingModel::KubelkaMunk).map(|_| Judge::Km);
    let by_transport = args.fit(&mut materials, args.model.or(by_job), &named, &bars)?;
    let layers = args.layers(job.as_ref(), by_transport);
    let mixes =
        by_transport && !args.no_mixtures && layers.step_mm.is_none() && job.as_ref().is_none_or(Job::allows_mixtures);
    let objective = stacking.map_or(Objective::default(), |stacking| stacking.objective);
    let grains = job.as_ref().map(|job| Grains::of_voxels(job.printer.pitch_mm.to_array()));
    if let (Some(path), Some(job)) = (&args.job, job) {
        targets.extend(job_targets(path, job, materials.file.channels(), &bars)?);
    }
    let mut set = materials.load(&bars)?;
    bars.stage("gamut", 0);
    let judge = if by_transport { search::Judge::Transport } else { search::Judge::KubelkaMunk };
    let options = MatchOptions { search, judge, layers, mixtures: false };
    let gamut = Gamut::explored(&set, &options, &bars, args.cache.cache().as_ref());
    bars.finish();
    let gamut = match gamut {
        Ok(gamut) => gamut,
        Err(error @ SearchError::Infeasible { .. }) => {
            say_no(&error.to_string());
            return Ok(Answer::No);
        }
        Err(error) => return Err(error.into()),
    };
    let plain: Vec<_> = targets.iter().map(|named| named.target.clone()).collect();
    let weights: Vec<_> = targets.iter().map(|named| named.weight).collect();
    let mut map = GamutMap::new(&gamut, &plain, &weights, &set.grid);
    let tried = mixes && !map.moves.iter().all(Move::reached);
    if tried {
        set.grains = grains.unwrap_or(set.grains);
        let options = MatchOptions {
            search: SearchOptions { objective, ..options.search.clone() },
            mixtures: true,
            ..options.clone()
        };
        bars.stage("mixtures", plain.len() as u64);
        let found = Matcher::matched(&set, &options, &plain, &bars, args.cache.cache().as_ref());
        bars.finish();
        let found = found?;
        let found: Vec<_> = found.iter().map(Found::reflection).collect();
        map = GamutMap::with_mixtures(&gamut, &found, &plain, &weights, &set.grid);
    }
    let shown =
        Shown { options: &options.search, set: &set, gamut: &gamut, targets: &targets, map: &map, tried, by_transport };
    if let Some(plot) = plot {
        plot.finish(&shown.figure())?;
    }
    if let Some(csv) = csv {
        csv.finish(shown.csv().as_bytes())?;
    }
    if !document(args.json, &shown.document())? {
        print(&shown.report())?;
    }
    Ok(if map.moves.iter().all(Move::reached) { Answer::Yes } else { Answer::No })
}

/// The targets of a job.
fn job_targets(path: &Path, job: Job, channels: &[String], bars: &Bars) -> Result<Vec<Named>> {
    let found = job::targets(job, bars)?;
    let named = found.into_iter().map(|found| {
        if found.target.channels.len() != channels.len() {
            let (has, expected) = (found.target.channels.len(), channels.len());
            refuse!("{}: found targets of {has} channels, expected {expected} as --materials has", path.display());
        }
        Ok(Named { name: found.name, weight: found.share, target: found.target })
    });
    named.collect()
}

impl GamutArgs {
    /// The layers of stackings: the job's first object's, unless options say otherwise.
    fn layers(&self, job: Option<&Job>, by_transport: bool) -> RefineOptions {
        let by_default = job.map_or_else(RefineOptions::default, |job| job.layer_options(0));
        let min_layer_mm = self.min_layer_mm.unwrap_or(by_default.min_layer_mm);
        let whole = (!by_transport).then_some(min_layer_mm);
        RefineOptions { min_layer_mm, step_mm: self.layer_step_mm.or(by_default.step_mm).or(whole), ..by_default }
    }

    /// Fits coefficients to resins given by profiles, for the transport model; whether it can be asked.
    fn fit(&self, materials: &mut Materials, model: Option<Judge>, named: &Path, bars: &Bars) -> Result<bool> {
        if model == Some(Judge::Km) {
            return Ok(false);
        }
        match materials.lacks_coefficients(bars)? {
            Some(name) if model == Some(Judge::Transport) => Err(no_coefficients(&name, named)),
            lacking => Ok(lacking.is_none()),
        }
    }

    /// The targets named by files and by pairs of numbers.
    fn targets(&self, channels: usize) -> Result<Vec<Named>> {
        let grid = FrequencyGrid::default();
        let mut targets = Vec::new();
        let mut add = |name: String, target: SearchTarget| targets.push(Named { name, weight: 1.0, target });
        for path in &self.target {
            let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            add(name, SearchTarget::from_profiles(&[path], channels, &grid)?);
        }
        let (albedos, paths) = (&self.albedo, &self.mean_free_path_mm);
        if paths.len() > 1 && paths.len() != albedos.len() {
            refuse!(
                "--mean-free-path-mm: found {} values, expected 1 or {}, one for each albedo",
                paths.len(),
                albedos.len()
            );
        }
        for (index, &albedo) in albedos.iter().enumerate() {
            let path = paths[index.min(paths.len() - 1)];
            let target = material_target(&[albedo], &[path], channels, &grid).map_err(|error| refusal!("--{error}"))?;
            add(format!("albedo {albedo}, mfp {path} mm"), target);
        }
        Ok(targets)
    }
}

/// Everything that is shown.
struct Shown<'a> {
    options: &'a SearchOptions,
    set: &'a MaterialSet,
    gamut: &'a Gamut,
    targets: &'a [Named],
    map: &'a GamutMap,
    /// Whether targets outside of pure layers were searched for with mixtures.
    tried: bool,
    by_transport: bool,
}

impl Shown<'_> {
    fn model(&self) -> &'static str {
        if self.by_transport { "transport" } else { "km" }
    }

    fn channels(&self) -> impl Iterator<Item = (&String, &ChannelGamut)> {
        self.set.channels.iter().zip(&self.gamut.channels)
    }

    fn stack(&self, point: &GamutPoint) -> Stack<String> {
        self.set.named(&point.stacking)
    }

    fn title(&self) -> String {
        let below = self.options.core.map_or("nothing", |core| &self.set[core].name);
        format!("Gamut of {} in pure layers, up to {} mm over {below}", self.set.name, self.options.max_thickness_mm)
    }

    fn figure(&self) -> Figure {
        let model = if self.by_transport { "transport" } else { "Kubelka–Munk" };
        let mut figure = Figure::new(self.title())
            .columns(self.gamut.channels.len().min(3))
            .caption(format!("Stackings found by Kubelka–Munk, placed by {model}. {}", self.set.provenance));
        let last = self.gamut.channels.len() - 1;
        for (index, (name, channel)) in self.channels().enumerate() {
            // One legend serves all channels.
            let named = |name: String| if index == last { name } else { String::new() };
            let mut panel = Panel::new(Axis::log("half-energy radius [mm]"), Axis::linear("albedo"));
            if self.gamut.channels.len() > 1 {
                panel = panel.title(format!("channel {name}"));
            }
            let turned = |place: &[f64; 2]| [place[1], place[0]];
            let outline: Vec<_> = channel.boundary.polygon().iter().map(turned).collect();
            let closed: Vec<_> = outline.iter().chain(outline.first()).copied().collect();
            panel = panel
                .with(Series::area("", outline).colour(lumislice::plot::GREY).opacity(0.25))
                .with(Series::line(named("boundary".to_owned()), closed).colour(lumislice::plot::BLACK).size(1.6));
            for resin in self.set.ids() {
                let points = channel.points.iter().filter(|point| point.stacking.mostly() == Some(&resin));
                let places = points.map(|point| [point.half_energy_radius_mm, point.albedo]);
                let series = Series::points(named(format!("mostly {}", self.set[resin].name)), places);
                let (colour, shape) = self.look_of(resin);
                panel = panel.with(series.size(4.2).colour(colour).shape(shape).opacity(0.8));
            }
            for (lies, name, colour) in [
                (Lies::Inside, "targets inside", GREEN),
                (Lies::Mixed, "targets reached by mixtures", BLUE),
                (Lies::Outside, "targets outside", RED),
            ] {
                let places = self.map.moves.iter().filter(|moved| moved.lies == lies);
                let places: Vec<_> = places.filter_map(|moved| moved.from[index]).map(|place| turned(&place)).collect();
                if !places.is_empty() {
                    let name = named(name.to_owned());
                    panel = panel.with(Series::points(name, places).size(9.0).shape(Shape::Triangle).colour(colour));
                }
            }
            figure = figure.with(if index == last { panel.legend_beside() } else { panel });
        }
        figure
    }

    /// How points of a resin are drawn: in its colour, as rings where that is the paper's.
    fn look_of(&self, resin: ResinId) -> (lumislice::plot::Rgb, Shape) {
        let [r, g, b, _] = self.set[resin].rgba;
        if [r, g, b].iter().all(|part| *part >= PALE) {
            return (lumislice::plot::GREY, Shape::Ring);
        }
        ([r, g, b], Shape::Disc)
    }

    fn csv(&self) -> String {
        let mut text = "channel,place,albedo,half_energy_radius_mm,stack\n".to_owned();
        for (name, channel) in self.channels() {
            for point in &channel.points {
                let (place, stack) = (channel.side(point).name(), self.stack(point).to_string());
                let (albedo, radius) = (point.albedo, point.half_energy_radius_mm);
                text += &format!("{name},{place},{albedo:.6},{radius:.6},\"{}\"\n", stack.replace('"', "\"\""));
            }
        }
        text
    }

    fn document(&self) -> serde_json::Value {
        let channel = |(name, channel): (&String, &ChannelGamut)| {
            let point = |point: &GamutPoint| {
                let stack = self.stack(point);
                let layers = stack.pairs().map(|(resin, mm)| json!({ "material": resin, "thickness_mm": mm }));
                json!({
                    "albedo": point.albedo,
                    "half_energy_radius_mm": point.half_energy_radius_mm,
                    "place": channel.side(point).name(),
                    "stack": layers.collect::<Vec<_>>(),
                })
            };
            json!({
                "channel": name,
                "albedo": channel.boundary.albedo(),
                "boundary": { "narrow": channel.boundary.narrow(), "wide": channel.boundary.wide() },
                "points": channel.points.iter().map(point).collect::<Vec<_>>(),
            })
        };
        let target = |(named, moved): (&Named, &Move)| {
            // Whether it is reached by mixtures is not known where they were not tried.
            let reached = (moved.reached() || self.tried).then(|| moved.reached());
            let each = |axis: usize| moved.from.iter().map(|from| from.map(|from| from[axis])).collect::<Vec<_>>();
            json!({
                "target": named.name,
                "albedo": each(0),
                "half_energy_radius_mm": each(1),
                "inside": moved.lies == Lies::Inside,
                "reached": reached,
                "gamut_map": { "albedo_factor": moved.albedo_factor, "width_factor": moved.width_factor },
            })
        };
        json!({
            "model": self.model(),
            "channels": self.channels().map(channel).collect::<Vec<_>>(),
            "targets": self.targets.iter().zip(&self.map.moves).map(target).collect::<Vec<_>>(),
        })
    }

    fn report(&self) -> String {
        let rows: Vec<_> = self
            .channels()
            .map(|(name, channel)| {
                let [dark, bright] = channel.boundary.albedo();
                let radius =
                    |side: &[[f64; 2]], pick: fn(f64, f64) -> f64| side.iter().map(|place| place[1]).reduce(pick);
                vec![
                    name.clone(),
                    format!("{dark:.4} to {bright:.4}"),
                    number(radius(channel.boundary.narrow(), f64::min), 3),
                    number(radius(channel.boundary.wide(), f64::max), 3),
                    channel.points.len().to_string(),
                ]
            })
            .collect();
        let header = ["channel", "albedo", "narrowest, mm", "widest, mm", "stackings"];
        let mut text = format!("{}; placed by {}\n{}", self.title(), self.model(), table(&header, &rows));
        if self.targets.is_empty() {
            return text + "pure layers: mixtures, which jobs and matches lay by default, reach more\n";
        }
        let rows: Vec<_> = self
            .targets
            .iter()
            .zip(&self.map.moves)
            .map(|(named, moved)| {
                let lies = match moved.lies {
                    Lies::Inside => "inside",
                    Lies::Mixed => "reached by mixtures",
                    Lies::Outside => "outside",
                };
                let each = |axis: usize, decimals: usize| {
                    let channels = moved.from.iter().map(|from| number(from.map(|from| from[axis]), decimals));
                    channels.collect::<Vec<_>>().join(" ")
                };
                vec![
                    named.name.clone(),
                    each(0, 3),
                    each(1, 3),
                    lies.to_owned(),
                    format!("{:.3}", moved.albedo_factor),
                    format!("{:.3}", moved.width_factor),
                ]
            })
            .collect();
        let header = ["target", "albedo", "50% within mm", "lies", "albedo ×", "width ×"];
        text += &table(&header, &rows);
        text += "albedo and width: what gamut-map would scale these targets by, taken together\n";
        if self.tried || self.map.moves.iter().all(Move::reached) {
            text
        } else {
            text + "outside of pure layers: mixtures, which were not tried, may reach more\n"
        }
    }
}

/// A colour all of whose parts are at least this cannot be told from paper.
const PALE: u8 = 215;
