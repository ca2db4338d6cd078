//! Data that were spoiled: what no surface gives is refused, what is doubtful said, and sound data are neither.

use super::patch::Patch;
use crate::appearance::bssrdf::{Channel, FactorOptions, Factors, factor};
use crate::watch::Unwatched;

const PATCH: Patch = Patch { width: 20, height: 18, window: 13, pitch_mm: 0.06, noise: [0.01, 0.0] };

/// What `factor` says of windows that were changed, by texel (column, row) and pixel (column, row).
fn said(change: impl Fn(&[f32], [usize; 4]) -> f32) -> Result<Factors, String> {
    let values = PATCH.responses(3);
    let side = PATCH.window;
    let spoiled: Vec<f32> = (0..values.len())
        .map(|at| {
            let (texel, pixel) = (at / (side * side), at % (side * side));
            let window = &values[texel * side * side..][..side * side];
            change(window, [texel % PATCH.width, texel / PATCH.width, pixel % side, pixel / side])
        })
        .collect();
    let folder = PATCH.write(&spoiled, "");
    factor(&folder.open(), Channel::Stored(0), &FactorOptions { rounds: 2, ..FactorOptions::default() }, &Unwatched)
        .map_err(|error| error.to_string())
}

#[track_caller]
fn refused(words: &str, change: impl Fn(&[f32], [usize; 4]) -> f32) {
    let error = said(change).expect_err("should be refused");
    assert!(error.contains(words), "{error}");
}

#[track_caller]
fn doubted(words: &str, change: impl Fn(&[f32], [usize; 4]) -> f32) {
    let doubts = said(change).unwrap().doubts;
    assert!(doubts.iter().any(|doubt| doubt.contains(words)), "{doubts:?}");
}

#[test]
fn sound_data_are_not_doubted() {
    let side = PATCH.window;
    let found = said(|window, [.., i, j]| window[j * side + i]).unwrap();
    assert!(found.doubts.is_empty(), "{:?}", found.doubts);
    // Noise of 1% both ways is √2 times itself.
    assert!((found.reciprocity.relative / 0.0141 - 1.0).abs() < 0.1, "{}", found.reciprocity.relative);
}

#[test]
fn windows_another_way_round_are_refused() {
    let side = PATCH.window;
    refused("transposed", |window, [.., i, j]| window[i * side + j]);
    refused("flipped left to right", |window, [.., i, j]| window[j * side + side - 1 - i]);
    refused("turned by 180 degrees", |window, [.., i, j]| window[(side - 1 - j) * side + side - 1 - i]);
    refused(
        "zeros",
        |window, [x, y, i, j]| if (x * 7 + y * 5 + i * 3 + j) % 89 == 0 { 0.0 } else { window[j * side + i] },
    );
}

#[test]
fn what_is_doubtful_is_said() {
    let side = PATCH.window;
    let plain = |window: &[f32], i: usize, j: usize| window[j * side + i];
    doubted("shifted by about -0.5", |window, [.., i, j]| {
        (plain(window, i, j) * plain(window, (i + side - 1) % side, j)).abs().sqrt()
    });
    doubted("lit rows have gains of their own, row 7 +", |window, [_, y, i, j]| {
        plain(window, i, j) * if y == 7 { 1.1 } else { 1.0 }
    });
    doubted("lit columns have gains of their own, column 11 +", |window, [x, _, i, j]| {
        plain(window, i, j) * if x == 11 { 1.2 } else { 1.0 }
    });
    doubted("column +2 of the windows", |window, [.., i, j]| {
        plain(window, i, j) * if i == side / 2 + 2 { 1.2 } else { 1.0 }
    });
    // A third of the lit texels is cut off.
    let mut centres: Vec<f32> = PATCH.responses(3).chunks(side * side).map(|window| window[side * side / 2]).collect();
    centres.sort_by(f32::total_cmp);
    let ceiling = centres[2 * centres.len() / 3];
    doubted("was it cut off", |window, [.., i, j]| plain(window, i, j).min(ceiling));
    doubted("farther along rows", |window, [.., i, j]| {
        let (x, y) = (i as f32 - 6.0, j as f32 - 6.0);
        plain(window, i, j) * (0.1 * (x.abs() - y.abs())).exp()
    });
}
