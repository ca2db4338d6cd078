//! Laws of gamuts, on the synthetic resins.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

use super::{explore::Explorer, width::RadiusTable, *};
use crate::{
    appearance::NormalizedDiffusion,
    optics::{MaterialSet, Resin},
    search::{Found, Judge, Matcher, ResinLimit, SearchTarget, forward::reflection_of},
    watch::Unwatched,
};

struct Synthetic {
    set: MaterialSet,
    resins: Vec<Vec<KubelkaMunk>>,
    options: SearchOptions,
}

/// The synthetic set on black, support 0.2 mm deep, in layers as fine as a printer's slices of 27 µm.
fn synthetic() -> Synthetic {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let resins = set.resins.iter().map(Resin::kubelka_munk).collect();
    let limit = |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
    let limits = set.resins.iter().map(|resin| limit(&resin.name)).collect();
    let core = set.resin("black").map(|(id, _)| id);
    Synthetic { set, resins, options: SearchOptions { core, limits, units: 186, ..Default::default() } }
}

/// A stacking of up to four layers that keeps the limits, or none.
fn random_stacking(random: &mut Xoshiro256PlusPlus, world: &Synthetic) -> Option<Stack> {
    let mut below = |n: usize| (random.next_u64() % n as u64) as usize;
    let unit = world.options.unit_mm();
    let layers = (0..1 + below(4)).map(|_| (ResinId(below(world.resins.len())), (1 << below(8)) as f64 * unit));
    let stacking = Stack::joined(layers.collect::<Vec<_>>()).over(world.options.core);
    let mut depth = 0.0;
    for layer in &stacking.layers {
        if depth < world.options.limits[layer.resin.0].min_depth_mm {
            return None;
        }
        depth += layer.thickness_mm;
    }
    (depth <= world.options.max_thickness_mm).then_some(stacking)
}

#[test]
fn the_table_of_radii_is_the_inverse_transform() {
    let world = synthetic();
    let table = RadiusTable::new(&world.set.grid);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut compared = 0;
    while compared < 60 {
        let Some(stacking) = random_stacking(&mut random, &world) else { continue };
        let spectrum = reflection_of(&world.resins, &stacking).remove(0);
        let [_, exact] = place_of(&spectrum, &world.set.grid).unwrap();
        let found = table.half_energy(&spectrum).unwrap();
        // Beyond the grid the table goes on as 1/k, the transform as the pair of a profile that decays: below 0.1 mm
        // that shows.
        let tolerance = if exact > 0.1 { 0.012 } else { 0.03 };
        assert!((found / exact - 1.0).abs() < tolerance, "{found} against {exact}: {stacking:?}");
        compared += 1;
    }
}

/// Factors by which random stackings lie outside in radius, ascending, as `reflection` places them.
fn outside(world: &Synthetic, gamut: &Gamut, count: usize, reflection: impl Fn(&Stack) -> Vec<f64> + Sync) -> Vec<f64> {
    let boundary = &gamut.channels[0].boundary;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    let stackings: Vec<Stack> =
        std::iter::repeat_with(|| random_stacking(&mut random, world)).flatten().take(count).collect();
    let factor = |stacking: &Stack| {
        let [albedo, radius] = place_of(&reflection(stacking), &world.set.grid).unwrap();
        let ([low, high], [narrow, wide]) = (boundary.albedo(), boundary.radius_mm(albedo));
        assert!(albedo > low - 1e-3 && albedo < high + 1e-3, "{albedo}: {stacking:?}");
        (narrow / radius).max(radius / wide).max(1.0)
    };
    let mut factors: Vec<f64> = stackings.par_iter().map(factor).collect();
    factors.sort_by(f64::total_cmp);
    factors
}

#[test]
fn what_random_stackings_reach_lies_inside() {
    let world = synthetic();
    let gamut = Gamut::of_space(&world.resins, None, &world.set.grid, &world.options, &Unwatched).unwrap();
    let by_km = |stacking: &Stack| reflection_of(&world.resins, stacking).remove(0);
    for point in &gamut.channels[0].points {
        assert!((by_km(&point.stacking)[0] - point.albedo).abs() < 1e-9, "{point:?}");
    }
    let outside = outside(&world, &gamut, 1000, by_km);
    println!(
        "1000 random stackings lie outside by factors of up to {:.4}, 98% of them {:.4}",
        outside[999], outside[980]
    );
    assert!(outside[999] < 1.15 && outside[980] < 1.02);
}

#[test]
fn what_random_stackings_reach_by_transport_lies_inside() {
    let world = synthetic();
    let volumes: Vec<Vec<VolumeCoefficients>> = world.set.resins.iter().map(|resin| resin.volumes().unwrap()).collect();
    let start = std::time::Instant::now();
    let layers = RefineOptions { min_layer_mm: world.options.unit_mm(), ..RefineOptions::default() };
    let space = layer_space(&world.options, &layers, world.resins.len());
    let gamut = Gamut::of_space(&world.resins, Some(&volumes), &world.set.grid, &space, &Unwatched).unwrap();
    let took = start.elapsed().as_secs_f64();
    let channel: Vec<_> = volumes.iter().map(|resin| resin[0]).collect();
    let model =
        ModalReflection::new(&channel, world.options.core.map(|core| core.0), world.set.grid.as_slice(), DIRECTIONS);
    let outside = outside(&world, &gamut, 400, |stacking| {
        model.reflection(&stacking.pairs().map(|(resin, mm)| (resin.0, mm)).collect::<Vec<_>>())
    });
    println!(
        "400 random stackings by transport lie outside by factors of up to {:.4}, 98% of them {:.4}, {took:.1} s",
        outside[399], outside[392]
    );
    assert!(outside[399] < 1.15 && outside[392] < 1.03);
}

#[test]
fn limits_are_kept_and_the_answer_is_the_same_again() {
    let world = synthetic();
    let explore = || Gamut::of_space(&world.resins, None, &world.set.grid, &world.options, &Unwatched).unwrap();
    let gamut = explore();
    assert_eq!(gamut, explore());
    for point in &gamut.channels[0].points {
        let mut depth = 0.0;
        for layer in &point.stacking.layers {
            assert!(depth >= world.options.limits[layer.resin.0].min_depth_mm, "{point:?}");
            depth += layer.thickness_mm;
        }
        assert!(depth <= 5.0 + 1e-9, "{point:?}");
    }
}

/// As limits say that keep a resin out: by no thickness at all, or by less than the thinnest layer.
#[test]
fn resins_that_no_layer_may_hold_are_in_none() {
    let mut world = synthetic();
    let [(support, _), (black, _)] = ["support", "black"].map(|name| world.set.resin(name).unwrap());
    let layers = RefineOptions { min_layer_mm: world.options.unit_mm(), ..RefineOptions::default() };
    world.options.core = None;
    world.options.limits[support.0].max_mm = 0.0;
    world.options.limits[black.0].max_mm = 0.9 * layers.min_layer_mm;
    let space = layer_space(&world.options, &layers, world.resins.len());
    let gamut = Gamut::of_space(&world.resins, None, &world.set.grid, &space, &Unwatched).unwrap();
    let points = &gamut.channels[0].points;
    let holds = |resin: ResinId| points.iter().any(|point| point.stacking.layers.iter().any(|l| l.resin == resin));
    assert!(!points.is_empty() && !holds(support) && !holds(black), "{points:?}");
}

/// Four times the work: how far does the boundary move?
#[test]
#[ignore = "half a minute; in scripts/prove search"]
fn more_changes_move_the_boundary_little() {
    let world = synthetic();
    let parameters: Vec<_> = world.resins.iter().map(|resin| &resin[0]).collect();
    let limits = world.options.validate(3).unwrap();
    let boundary = |trials| {
        let found =
            Explorer::new(&parameters, &limits, &world.set.grid, &world.options).explore(trials, None, &Unwatched);
        ChannelGamut::around(&found, &world.set.grid, &world.options).unwrap().boundary
    };
    let (once, more) = (boundary(explore::TRIALS), boundary(4 * explore::TRIALS));
    let [low, high] = once.albedo();
    let mut moved: Vec<f64> = (1..200)
        .flat_map(|n| {
            let albedo = low + (high - low) * f64::from(n) / 200.0;
            let ([n0, w0], [n1, w1]) = (once.radius_mm(albedo), more.radius_mm(albedo));
            [(n0 / n1 - 1.0).abs(), (w1 / w0 - 1.0).abs()]
        })
        .collect();
    moved.sort_by(f64::total_cmp);
    println!(
        "four times the changes move the boundary by {:.4} in the median, {:.4} at most",
        moved[moved.len() / 2],
        moved[moved.len() - 1]
    );
    assert!(moved[moved.len() / 2] < 0.005 && moved[moved.len() * 9 / 10] < 0.02);
}

fn targets(world: &Synthetic, materials: &[(f64, f64)]) -> Vec<SearchTarget> {
    let spectrum = |&(albedo, path)| NormalizedDiffusion::new(albedo, path).unwrap().spectrum(&world.set.grid);
    materials.iter().map(|material| SearchTarget { channels: vec![spectrum(material)] }).collect()
}

#[test]
fn targets_inside_stay_and_others_come_inside_in_order() {
    let world = synthetic();
    let gamut = Gamut::of_space(&world.resins, None, &world.set.grid, &world.options, &Unwatched).unwrap();
    let boundary = &gamut.channels[0].boundary;
    let well_inside = |point: &&GamutPoint| {
        let [narrow, wide] = boundary.radius_mm(point.albedo);
        point.half_energy_radius_mm > 1.02 * narrow && point.half_energy_radius_mm < wide / 1.02
    };
    let inside: Vec<SearchTarget> = gamut.channels[0]
        .points
        .iter()
        .filter(well_inside)
        .map(|point| reflection_of(&world.resins, &point.stacking))
        .map(|channels| SearchTarget { channels })
        .collect();
    assert!(inside.len() > 10);
    let map = GamutMap::new(&gamut, &inside, &vec![1.0; inside.len()], &world.set.grid);
    assert_eq!(map.moved(), 0);
    assert_eq!(map.moves[0].apply(&inside[0], &world.set.grid), inside[0]);

    // Brighter than white resin, in three widths.
    let steps: Vec<(f64, f64)> =
        [0.2, 0.8, 3.2].iter().flat_map(|path| (0..8).map(move |n| (0.1 + 0.12 * f64::from(n), *path))).collect();
    let wanted = targets(&world, &steps);
    let map = GamutMap::new(&gamut, &wanted, &vec![1.0; wanted.len()], &world.set.grid);
    assert!(map.moved() > 8);
    let placed: Vec<[f64; 2]> = wanted
        .iter()
        .zip(&map.moves)
        .map(|(target, moved)| place_of(&moved.apply(target, &world.set.grid).channels[0], &world.set.grid).unwrap())
        .collect();
    for (place, moved) in placed.iter().zip(&map.moves) {
        let [albedo, radius] = moved.from[0].unwrap();
        // What was asked for is what comes out.
        assert!((place[0] / (moved.albedo_factor * albedo) - 1.0).abs() < 1e-3, "{place:?} {moved:?}");
        assert!((place[1] / (moved.width_factor * radius) - 1.0).abs() < 2e-2, "{place:?} {moved:?}");
        let [narrow, wide] = boundary.radius_mm(place[0]);
        assert!(place[1] > narrow / 1.03 && place[1] < wide * 1.03, "{place:?} not in {narrow} to {wide}");
    }
    for row in placed.chunks(8) {
        assert!(row.windows(2).all(|pair| pair[1][0] > pair[0][0] + 1e-3), "albedo loses its order: {row:?}");
    }
    for (a, b) in (0..16).map(|n| (placed[n], placed[n + 8])) {
        assert!(b[1] > 1.001 * a[1], "widths merge: {a:?} {b:?}");
    }
}

#[test]
fn hue_is_kept() {
    let set = MaterialSet::builtin("inks-rgb").unwrap();
    let resins: Vec<_> = set.resins.iter().map(Resin::kubelka_munk).collect();
    let core = set.resin("black").map(|(id, _)| id);
    let options = SearchOptions { core, ..Default::default() };
    let gamut = Gamut::of_space(&resins, None, &set.grid, &options, &Unwatched).unwrap();
    assert_eq!(gamut.channels.len(), 3);
    let channel = |albedo: f64| NormalizedDiffusion::new(albedo, 0.5).unwrap().spectrum(&set.grid);
    let target = SearchTarget { channels: [0.99, 0.66, 0.33].map(channel).to_vec() };
    let map = GamutMap::new(&gamut, std::slice::from_ref(&target), &[1.0], &set.grid);
    let moved = map.moves[0].apply(&target, &set.grid);
    let albedo: Vec<f64> = moved.channels.iter().map(|channel| channel[0]).collect();
    assert!((albedo[1] / albedo[0] - 2.0 / 3.0).abs() < 1e-9 && (albedo[2] / albedo[0] - 1.0 / 3.0).abs() < 1e-9);
}

#[test]
fn what_mixtures_reach_stays() {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let core = set.resin("black").map(|(id, _)| id);
    let options = MatchOptions {
        search: SearchOptions { core, ..Default::default() },
        judge: Judge::Transport,
        // Thick layers: grains of black make a narrower glow than they do.
        layers: RefineOptions { min_layer_mm: 0.0847, ..RefineOptions::default() },
        mixtures: true,
    };
    let target = |albedo: f64, path: f64| SearchTarget {
        channels: vec![NormalizedDiffusion::new(albedo, path).unwrap().spectrum(&set.grid)],
    };
    let gamut = Gamut::explored(&set, &options, &Unwatched, None).unwrap();
    let maps = |targets: &[SearchTarget]| {
        let weights = vec![1.0; targets.len()];
        let found = Matcher::matched(&set, &options, targets, &Unwatched, None).unwrap();
        let found: Vec<_> = found.iter().map(Found::reflection).collect();
        let pure = GamutMap::new(&gamut, targets, &weights, &set.grid);
        [pure, GamutMap::with_mixtures(&gamut, &found, targets, &weights, &set.grid)]
    };
    let mut targets = vec![target(0.12, 0.25), target(0.3, 0.5)];
    let [pure, mixed] = maps(&targets);
    assert_eq!([pure.moves[0].lies, mixed.moves[0].lies], [Lies::Outside, Lies::Mixed]);
    assert!(pure.moves[0].moves() && mixed.moved() == 0, "{pure:#?} {mixed:#?}");
    // Where something is brighter than any resin, all comes inside together, what is at the rim by no more than before.
    targets.push(target(0.97, 0.5));
    let [pure, mixed] = maps(&targets);
    assert_eq!(mixed.moves[2].lies, Lies::Outside);
    assert!(mixed.moves[2].albedo_factor < 0.99, "{mixed:#?}");
    assert!(mixed.moves[0].width_factor <= pure.moves[0].width_factor, "{pure:#?} {mixed:#?}");
}
