//! Laws of the limits: none is violated afterwards, and what keeps them is left alone.

use super::*;
use crate::appearance::align::align;
use crate::optics::Stack;
use proptest::prelude::*;

const TOLERANCE: f64 = 3e-4;

fn layers(bottoms: &[f32], sequence: &[ResinId]) -> Stack {
    let mut top = 0.0;
    Stack::joined(sequence.iter().zip(bottoms).map(|(resin, bottom)| {
        let thickness = (bottom - top) as f64;
        top = *bottom;
        (*resin, thickness)
    }))
}

fn violation(bottoms: &[f32], sequence: &[ResinId], limits: &[ResinLimit], slack: f64) -> Option<String> {
    let mut depth = 0.0;
    for layer in layers(bottoms, sequence).layers {
        let (limit, h) = (limits[layer.resin.0], layer.thickness_mm);
        let what = format!("resin {} of {h} mm at {depth} mm, {limit:?}", layer.resin);
        if depth + slack < limit.min_depth_mm || h + slack < limit.min_mm || h > limit.max_mm + slack {
            return Some(what);
        }
        depth += h;
    }
    None
}

fn limit() -> impl Strategy<Value = ResinLimit> {
    let depth = prop_oneof![2 => Just(0.0), 1 => 0.05..1.5f64];
    let least = prop_oneof![2 => Just(0.0), 1 => 0.02..0.6f64];
    let extra = prop_oneof![2 => Just(f64::INFINITY), 1 => 0.0..2.0f64];
    (depth, least, extra).prop_map(|(min_depth_mm, min_mm, extra)| ResinLimit {
        min_depth_mm,
        min_mm,
        max_mm: min_mm + extra,
    })
}

/// A sequence, limits and thicknesses, many of them 0 or thin.
fn row() -> impl Strategy<Value = (Vec<ResinId>, Vec<ResinLimit>, Vec<f32>)> {
    let thickness = prop_oneof![2 => Just(0.0f32), 1 => 0.0..0.1f32, 3 => 0.0..2.0f32];
    (2..5usize, 1..14usize).prop_flat_map(move |(resins, slots)| {
        let sequence = (0..slots).map(|slot| ResinId(slot % resins)).collect::<Vec<_>>();
        let bottoms = prop::collection::vec(thickness.clone(), slots).prop_map(|thickness| {
            let mut depth = 0.0;
            thickness
                .iter()
                .map(|t| {
                    depth += t;
                    depth
                })
                .collect::<Vec<f32>>()
        });
        (Just(sequence), prop::collection::vec(limit(), resins), bottoms)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]
    #[test]
    fn no_limit_is_violated_and_order_is_kept((sequence, limits, mut bottoms) in row()) {
        let before = bottoms.clone();
        let feasible = violation(&before, &sequence, &limits, 0.0).is_none();
        let changed = enforce_limits(&mut bottoms, &sequence, &limits);
        prop_assert!(bottoms.is_sorted() && bottoms.iter().all(|b| *b >= 0.0), "{bottoms:?}");
        if let Some(what) = violation(&bottoms, &sequence, &limits, TOLERANCE) {
            prop_assert!(false, "{what}\n{before:?}\n{bottoms:?}");
        }
        if !changed {
            prop_assert_eq!(&before, &bottoms);
        }
        prop_assert!(!(feasible && changed), "{before:?} became {bottoms:?}");
        let once = bottoms.clone();
        enforce_limits(&mut bottoms, &sequence, &limits);
        prop_assert!(once.iter().zip(&bottoms).all(|(a, b)| (a - b).abs() < 1e-3), "not a projection");
    }

    #[test]
    fn what_was_repaired_is_left_alone((sequence, limits, mut bottoms) in row()) {
        enforce_limits(&mut bottoms, &sequence, &limits);
        let feasible = bottoms.clone();
        enforce_limits(&mut bottoms, &sequence, &limits);
        prop_assert_eq!(feasible, bottoms);
    }

    #[test]
    fn what_is_certain_is_so(
        (sequence, limits, first) in row(), more in prop::collection::vec(prop::collection::vec(0.0..1.5f32, 14), 3),
        weights in prop::collection::vec(0.0..1.0f32, 4), at in (0.0..6.0f32, 0.0..0.5f32), inside in 0.0..1.0f32,
    ) {
        let slots = sequence.len();
        let kept = SlotLimits::new(&sequence, &limits);
        // Four rows that keep the limits, some thicknesses 0, and their mean.
        let mut rows = vec![first];
        for thickness in more {
            let mut depth = 0.0;
            rows.push(thickness[..slots].iter().map(|t| { depth += if *t < 0.5 { 0.0 } else { *t }; depth }).collect());
        }
        for row in &mut rows {
            kept.enforce(row);
        }
        let fold = |f: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..slots).map(|s| rows.iter().map(|row| row[s]).reduce(f).unwrap()).collect()
        };
        let (low, high) = (fold(f32::min), fold(f32::max));
        let sum: f32 = weights.iter().sum::<f32>() + 1e-6;
        let mut mean: Vec<f32> = (0..slots)
            .map(|s| {
                let mean = rows.iter().zip(&weights).map(|(row, w)| (w + 2.5e-7) / sum * row[s]);
                mean.sum::<f32>().clamp(low[s], high[s])
            })
            .collect();
        let (min, max) = (at.0, at.0 + at.1);
        if let Some(slot) = kept.certain(&low, &high, min, max) {
            kept.enforce(&mut mean);
            let depth = min + inside * (max - min);
            let found = mean.iter().filter(|bottom| depth >= **bottom).count();
            prop_assert_eq!(sequence.get(found), sequence.get(slot), "at {} in {:?}", depth, mean);
        }
    }
}

/// White, support, black over aligned slots; the mean of two stackings after the limits.
fn between(a: Stack, b: Stack, share: f32, limits: &[ResinLimit]) -> Stack {
    let aligned = align(&[a, b]);
    let slots = aligned.sequence.len();
    let bottoms = aligned.bottoms();
    let mut row: Vec<f32> =
        (0..slots).map(|i| (1.0 - share) * bottoms[i] as f32 + share * bottoms[slots + i] as f32).collect();
    enforce_limits(&mut row, &aligned.sequence, limits);
    layers(&row, &aligned.sequence)
}

fn stack(layers: &[(usize, f64)]) -> Stack {
    Stack::new(layers.iter().map(|&(resin, mm)| (ResinId(resin), mm)))
}

fn assert_layers(found: &Stack, expected: &[(usize, f64)]) {
    assert_eq!(found.layers.len(), expected.len(), "{found:?}");
    for (layer, (resin, mm)) in found.layers.iter().zip(expected) {
        assert!(layer.resin.0 == *resin && (layer.thickness_mm - mm).abs() < 1e-5, "{found:?}");
    }
}

const DEEP_SUPPORT: [ResinLimit; 3] =
    [ResinLimit::NONE, ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE }, ResinLimit::NONE];

#[test]
fn white_covers_the_support_between_two_stackings() {
    let a = || stack(&[(0, 0.2), (1, 2.0)]);
    let b = || stack(&[(2, 1.0)]);
    assert_layers(&between(a(), b(), 0.5, &DEEP_SUPPORT), &[(0, 0.2), (1, 0.9), (2, 0.5)]);
    assert_layers(&between(a(), b(), 0.0, &DEEP_SUPPORT), &[(0, 0.2), (1, 2.0)]);
    assert_layers(&between(a(), b(), 1.0, &DEEP_SUPPORT), &[(2, 1.0)]);
    // Nearly black: the support is all too high, and white takes it.
    assert_layers(&between(a(), b(), 0.95, &DEEP_SUPPORT), &[(0, 0.11), (2, 0.95)]);
}

#[test]
fn a_thin_top_layer_gives_way_or_grows() {
    let mut limits = DEEP_SUPPORT;
    limits[0].min_mm = 0.15;
    // Black may start at the top: it takes the film of white.
    let mut bottoms = [0.05, 0.05, 1.0];
    assert!(enforce_limits(&mut bottoms, &[0, 1, 2].map(ResinId), &limits));
    assert_eq!(bottoms, [0.0, 0.0, 1.0]);
    // Support may not: the film grows, first to its own minimum, then down to where support may begin.
    let mut bottoms = [0.05, 1.0, 1.0];
    assert!(enforce_limits(&mut bottoms, &[0, 1, 2].map(ResinId), &limits));
    assert_eq!(bottoms, [0.2, 1.0, 1.0]);
}

#[test]
fn support_on_top_is_given_to_the_layer_below() {
    let mut bottoms = [0.0, 1.0, 3.0];
    assert!(enforce_limits(&mut bottoms, &[0, 1, 2].map(ResinId), &DEEP_SUPPORT));
    assert_eq!(bottoms, [0.0, 0.0, 3.0]);
}

#[test]
fn joined_layers_keep_their_maximum() {
    let limits = [
        ResinLimit { max_mm: 1.0, ..ResinLimit::NONE },
        ResinLimit { min_mm: 0.1, ..ResinLimit::NONE },
        ResinLimit::NONE,
    ];
    // The support is too thin, the whites join to 1.45 mm, black takes what is too much.
    let mut bottoms = [0.9, 0.95, 0.95, 1.45, 1.45, 2.0];
    assert!(enforce_limits(&mut bottoms, &[0, 1, 2, 0, 1, 2].map(ResinId), &limits));
    assert_layers(&layers(&bottoms, &[0, 1, 2, 0, 1, 2].map(ResinId)), &[(0, 1.0), (2, 1.0)]);
}

#[test]
#[ignore = "measures: a million rows of 24 slots"]
fn a_million_rows() {
    let sequence: Vec<_> = (0..24).map(|slot| ResinId(slot % 3)).collect();
    let mut limits = DEEP_SUPPORT;
    for min_mm in [0.0, 0.1] {
        limits[0].min_mm = min_mm;
        let kept = SlotLimits::new(&sequence, &limits);
        for (what, first) in [("kept", 0.3f32), ("violated", 0.15)] {
            let mut row = [0.0f32; 24];
            let mut changed = 0u32;
            let start = std::time::Instant::now();
            for i in 0..1_000_000u32 {
                row.iter_mut().enumerate().for_each(|(s, b)| *b = first + 0.2 * s as f32 + (i % 7) as f32 * 1e-3);
                changed += u32::from(kept.enforce(&mut row));
            }
            println!("min {min_mm}, {what}: {:.1} ns a row, {changed} changed", start.elapsed().as_secs_f64() * 1e3);
        }
    }
}
