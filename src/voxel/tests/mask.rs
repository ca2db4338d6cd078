//! The mask is a permutation, has no long wavelengths and no clumps, whatever the shape of a voxel.

use std::{f64::consts::TAU, sync::LazyLock};

use super::*;

const J750_27: DVec3 = DVec3::new(25.4 / 600.0, 25.4 / 300.0, 0.027);
const J750_14: DVec3 = DVec3::new(25.4 / 600.0, 25.4 / 300.0, 0.014);
const CUBES: DVec3 = DVec3::splat(0.03);

/// Their masks, by name. One takes a second to make.
static MASKS: LazyLock<[(&str, DVec3, ThresholdMask); 3]> = LazyLock::new(|| {
    [("J750 27 µm", J750_27), ("J750 14 µm", J750_14), ("30 µm cubes", CUBES)]
        .map(|(name, pitch)| (name, pitch, ThresholdMask::new(pitch)))
});

/// Wavelengths that are long, in distances between voxels of a share.
const LONG: f64 = 6.0;

/// All voxels of a period, x fastest.
fn period(mask: &ThresholdMask) -> Vec<[u32; 3]> {
    let [nx, ny, nz] = mask.period();
    (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k]))).collect()
}

/// Energy over that of white noise, mean over wavelengths above `longer` mm along x, y and z at once or less.
fn energy(voxels: &[([u32; 3], bool)], dims: [u32; 3], pitch: DVec3, longer: f64) -> f64 {
    let count = voxels.iter().filter(|voxel| voxel.1).count() as f64;
    let white = count * (1.0 - count / voxels.len() as f64);
    let length = DVec3::from(dims.map(f64::from)) * pitch;
    let (mut sum, mut waves) = (0.0, 0);
    let most = length.map(|length| (length / longer).floor());
    for w in 0..=most.z as i32 {
        for v in -most.y as i32..=most.y as i32 {
            for u in -most.x as i32..=most.x as i32 {
                let wave = DVec3::new(f64::from(u), f64::from(v), f64::from(w));
                if wave == DVec3::ZERO || (wave / length).length() > 1.0 / longer {
                    continue;
                }
                let turn = wave / DVec3::from(dims.map(f64::from)) * TAU;
                let set = voxels.iter().filter(|voxel| voxel.1);
                let [re, im] = set.fold([0.0, 0.0], |[re, im], (at, _)| {
                    let (sine, cosine) = turn.dot(DVec3::from(at.map(f64::from))).sin_cos();
                    [re + cosine, im + sine]
                });
                sum += (re * re + im * im) / white;
                waves += 1;
            }
        }
    }
    sum / f64::from(waves)
}

/// Distance in mm from each of some set voxels to the nearest other one.
fn gaps(voxels: &[([u32; 3], bool)], dims: [u32; 3], pitch: DVec3) -> Vec<f64> {
    let set: Vec<DVec3> = voxels.iter().filter(|v| v.1).map(|v| DVec3::from(v.0.map(f64::from)) * pitch).collect();
    let length = DVec3::from(dims.map(f64::from)) * pitch;
    let apart = |a: DVec3, b: DVec3| {
        let way = (a - b).abs();
        way.min(length - way).length()
    };
    let nearest = |a: &DVec3| set.iter().map(|b| apart(*a, *b)).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    set.iter().step_by(1 + set.len() / 400).map(nearest).collect()
}

#[test]
fn every_threshold_is_there_once() {
    let pitch = DVec3::new(0.01, 2.0, 10.0);
    for (_, pitch, mask) in MASKS.iter().chain([&("splinters", pitch, ThresholdMask::new(pitch))]) {
        let mut ranks: Vec<_> = period(mask).into_iter().map(|at| mask.rank(at)).collect();
        ranks.sort_unstable();
        assert!(ranks.iter().enumerate().all(|(n, rank)| n == usize::from(*rank)), "{pitch}");
        assert_eq!(mask.brick([0, 1, 0])[BRICK + 1], mask.rank([1, 9, 0]));
    }
    assert_eq!(ThresholdMask::level(0.1), 3277);
    assert_eq!(ThresholdMask::level(1.0), 32768);
}

#[test]
fn long_wavelengths_have_no_energy_and_voxels_do_not_clump() {
    for (name, pitch, mask) in &*MASKS {
        let pitch = *pitch;
        let unit = (pitch.x * pitch.y * pitch.z).cbrt();
        for share in [0.02, 0.1, 0.5] {
            let level = ThresholdMask::level(share);
            let voxels: Vec<_> = period(mask).into_iter().map(|at| (at, mask.rank(at) < level)).collect();
            // The distance that voxels of this share would have on a simple cubic lattice.
            let even = unit / share.cbrt();
            let energy = energy(&voxels, mask.period(), pitch, LONG * even);
            let mut gaps = gaps(&voxels, mask.period(), pitch);
            gaps.sort_by(f64::total_cmp);
            let (least, median) = (gaps[0] / even, gaps[gaps.len() / 2] / even);
            println!(
                "{name}, {share}: energy above {:.3} mm {energy:.4} of white noise's, nearest neighbours least \
                 {least:.2}, median {median:.2} of {even:.4} mm",
                LONG * even
            );
            // White noise: 1, and by Poisson's law 0.08 for the least of 400 and 0.55 in the median.
            assert!(energy < 0.15, "{name}, {share}: {energy}");
            if share < 0.5 {
                assert!(least > 0.4 && median > 0.7, "{name}, {share}: {least}, {median}");
            }
        }
    }
}

/// A layer that is one plane of voxels thick has its share, whatever plane of a lattice it is.
#[test]
fn planes_have_their_shares() {
    for (_, pitch, mask) in &*MASKS {
        let dims = mask.period();
        for miller in PLANES {
            let through = (0..3).filter(|&axis| miller[axis] != 0);
            let planes = through.map(|axis| dims[axis]).min().unwrap() as i64;
            for share in [0.02, 0.1, 0.3, 0.5, 0.8] {
                let level = ThresholdMask::level(share);
                let mut counts = vec![[0.0; 2]; planes as usize];
                for at in period(mask) {
                    let plane: i64 = (0..3).map(|axis| i64::from(miller[axis]) * i64::from(at[axis])).sum();
                    let [all, set] = &mut counts[plane.rem_euclid(planes) as usize];
                    *all += 1.0;
                    *set += f64::from(u8::from(mask.rank(at) < level));
                }
                let worst = counts.iter().map(|[all, set]| (set / all - share).abs()).fold(0.0, f64::max);
                assert!(worst < 0.01, "{pitch} {miller:?} {share}: {worst}");
            }
        }
    }
}

/// The second reading says nothing of the first.
#[test]
fn the_second_reading_is_another() {
    let (_, _, mask) = &MASKS[0];
    let [nx, ny, nz] = mask.bricks;
    let (mut sum, half) = (0.0, ThresholdMask::LEVELS as f64 / 2.0);
    for at in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        for (a, b) in mask.brick(at).iter().zip(mask.second(at)) {
            sum += (f64::from(*a) / half - 1.0) * (f64::from(*b) / half - 1.0) * 3.0;
        }
    }
    let correlation = sum / ThresholdMask::LEVELS as f64;
    assert!(correlation.abs() < 0.02, "{correlation}");
}
