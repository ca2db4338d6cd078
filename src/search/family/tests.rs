//! A family finds what it made, keeps what is asked, and answers alike whatever the threads.

use super::*;
use crate::{
    appearance::NormalizedDiffusion,
    optics::{Model, ResinId, predict},
    search::ResinLimit,
    watch::Unwatched,
};

const WHITE: ResinId = ResinId(0);
const BLACK: ResinId = ResinId(1);
const SUPPORT: ResinId = ResinId(2);

fn options() -> SearchOptions {
    let limits = vec![ResinLimit::NONE, ResinLimit::NONE, ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE }];
    SearchOptions {
        core: Some(BLACK),
        limits,
        objective: crate::search::Objective::default(),
        ..SearchOptions::default()
    }
}

fn set() -> MaterialSet {
    MaterialSet::builtin("synthetic").unwrap()
}

fn family(options: &SearchOptions, targets: &[PartTarget]) -> Option<Family> {
    Family::new(&set(), options, &RefineOptions::default(), targets, &Unwatched).unwrap()
}

fn material(albedo: f64, mean_free_path_mm: f64) -> PartTarget {
    let spectrum = NormalizedDiffusion::new(albedo, mean_free_path_mm).unwrap().spectrum(&set().grid);
    SearchTarget { channels: vec![spectrum] }.into()
}

fn grey(black: f64) -> Mixture {
    Mixture::new([(WHITE, 1.0 - black), (BLACK, black)]).unwrap()
}

/// Squares of orange beside blue: what a slab gains by clear in its coats is lost to the neighbour.
#[test]
fn colours_side_by_side_are_not_diluted_for_a_little() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let clear = set.resins.iter().position(|resin| resin.name == "clear").unwrap();
    let colour = |albedo: [f64; 3]| -> PartTarget {
        let spectrum = |albedo: f64| NormalizedDiffusion::new(albedo, 0.4).unwrap().spectrum(&set.grid);
        SearchTarget { channels: albedo.map(spectrum).to_vec() }.into()
    };
    let limit = |resin: &Resin| ResinLimit {
        min_depth_mm: if resin.print_as_background { 0.2 } else { 0.0 },
        ..ResinLimit::NONE
    };
    let options = SearchOptions { limits: set.resins.iter().map(limit).collect(), ..options() };
    let dilutes = |side_by_side: bool, targets: &[PartTarget]| {
        let layers = RefineOptions { side_by_side, ..RefineOptions::default() };
        let family = Family::new(&set, &options, &layers, targets, &Unwatched).unwrap().unwrap();
        family.shape.slots[0].resins.contains(&clear)
    };
    let [orange, blue] = [[0.58, 0.19, 0.045], [0.10, 0.22, 0.35]].map(colour);
    let both = [orange.clone(), blue];
    assert!(dilutes(false, &both) && !dilutes(true, &both));
    // What hardly differs is alike.
    let almost = colour([0.581, 0.19, 0.045]);
    assert_eq!(dilutes(true, &[orange.clone(), almost.clone()]), dilutes(false, &[orange.clone(), almost]));
    // Alone it has no neighbour, whatever the thickness of its parts.
    let thin = PartTarget { half_thickness_mm: Some(0.4), ..orange.clone() };
    assert_eq!(dilutes(true, &[orange.clone(), thin.clone()]), dilutes(false, &[orange, thin]));
}

#[test]
fn what_a_family_reflects_is_found_again() {
    let stackings = [(0.05, [0.3, 1.2, 0.8]), (0.3, [0.25, 0.4, 0.5]), (0.1, [0.4, 2.0, 0.0])].map(|(black, mm)| {
        Stack::new([(grey(black), mm[0]), (SUPPORT.into(), mm[1]), (WHITE.into(), mm[2])]).over(Mixture::from(BLACK))
    });
    let reflection =
        |stacking: &Stack<Mixture>| predict(&set(), stacking, &Model::REFLECTION, &Unwatched).unwrap().reflection();
    let targets: Vec<PartTarget> =
        stackings.iter().map(|stacking| SearchTarget { channels: reflection(stacking) }.into()).collect();
    let family = family(&options(), &targets).unwrap();
    for ((answer, stacking), part) in family.answers(&targets, &Unwatched).unwrap().iter().zip(&stackings).zip(&targets)
    {
        println!("{stacking:?}: {:.1e} {:?}", answer.objective, answer.parameters);
        let [found, asked] = [&answer.reflection, &part.target.channels].map(|spectra| spectra[0][0]);
        assert!((found / asked - 1.0).abs() < 2e-3, "{stacking:?}: albedo {found} for {asked}");
        assert!(answer.objective < 128.0 * 1e-6, "{stacking:?}: {answer:?}");
        // What it promises is what the model says of its layers.
        let said = reflection(&answer.stacking);
        let most = said[0].iter().zip(&answer.reflection[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 1e-4, "{most}");
    }
}

#[test]
fn limits_are_kept_and_slots_are_alike() {
    let targets: Vec<PartTarget> =
        [(0.1, 0.2), (0.3, 1.5), (0.45, 0.4), (0.55, 1.0), (0.2, 0.8)].map(|(a, l)| material(a, l)).to_vec();
    let mut options = options();
    options.limits[WHITE.0].max_mm = 1.5;
    options.limits[SUPPORT.0] = ResinLimit { min_depth_mm: 0.35, min_mm: 0.1, max_mm: 1.2 };
    options.max_thickness_mm = 2.5;
    for answer in family(&options, &targets).unwrap().answers(&targets, &Unwatched).unwrap() {
        let layers = &answer.stacking.layers;
        assert_eq!(layers.len(), 3);
        let mm: Vec<f64> = layers.iter().map(|layer| layer.thickness_mm).collect();
        assert!(layers[0].resin.parts().iter().all(|part| part.0 != SUPPORT));
        assert_eq!([layers[1].resin.pure(), layers[2].resin.pure()], [Some(SUPPORT), Some(WHITE)]);
        let slack = 1e-8;
        assert!(mm[0] >= 0.35 - slack && mm[0] <= 1.5 + slack && mm[2] <= 1.5 + slack, "{mm:?}");
        assert!((0.1 - slack..=1.2 + slack).contains(&mm[1]) && mm.iter().sum::<f64>() <= 2.5 + slack, "{mm:?}");
    }
    // Black keeps off the surface: a coat of white, and the mixture below it.
    options.limits[BLACK.0].min_depth_mm = 0.3;
    for answer in family(&options, &targets).unwrap().answers(&targets, &Unwatched).unwrap() {
        let layers = &answer.stacking.layers;
        assert_eq!((layers.len(), layers[0].resin.pure()), (4, Some(WHITE)));
        assert!(layers[0].thickness_mm >= 0.3 - 1e-8, "{layers:?}");
    }
    // No resin may be at the surface.
    options.limits.iter_mut().for_each(|limit| limit.min_depth_mm = 0.1);
    assert!(family(&options, &targets).is_none());
}

/// Layers that a printer cannot lay are left out or thick enough, unless its boundaries are dithered.
#[test]
fn no_layer_is_thinner_than_it_may_be() {
    let targets: Vec<PartTarget> =
        (0..12).map(|i| material(0.12 + 0.04 * f64::from(i), [0.3, 0.4, 1.1][i as usize % 3])).collect();
    let found = |thin_below_mixtures: bool| {
        let layers = RefineOptions { min_layer_mm: 0.12, thin_below_mixtures, ..RefineOptions::default() };
        let family = Family::new(&set(), &options(), &layers, &targets, &Unwatched).unwrap().unwrap();
        family.answers(&targets, &Unwatched).unwrap()
    };
    let thin = |answer: &FamilyAnswer| {
        answer.stacking.pairs().map(|(_, mm)| mm).filter(|mm| *mm > 0.0 && *mm < 0.12 - 1e-6).count()
    };
    let [free, kept] = [true, false].map(found);
    assert!(free.iter().any(|answer| thin(answer) > 0), "nothing to leave out");
    for ((free, kept), part) in free.iter().zip(&kept).zip(&targets) {
        assert_eq!(thin(kept), 0, "{:?}", kept.parameters);
        // What was near stays near.
        let [asked, found] = [&part.target.channels, &kept.reflection].map(|spectra| spectra[0][0]);
        assert!((found / asked - 1.0).abs() < 0.01 || free.objective > 1e-3, "{found} for {asked}");
        assert!(thin(free) > 0 || free == kept, "an answer that needs no change");
    }
}

#[test]
fn answers_do_not_depend_on_threads() {
    let targets: Vec<PartTarget> =
        (0..9).map(|i| material(0.1 + 0.05 * f64::from(i), 0.2 + 0.15 * f64::from(i * 4 % 9))).collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| family(&options(), &targets).unwrap().answers(&targets, &Unwatched).unwrap())
    };
    assert_eq!(with(1), with(3));
}

/// A slightly brighter target, answered to first order, is as bright as asked.
#[test]
fn responses_answer_targets_nearby() {
    let part = material(0.3, 0.6);
    let family = family(&options(), std::slice::from_ref(&part)).unwrap();
    let answer = family.answers(std::slice::from_ref(&part), &Unwatched).unwrap().remove(0);
    for change in [-0.03_f64, 0.03] {
        let moved: Vec<f64> =
            answer.parameters.iter().zip(&answer.response[0]).map(|(x, slope)| x + change * slope).collect();
        let stacking = family.stacking(&moved, &part).unwrap();
        let reflection = predict(&set(), &stacking, &Model::REFLECTION, &Unwatched).unwrap().reflection();
        let risen = libm::log(reflection[0][0] / answer.reflection[0][0]);
        println!("{change}: {risen}, {:?}", answer.response);
        assert!((risen - change).abs() < 0.1 * change.abs(), "{change}: {risen}");
    }
}

/// A part lit from both sides looks like half of it and the mirror image of that: R̂ and T̂ of the whole.
#[test]
fn thin_parts_are_slabs_with_light_from_both_sides() {
    let targets: Vec<PartTarget> = [None, Some(1.5), Some(0.6), Some(0.3), Some(0.15)]
        .into_iter()
        .map(|half_thickness_mm| PartTarget { half_thickness_mm, ..material(0.4, 0.5) })
        .collect();
    let family = family(&options(), &targets).unwrap();
    for (answer, part) in family.answers(&targets, &Unwatched).unwrap().iter().zip(&targets) {
        println!("{:?}: {:.2e} {:?}", part.half_thickness_mm, answer.objective, answer.parameters);
        assert_eq!(answer.stacking.layers.len(), 3);
        let Some(half_mm) = part.half_thickness_mm else { continue };
        let mm: f64 = answer.stacking.layers.iter().map(|layer| layer.thickness_mm).sum();
        assert!(mm <= half_mm + 1e-8, "{mm}");
        let half = answer.stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm));
        let half: Vec<_> = half.chain([(Mixture::from(BLACK), half_mm - mm)]).collect();
        let whole = Stack::joined(half.iter().cloned().chain(half.iter().rev().cloned()));
        let light = predict(&set(), &whole, &Model::REFLECTION, &Unwatched).unwrap().light;
        let [r, t] = [&light[0].reflection_hankel, &light[0].transmission_hankel];
        let both = r[0] + t[0];
        assert!((both / answer.reflection[0][0] - 1.0).abs() < 1e-3, "{both} for {}", answer.reflection[0][0]);
        assert!((both / 0.4 - 1.0).abs() < 0.01 || half_mm < 0.2, "{half_mm}: {both}");
    }
}

/// 40 random colours, dark saturated ones among them, each as near as any stacking of the family comes, by CIEDE2000:
/// against random stackings of every shape, and the best of them changed at random.
#[test]
#[ignore = "5 minutes; inks-rgb-7 holds, Vero's deep blues do not yet: docs/objective.md"]
fn colours_come_as_near_as_any_stacking_does() {
    use rand_xoshiro::{
        Xoshiro256PlusPlus,
        rand_core::{Rng, SeedableRng},
    };

    use crate::{
        colour::{delta_e_2000, lab, srgb_to_linear_f64},
        optics::{Base, LayeredReflection},
    };

    for name in ["inks-rgb-7", "vero-j850-provisional"] {
        let set = MaterialSet::builtin(name).unwrap();
        let core = set.resin("black").map(|(id, _)| id);
        let limit =
            |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
        let limits = set.resins.iter().map(|resin| limit(&resin.name)).collect();
        let options = SearchOptions { core, limits, ..options() };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(14);
        let mut unit = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        // Every third of full saturation and dark.
        let colour = |i: usize, unit: &mut dyn FnMut() -> f64| -> [f64; 3] {
            let mut srgb = [unit(), unit(), unit()];
            if i.is_multiple_of(3) {
                let value = 0.25 + 0.5 * unit();
                let at = (3.0 * unit()) as usize % 3;
                srgb = [0.0; 3];
                srgb[at] = value;
                srgb[(at + 1) % 3] = value * (unit() - 0.5).max(0.0);
            }
            srgb.map(srgb_to_linear_f64)
        };
        let colours: Vec<[f64; 3]> = (0..40).map(|i| colour(i, &mut unit)).collect();
        let spectrum = |albedo: f64| NormalizedDiffusion::new(albedo, 0.5).unwrap().spectrum(&set.grid);
        let targets: Vec<PartTarget> =
            colours.iter().map(|c| SearchTarget { channels: c.map(spectrum).to_vec() }.into()).collect();

        // The oracle.
        let resins = Resins::new(&set).unwrap();
        let shapes = shapes::offered(&resins.volumes, &resins.background, &options, &RefineOptions::default());
        let mut best = vec![f64::INFINITY; colours.len()];
        for Offer { shape, .. } in &shapes {
            let limits = shape.limits(&options, options.max_thickness_mm, false).unwrap();
            let directions = TransportOptions { polar: 6, orders: 1 };
            let model = |channel: usize| {
                let volumes: Vec<_> = resins.volumes.iter().map(|resin| resin[channel]).collect();
                let layers: Vec<_> =
                    shape.slots.iter().map(|slot| (slot.resins.len() == 1).then(|| volumes[slot.resins[0]])).collect();
                let indices: Vec<_> = shape.slots.iter().map(|slot| volumes[slot.resins[0]].refractive_index).collect();
                let base = core.map_or(Base::Nothing, |core| Base::HalfSpace(volumes[core.0]));
                (LayeredReflection::new(&layers, &indices, base, &[0.01], directions), volumes)
            };
            let models: Vec<_> = (0..3).map(model).collect();
            let albedo = |x: &[f64]| -> [f64; 3] {
                std::array::from_fn(|channel| {
                    let (model, volumes) = &models[channel];
                    let mixed: Vec<_> =
                        shape.mixed(x, volumes, resins.grains).into_iter().map(|mixed| mixed.volume).collect();
                    model.reflection(&x[..shape.slots.len()].iter().map(|mm| mm.max(0.0)).collect::<Vec<_>>(), &mixed)
                        [0]
                })
            };
            let slots = shape.slots.len();
            let any = |unit: &mut dyn FnMut() -> f64| -> Vec<f64> {
                let mut x: Vec<f64> = (0..slots).map(|_| 3.0 * unit().powi(3)).collect();
                let shares = shape.len() - slots;
                // Few inks at once, little and much of them.
                let mut share: Vec<f64> =
                    (0..shares).map(|_| if unit() < 0.4 { unit().powi(3) } else { 0.0 }).collect();
                let sum: f64 = share.iter().sum();
                if sum > 1.0 || (unit() < 0.3 && sum > 0.0) {
                    share.iter_mut().for_each(|s| *s /= sum);
                }
                x.extend(share);
                x
            };
            let xs: Vec<Vec<f64>> = (0..4000).filter_map(|_| limits.nearest(&any(&mut unit))).collect();
            let known: Vec<[f64; 3]> = parallel::map_all(&xs, |x| albedo(x));
            let seeds: Vec<u64> = (0..colours.len()).map(|_| (unit() * 1e9) as u64).collect();
            let found: Vec<f64> = parallel::map(colours.len(), |at| {
                let off = |albedo: [f64; 3]| delta_e_2000(lab(colours[at]), lab(albedo));
                let mut order: Vec<usize> = (0..xs.len()).collect();
                order.sort_by(|&a, &b| off(known[a]).total_cmp(&off(known[b])));
                let mut random = Xoshiro256PlusPlus::seed_from_u64(seeds[at]);
                let mut unit = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
                let improved = order.iter().take(4).map(|&start| {
                    let (mut x, mut least) = (xs[start].clone(), off(known[start]));
                    let mut size = 0.3;
                    for _ in 0..250 {
                        let moved: Vec<f64> = x
                            .iter()
                            .map(
                                |value| {
                                    if unit() < 0.5 { value + size * (unit() - 0.5) * (value + 0.02) } else { *value }
                                },
                            )
                            .collect();
                        let Some(moved) = limits.nearest(&moved) else { continue };
                        let there = off(albedo(&moved));
                        if there < least {
                            (x, least) = (moved, there);
                            size = (1.3 * size).min(1.0);
                        } else {
                            size = (0.97 * size).max(0.01);
                        }
                    }
                    least
                });
                improved.fold(f64::INFINITY, f64::min)
            });
            best.iter_mut().zip(found).for_each(|(best, found)| *best = best.min(found));
        }

        // Each alone, as `match` asks, and all together, as an object does.
        let off = |answer: &FamilyAnswer, at: usize| {
            let albedo = std::array::from_fn(|channel| answer.reflection[channel][0]);
            (delta_e_2000(lab(colours[at]), lab(albedo)), albedo)
        };
        let of = |targets: &[PartTarget]| {
            let family = Family::new(&set, &options, &RefineOptions::default(), targets, &Unwatched).unwrap().unwrap();
            family.answers(targets, &Unwatched).unwrap()
        };
        let together = of(&targets);
        let alone: Vec<FamilyAnswer> =
            targets.iter().map(|target| of(std::slice::from_ref(target)).remove(0)).collect();
        let mut worst = [0.0_f64; 2];
        for at in 0..colours.len() {
            let [(one, albedo), (all, _)] = [off(&alone[at], at), off(&together[at], at)];
            println!(
                "{name} {:.3?}: nearest {:.2}, alone {one:.2} {albedo:.3?}, together {all:.2}",
                colours[at], best[at]
            );
            for (worst, found) in worst.iter_mut().zip([one, all]) {
                *worst = worst.max((found - best[at]) / (0.1 * best[at]).max(1.0));
            }
        }
        println!("{name}: worst, of what is allowed: {worst:?}");
        assert!(worst[0] <= 1.0 && worst[1] <= 1.0, "{name}: {worst:?}");
    }
}
