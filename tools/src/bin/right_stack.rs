//! Does the search find the right stack? Random targets, what it finds for them, and what photons say of that.
//!
//! Targets are `diffusion` (normalised diffusion of a random albedo and mean free path), `colours` (the same with the
//! albedos of random stacks, by transport) or `hidden` (what random stacks reflect by transport). Ends with medians
//! and worst cases of the error in albedo, the colour difference CIEDE2000, the width of a shadow edge (10 to 90%) and
//! the time a target took.

#![allow(clippy::print_stdout)] // it prints a table

use std::{path::PathBuf, time::Instant};

use clap::Parser;
use lumislice::{
    appearance::NormalizedDiffusion,
    colour::{delta_e_2000, lab},
    optics::{
        EdgeResponse, FrequencyGrid, Layer, Light, MaterialFile, MaterialSet, Mixture, Model, ResinId, Stack, predict,
    },
    search::{
        Found, Judge, MatchOptions, Matcher, Norm, Objective, RefineOptions, ResinLimit, SearchOptions, SearchTarget,
    },
    watch::Unwatched,
};
use rand_xoshiro::{
    Xoshiro256PlusPlus,
    rand_core::{Rng, SeedableRng},
};

#[derive(Parser)]
struct Args {
    /// A built-in set, or a material file.
    #[arg(long, default_value = "synthetic")]
    materials: PathBuf,
    #[arg(long, value_enum, default_value = "diffusion")]
    kind: Kind,
    #[arg(long, default_value_t = 60)]
    targets: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Photons per target and channel; 0: transport judges.
    #[arg(long, default_value_t = 0)]
    photons: u64,
    #[arg(long, default_value = "natural")]
    objective: String,
    #[arg(long, default_value_t = 1.0)]
    dc_weight: f64,
    /// Kubelka–Munk in place of transport.
    #[arg(long)]
    km: bool,
    /// Layers of one resin each.
    #[arg(long)]
    no_mixtures: bool,
    /// Photons are asked of so many targets only, from the first on; default all.
    #[arg(long)]
    sample: Option<usize>,
    /// A line per target.
    #[arg(long)]
    each: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum Kind {
    Diffusion,
    Colours,
    Hidden,
}

struct Random(Xoshiro256PlusPlus);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Evenly in the logarithm.
    fn log(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.between(libm::log(low), libm::log(high)))
    }

    /// 2 to 4 layers, nowhere the same resin twice in a row, support not above 0.2 mm.
    fn stack(&mut self, set: &MaterialSet, limits: &[ResinLimit], core: ResinId) -> Stack {
        loop {
            let count = 2 + self.between(0.0, 3.0) as usize;
            let layers = (0..count).map(|_| {
                let resin = ResinId(self.between(0.0, set.resins.len() as f64) as usize);
                let strong = set[resin].name == "black";
                (resin, if strong { self.log(0.03, 0.3) } else { self.log(0.1, 3.0) })
            });
            let stack = Stack::joined(layers.collect::<Vec<_>>()).over(core);
            let mut depth = 0.0;
            let allowed = stack.layers.iter().all(|layer| {
                let top = depth;
                depth += layer.thickness_mm;
                top >= limits[layer.resin.0].min_depth_mm
            });
            if allowed && depth <= 5.0 && stack.layers.len() > 1 {
                return stack;
            }
        }
    }
}

/// Of all threads, where the system tells it.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    [11, 12].iter().filter_map(|&i| fields.get(i)?.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn spread(name: &str, unit: &str, mut values: Vec<f64>) {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() - 1) as f64 * share).round() as usize).copied().unwrap_or(0.0);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    println!(
        "{name:28} mean {mean:9.4}  median {:9.4}  90% {:9.4}  99% {:9.4}  worst {:9.4} {unit}",
        at(0.5),
        at(0.9),
        at(0.99),
        at(1.0)
    );
}

/// Root mean square difference in L* of the responses across a shadow's edge, within 8 mm of it.
fn edge_error(asked: &[f64], found: &[f64], grid: &FrequencyGrid) -> f64 {
    const POINTS: usize = 41;
    let [asked, found] = [asked, found].map(|spectrum| EdgeResponse::new(spectrum, grid));
    let square = |i: usize| {
        let x_mm = 16.0 * i as f64 / (POINTS - 1) as f64 - 8.0;
        let [asked, found] = [&asked, &found].map(|edge| lab([edge.at(x_mm).max(0.0); 3])[0]);
        (asked - found).powi(2)
    };
    ((0..POINTS).map(square).sum::<f64>() / POINTS as f64).sqrt()
}

/// Between every target and the one most like it: how far the mean of both stackings is from the mean of what was
/// asked, over how far the worse of the two is from its own, in L* of a shadow's edge; errors below 0.1 count as that.
fn between(set: &MaterialSet, targets: &[SearchTarget], found: &[Found]) -> anyhow::Result<Vec<f64>> {
    let distance = |a: &SearchTarget, b: &SearchTarget| -> f64 {
        let channel = |(a, b): (&Vec<f64>, &Vec<f64>)| {
            let albedo = (lab([a[0]; 3])[0] - lab([b[0]; 3])[0]).powi(2) / 1e4;
            albedo + a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64
        };
        a.channels.iter().zip(&b.channels).map(channel).sum()
    };
    let off = |asked: &[Vec<f64>], found: &[Vec<f64>]| -> f64 {
        let edges = asked.iter().zip(found).map(|(asked, found)| edge_error(asked, found, &set.grid));
        edges.sum::<f64>() / asked.len() as f64
    };
    let mut ratios = Vec::new();
    for (i, target) in targets.iter().enumerate() {
        let others = (0..targets.len()).filter(|&j| j != i);
        let nearest = others.min_by(|&a, &b| distance(target, &targets[a]).total_cmp(&distance(target, &targets[b])));
        let Some(j) = nearest else { continue };
        let asked = target.channels.iter().zip(&targets[j].channels);
        let asked: Vec<Vec<f64>> = asked.map(|(a, b)| a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect()).collect();
        let stacking = middle(&found[i].stacking(), &found[j].stacking());
        let printed = predict(set, &stacking, &Model::REFLECTION, &Unwatched)?.reflection();
        let ends = [i, j].map(|i| off(&targets[i].channels, found[i].reflection()));
        ratios.push(off(&asked, &printed) / ends[0].max(ends[1]).max(0.1));
    }
    Ok(ratios)
}

/// Slot by slot the mean thickness of two stackings of a family, with shares by thickness.
fn middle(a: &Stack<Mixture>, b: &Stack<Mixture>) -> Stack<Mixture> {
    let slots = a.layers.iter().zip(&b.layers).map(|(a, b)| {
        let mm = a.thickness_mm + b.thickness_mm;
        let of = |layer: &Layer<Mixture>| {
            let share = if mm > 0.0 { layer.thickness_mm / mm } else { 0.5 };
            layer.resin.parts().iter().map(move |&(resin, part)| (resin, share * part)).collect::<Vec<_>>()
        };
        let mixture = Mixture::new(of(a).into_iter().chain(of(b))).unwrap_or_else(|| a.resin.clone());
        (mixture, 0.5 * mm)
    });
    Stack { core: a.core.clone(), ..Stack::new(slots) }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut file = match args.materials.extension() {
        Some(_) => MaterialFile::read(&args.materials)?,
        None => MaterialFile::builtin(&args.materials.to_string_lossy())?,
    };
    file.fit(None, &Unwatched)?;
    let started = Instant::now();
    let set = file.into_set(&Unwatched)?;
    println!("set: {:.2} s", started.elapsed().as_secs_f64());
    let limit = |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
    let limits: Vec<_> = set.resins.iter().map(|resin| limit(&resin.name)).collect();
    let core = set.resin("black").map(|(id, _)| id).unwrap_or(ResinId(0));
    let norm = Norm::ALL.iter().find(|(name, _)| *name == args.objective).map(|(_, norm)| *norm).unwrap_or_default();
    let objective = Objective { norm, dc_weight: args.dc_weight };
    let search = SearchOptions { core: Some(core), limits: limits.clone(), objective, ..SearchOptions::default() };
    let judge = if args.km { Judge::KubelkaMunk } else { Judge::Transport };
    let options = MatchOptions { search, judge, layers: RefineOptions::default(), mixtures: !args.no_mixtures };
    let mut random = Random(Xoshiro256PlusPlus::seed_from_u64(args.seed));
    let grid = FrequencyGrid::default();
    let mut targets = Vec::new();
    while targets.len() < args.targets {
        let path = random.log(0.1, 1.6);
        let of_stack = |random: &mut Random| {
            let stack = random.stack(&set, &limits, core);
            Ok::<_, anyhow::Error>(predict(&set, &stack, &Model::REFLECTION, &Unwatched)?.reflection())
        };
        let channels = match args.kind {
            Kind::Diffusion => {
                let albedo = random.between(0.07, 0.6);
                vec![NormalizedDiffusion::new(albedo, path)?.spectrum(&grid); set.channels.len()]
            }
            Kind::Colours => {
                let spectra = of_stack(&mut random)?;
                let one = |r: &Vec<f64>| Ok(NormalizedDiffusion::new(r[0], path)?.spectrum(&grid));
                spectra.iter().map(one).collect::<anyhow::Result<_>>()?
            }
            Kind::Hidden => of_stack(&mut random)?,
        };
        targets.push(SearchTarget { channels });
    }
    let started = Instant::now();
    let matcher = Matcher::new(&set, &options)?;
    println!("tables: {:.2} s", started.elapsed().as_secs_f64());
    let started = Instant::now();
    let before = processor_seconds();
    let found = matcher.match_targets(&targets, &Unwatched)?;
    let took = started.elapsed().as_secs_f64();
    let processor = processor_seconds() - before;
    println!(
        "{} targets: {took:.2} s, {:.3} s each; {processor:.2} s of processor time",
        targets.len(),
        took / targets.len() as f64
    );
    let (mut albedo, mut colour, mut edge, mut rms, mut layers) = (vec![], vec![], vec![], vec![], vec![]);
    let (mut shown, mut objectives) = (vec![], vec![]);
    for (index, (found, target)) in found.iter().zip(&targets).enumerate() {
        let light = Light::Diffuse;
        let model = match args.photons {
            _ if args.sample.is_some_and(|sample| index >= sample) => Model::REFLECTION,
            0 => Model::REFLECTION,
            photons => Model::MonteCarlo { light, photons, seed: Model::DEFAULT_SEED },
        };
        let printed = predict(&set, &found.stacking(), &model, &Unwatched)?.reflection();
        let of = |spectra: &[Vec<f64>]| -> Vec<f64> { spectra.iter().map(|r| r[0]).collect() };
        let (asked, got) = (of(&target.channels), of(&printed));
        let off = asked.iter().zip(&got).map(|(a, g)| 100.0 * (g / a - 1.0).abs()).fold(0.0, f64::max);
        let to_lab = |a: &[f64]| lab(if let [r, g, b] = a { [*r, *g, *b] } else { [a[0]; 3] });
        let difference = delta_e_2000(to_lab(&asked), to_lab(&got));
        let width = |r: &[f64]| EdgeResponse::new(r, &grid).width_mm();
        let widths: Vec<f64> = target
            .channels
            .iter()
            .zip(&printed)
            .filter_map(|(t, r)| Some(100.0 * (width(r)? / width(t)? - 1.0)))
            .collect();
        let squares =
            target.channels.iter().zip(&printed).flat_map(|(t, r)| t.iter().zip(r)).map(|(t, r)| (t - r).powi(2));
        let n = squares.clone().count() as f64;
        rms.push((squares.sum::<f64>() / n).sqrt() * 1e4);
        if args.each {
            let named: Vec<_> =
                set.named(&found.stacking()).pairs().map(|(name, mm)| format!("{name} {mm:.3}")).collect();
            println!(
                "{off:6.2}% dE {difference:5.2} edge {widths:5.1?}% {:.3e} [{}] {asked:.3?} {got:.3?}",
                found.objective(),
                named.join(", ")
            );
        }
        let by_edge = target.channels.iter().zip(&printed).map(|(t, r)| edge_error(t, r, &grid));
        shown.push(by_edge.sum::<f64>() / printed.len() as f64);
        objectives.push(found.objective());
        albedo.push(off);
        colour.push(difference);
        edge.push(widths.iter().map(|w| w.abs()).fold(0.0, f64::max));
        layers.push(found.stacking().layers.len() as f64);
    }
    spread("albedo", "%", albedo);
    spread("CIEDE2000", "", colour);
    spread("edge, 10 to 90%", "%", edge);
    spread("edge, rms within 8 mm", "L*", shown);
    spread("objective", "", objectives);
    spread("rms of R̂", "e-4", rms);
    spread("layers", "", layers);
    if found.iter().all(|found| found.family.is_some()) && found.len() > 1 {
        spread("middle of neighbours", "x", between(&set, &targets, &found)?);
    }
    Ok(())
}
