//! Data that were spoiled: what no surface gives is refused, what is doubtful said, and sound data are neither.

use super::patch::Patch;
use crate::appearance::NormalizedDiffusion;
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
    // All are, and what lies beside them too: alike in all four directions, and no single material.
    let beside = PATCH.responses(3).chunks(side * side).map(|window| window[side * side / 2 + 1]).fold(1.0, f32::min);
    doubted("was it cut off", |window, [.., i, j]| plain(window, i, j).min(0.3 * beside));
    doubted("farther along rows", |window, [.., i, j]| {
        let (x, y) = (i as f32 - 6.0, j as f32 - 6.0);
        plain(window, i, j) * (0.1 * (x.abs() - y.abs())).exp()
    });
}

/// A window of another texel.
fn moved(from: impl Fn([usize; 2]) -> [usize; 2]) -> Result<Factors, String> {
    let (values, square) = (PATCH.responses(3), PATCH.window * PATCH.window);
    said(|_, [x, y, i, j]| {
        let [x, y] = from([x, y]);
        values[(y * PATCH.width + x) * square + j * PATCH.window + i]
    })
}

#[test]
fn texels_in_another_order_or_with_gains_are_told() {
    let [width, height, side] = [PATCH.width, PATCH.height, PATCH.window];
    let told = |found: Result<Factors, String>| {
        let doubts = found.unwrap().doubts;
        assert!(doubts.iter().any(|doubt| doubt.contains("by the same at all pixels of a window")), "{doubts:?}");
    };
    told(moved(|[x, y]| [if y % 2 == 1 { width - 1 - x } else { x }, y]));
    told(moved(|[x, y]| [if y % 2 == 1 { (x + width - 1) % width } else { x }, y]));
    told(moved(|[x, y]| [(7 * x + 3 * y) % width, (5 * y + x) % height]));
    // All by one texel: the last of a row became the first of the next.
    let found = moved(|[x, y]| {
        let texel = (y * width + x + width * height - 1) % (width * height);
        [texel % width, texel / width]
    });
    assert!(!found.unwrap().doubts.is_empty());
    told(said(|window, [x, y, i, j]| {
        let gain = 1.0 + 0.15 * ((x * 37 + y * 101) as f32).sin();
        gain * window[j * side + i]
    }));
    // Gains that grow steadily are a drift, not a hot row.
    doubted("light changes steadily from texel to texel", |window, [_, y, i, j]| {
        window[j * side + i] * (1.0 - 0.02 * y as f32)
    });
    doubted("differ by over ten times their noise", |window, [x, y, i, j]| {
        window[j * side + i] * if (x * 31 + y * 17 + i * 7 + j * 13) % 331 == 0 { 5.0 } else { 1.0 }
    });
}

#[test]
fn levels_and_units_are_told() {
    let side = PATCH.window;
    doubted("along the diagonal that falls to the right", |window, [.., i, j]| {
        let (x, y) = (i as f32 - 6.0, j as f32 - 6.0);
        window[j * side + i] * (0.05 * ((x + y).abs() - (x - y).abs())).exp()
    });
    refused(
        "-1, ",
        |window, [x, y, i, j]| {
            if (x + 3 * y + 5 * i + 7 * j) % 101 == 0 { -1.0 } else { window[j * side + i] }
        },
    );
    refused("0 at the lit texel", |window, [.., i, j]| if [i, j] == [6, 6] { 0.0 } else { window[j * side + i] });
    let values = PATCH.responses(3);
    let mut sorted = values.clone();
    sorted.sort_by(f32::total_cmp);
    let gate = sorted[sorted.len() / 10];
    doubted("what is faint was cut to 0", |window, [.., i, j]| {
        let value = window[j * side + i];
        if value < gate { 0.0 } else { value }
    });
    let area = (PATCH.pitch_mm * PATCH.pitch_mm) as f32;
    doubted("are values not per mm²", |window, [.., i, j]| area * window[j * side + i]);
    // A dark material under an offset, and one that a black level was taken from: windows that see where it ends.
    let dark = |offset: f32| {
        let material = NormalizedDiffusion::new(0.2, 0.5).unwrap();
        doubts_of(20, 21, 0.003, offset, |_, _| material)
    };
    let (sound, above, below) = (dark(0.0), dark(1e-3), dark(-1e-3));
    // So large that nothing else is left half-way out.
    let all = dark(0.02);
    assert!(all.iter().any(|doubt| doubt.contains("levels off at 2.")), "{all:?}");
    doubted("less than any material reflects", |window, [.., i, j]| 1e-6 * window[j * side + i]);
    doubted("falls to 100% only", |_, _| 0.3);
    assert!(sound.is_empty(), "{sound:?}");
    assert!(above.iter().any(|doubt| doubt.contains("levels off")), "{above:?}");
    assert!(below.iter().any(|doubt| doubt.contains("black level that is too high")), "{below:?}");
}

/// What is doubted of a square patch of these materials.
fn doubts_of(
    width: usize,
    window: usize,
    noise: f64,
    offset: f32,
    material: impl Fn(isize, isize) -> NormalizedDiffusion,
) -> Vec<String> {
    let patch = Patch { width, height: width, window, pitch_mm: 0.15, noise: [noise, 0.0] };
    let (half, mut random) = ((window / 2) as isize, super::patch::Random::new(7));
    let mut values = Vec::new();
    for texel in 0..width * width {
        let (x, y) = ((texel % width) as isize, (texel / width) as isize);
        for (dy, dx) in (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (dy, dx))) {
            let r = ((dx * dx + dy * dy) as f64).sqrt() * patch.pitch_mm;
            let both = [material(x, y), material(x + dx, y + dy)].map(|material| patch.profile(material, r));
            values.push(((both[0] * both[1]).sqrt() * (1.0 + noise * random.normal())) as f32 + offset);
        }
    }
    let folder = patch.write(&values, "");
    let options = FactorOptions { rounds: 2, ..FactorOptions::default() };
    factor(&folder.open(), Channel::Stored(0), &options, &Unwatched).unwrap().doubts
}

/// A chessboard without noise has equal values by the dozen at its lit texels, and is not cut off.
#[test]
fn squares_without_noise_are_not_cut_off() {
    let materials = [(0.55, 1.2), (0.2, 0.5)].map(|(albedo, path)| NormalizedDiffusion::new(albedo, path).unwrap());
    let doubts = doubts_of(24, 11, 0.0, 0.0, |x, y| materials[((x.div_euclid(8) + y.div_euclid(8)) & 1) as usize]);
    assert!(doubts.is_empty(), "{doubts:?}");
}
