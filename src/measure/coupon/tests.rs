//! A coupon printed, photographed and read by simulation: light through its voxels, a camera's noise.

use std::path::{Path, PathBuf};

use super::*;
use crate::look::{Pattern, Photons, Sides, TexelGrid, VoxelGrid, VoxelScene};
use crate::measure::dice::Dice;
use crate::optics::{Light, VolumeCoefficients};
use crate::picture::{Pixels, fast_png};
use crate::watch::Unwatched;

/// Name, σs, σa, g: light, dark, and one that light goes far in.
const RESINS: [(&str, f64, f64, f64); 3] =
    [("white", 8.0, 0.17, 0.5), ("black", 2.5, 4.0, 0.5), ("amber", 1.6, 0.025, 0.75)];

fn coupon() -> Coupon {
    let resin = |(name, sigma_s, sigma_a, g): (&str, f64, f64, f64)| NamedResin {
        name: name.to_owned(),
        rgba: [(100.0 * sigma_s.min(2.0)) as u8, (10.0 * sigma_a.min(20.0)) as u8, (100.0 * g) as u8, 255],
        density_g_per_cm3: 1.18,
        background: false,
        believed: vec![VolumeCoefficients::new(sigma_s, sigma_a, g).unwrap()],
    };
    let background = NamedResin { background: true, ..resin(("support", 1.0, 0.1, 0.5)) };
    let resins: Vec<_> = RESINS.into_iter().map(resin).chain([background]).collect();
    Coupon::new("resins", &["Y".into()], &resins, ("j750-27um", 0.027), 8.0).unwrap()
}

fn believed(coupon: &Coupon) -> Vec<VolumeCoefficients> {
    coupon.resins.iter().map(|resin| resin.believed[0]).collect()
}

/// The coupon's voxels, coarse along the layers.
fn voxels(coupon: &Coupon, volumes: &[VolumeCoefficients]) -> VoxelScene {
    let pitch = [1.0, 1.0, 0.027];
    let dims: [usize; 3] = std::array::from_fn(|axis| (coupon.size_mm[axis] / pitch[axis]).round() as usize);
    let id = |i: usize, j: usize, k: usize| {
        let at = [i as f64 + 0.5, j as f64 + 0.5];
        let within = |middle: &[f64; 2], side: f64| (0..2).all(|axis| (at[axis] - middle[axis]).abs() < 0.5 * side);
        if let Some(field) = coupon.fields.iter().find(|field| within(&field.middle_mm, coupon.spacing_mm)) {
            let depth = (k as f64 + 0.5) * pitch[2];
            let mut down = 0.0;
            let mut within = |mm: f64| {
                down += mm;
                depth < down
            };
            return field.stack.pairs().find(|(_, mm)| within(*mm)).map_or(coupon.dark, |(resin, _)| *resin) as u8;
        }
        let marked = coupon.marks.iter().any(|mark| within(mark, coupon.mark_mm));
        (if marked { coupon.dark } else { coupon.rim }) as u8
    };
    let [nx, ny, nz] = dims;
    let ids = (0..nx * ny * nz).map(|at| id(at % nx, at / nx % ny, at / (nx * ny))).collect();
    VoxelScene::new(&VoxelGrid::new(dims, pitch, ids).unwrap(), volumes, Sides::Open, None).unwrap()
}

/// What a camera sees in the middle of a field, straight down in a tent's light: by reciprocity what returns of light
/// that falls there along the normal. With its standard error.
fn seen(coupon: &Coupon, scene: &VoxelScene, field: usize, count: u64) -> [f64; 2] {
    let half = 0.5 * READ_SHARE * coupon.spacing_mm;
    let [x, y] = coupon.fields[field].middle_mm;
    let pattern = Pattern::Rectangle { min_mm: [x - half, y - half], max_mm: [x + half, y + half] };
    let [width, height, _] = coupon.size_mm;
    let texels = TexelGrid { origin_mm: [0.0; 2], pitch_mm: [width, height], dims: [1, 1] };
    let photons = Photons { light: Light::Normal, count, seed: 7 + field as u64 };
    let reflection = scene.image(&pattern, texels, photons, &Unwatched).unwrap().reflection;
    [reflection.mean, reflection.standard_error]
}

/// Noise of what the camera and the print make of a value.
const NOISE: f64 = 0.01;
/// Pixels of the square photographs, and of a millimetre.
const SIZE: usize = 1100;
const PER_MM: f64 = 9.0;

/// Photographs of fields that show `values`: the coupon turned by so much, a little from one side, unevenly lit.
fn photographs(folder: &Path, coupon: &Coupon, values: &[f64], degrees: f64, mirror: bool) -> Photographs {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let mut dice = Dice(5);
    let [width, height, _] = coupon.size_mm;
    let shown = |at: [f64; 2]| {
        let within = |middle: &[f64; 2], side: f64| (0..2).all(|axis| (at[axis] - middle[axis]).abs() < 0.5 * side);
        if !(0.0..width).contains(&at[0]) || !(0.0..height).contains(&at[1]) {
            return 0.2;
        }
        match coupon.fields.iter().position(|field| within(&field.middle_mm, coupon.spacing_mm)) {
            Some(field) => values[field],
            None if coupon.marks.iter().any(|mark| within(mark, coupon.mark_mm)) => 0.03,
            None => 0.55,
        }
    };
    let (mut lit, mut card) = (Vec::new(), Vec::new());
    for pixel in 0..SIZE * SIZE {
        let centred = |at: usize| (at as f64 + 0.5 - 0.5 * SIZE as f64) / PER_MM;
        let (u, v) = (centred(pixel % SIZE), centred(pixel / SIZE));
        let away = 1.0 + 4e-4 * u - 3e-4 * v;
        let (u, v) = ((if mirror { -u } else { u }) / away, v / away);
        // Rows count downwards.
        let at = [0.5 * width + cosine * u + sine * v, 0.5 * height + sine * u - cosine * v];
        let light = 60_000.0 * (1.0 - 0.003 * u + 0.001 * v - 5e-5 * (u * u + v * v));
        lit.push((dice.noisy(light * shown(at), NOISE) + 250.0) as u16);
        card.push((dice.noisy(light * 0.9, NOISE) + 250.0) as u16);
    }
    let write = |name: &str, values: &[u16]| -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, fast_png(SIZE, Pixels::Grey16(values)).unwrap()).unwrap();
        path
    };
    Photographs {
        coupon: vec![write("photo.png", &lit)],
        card: write("card.png", &card),
        dark: Some(write("dark.png", &vec![250; SIZE * SIZE])),
        card_albedo: 0.9,
        card_error: 0.01,
        specular: false,
        relative_error: 0.01,
    }
}

/// Fields of another number each, so that none can be taken for another.
fn ramp(coupon: &Coupon) -> Vec<f64> {
    (0..coupon.fields.len()).map(|field| 0.08 + 0.012 * field as f64).collect()
}

#[test]
fn fields_are_read_however_the_coupon_lies() {
    let coupon = coupon();
    let values = ramp(&coupon);
    for degrees in [0.0, 3.0, 90.0, 137.0, 181.0, 268.0] {
        let folder = tempfile::tempdir().unwrap();
        let reading = Reading::of(&coupon, &photographs(folder.path(), &coupon, &values, degrees, false)).unwrap();
        for (read, truth) in reading.values[0].iter().zip(&values) {
            assert!((read.value / truth - 1.0).abs() < 3e-3, "{degrees} degrees: {} is {truth}", read.value);
        }
        assert!((reading.pixels_per_mm / PER_MM - 1.0).abs() < 0.05, "{}", reading.pixels_per_mm);
        assert!(reading.marks_off_mm < 0.05, "{}", reading.marks_off_mm);
    }
}

#[test]
fn pictures_that_show_no_coupon_are_refused() {
    let coupon = coupon();
    let values = ramp(&coupon);
    let folder = tempfile::tempdir().unwrap();
    let refused = |photographs: &Photographs, words: &str| {
        let error = Reading::of(&coupon, photographs).unwrap_err().to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    };
    refused(&photographs(folder.path(), &coupon, &values, 20.0, true), "found a coupon in a mirror");
    let sound = photographs(folder.path(), &coupon, &values, 20.0, false);
    refused(&Photographs { coupon: vec![sound.card.clone()], ..sound.clone() }, "expected the 5 marks of the coupon");
    let bright: Vec<f64> = values.iter().map(|value| value * 4.0).collect();
    refused(&photographs(folder.path(), &coupon, &bright, 20.0, false), "full");
}

#[test]
fn a_coupon_is_its_file_again() {
    let coupon = coupon();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("coupon.json");
    std::fs::write(&path, coupon.json()).unwrap();
    assert_eq!(Coupon::read(&path).unwrap(), coupon);
    let text = String::from_utf8(coupon.json()).unwrap();
    for (from, to, words) in [
        ("\"version\": 1", "\"version\": 2", "found version 2, expected version 1"),
        ("\"stack\": \"white", "\"stack\": \"wait", "found resin wait, expected one of its resins"),
        ("\"spacing_mm\": 8.0", "\"spacing_mm\": 0.0", "expected millimetres above 0"),
        ("\"channels\": [\n    \"Y\"\n  ]", "\"channels\": []", "and a channel at least"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = Coupon::read(&path).unwrap_err().to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    }
}

/// Every resin over light and dark, every stack as deep as the coupon in whole slices, all of the area printed once.
#[test]
fn a_coupon_is_whole() {
    let coupon = coupon();
    assert_eq!((coupon.resins.len(), coupon.fields.len()), (3, 48));
    let slices = |mm: f64| (mm / 0.027 - (mm / 0.027).round()).abs() < 1e-6;
    for field in &coupon.fields {
        assert!((field.stack.thickness_mm() - coupon.size_mm[2]).abs() < 1e-9, "{}", coupon.named(field));
        assert!(field.stack.pairs().all(|(_, mm)| slices(mm)), "{}", coupon.named(field));
    }
    let (job, meshes) = coupon.job("set = \"synthetic\"");
    let area = |line: &str| {
        let name = line.strip_prefix("mesh = \"meshes/box-")?.strip_suffix(".obj\"")?;
        let (width, depth) = name.split_once('x')?;
        Some(width.parse::<f64>().ok()? * depth.parse::<f64>().ok()?)
    };
    let printed: f64 = job.lines().filter_map(area).sum();
    assert!((printed / (coupon.size_mm[0] * coupon.size_mm[1]) - 1.0).abs() < 1e-9, "{printed}");
    assert!(meshes.len() < 12 && meshes.values().all(|mesh| mesh.starts_with(b"v 0 0 0\n")));
}

/// A coupon's surface bends light, once.
#[test]
fn unlike_indices_are_refused() {
    let mut coupon = coupon();
    assert_eq!(coupon.refractive_index().unwrap(), 1.0);
    coupon.resins[1].believed[0].refractive_index = 1.5;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("coupon.json");
    std::fs::write(&path, coupon.json()).unwrap();
    let error = Coupon::read(&path).unwrap_err().to_string();
    assert!(
        error.contains("coupon.json: found refractive indices 1.5 of black beside 1 of white, expected"),
        "{error}"
    );
    let named = |resin: &CouponResin| NamedResin {
        name: resin.name.clone(),
        rgba: resin.rgba,
        density_g_per_cm3: resin.density_g_per_cm3,
        background: false,
        believed: resin.believed.clone(),
    };
    let resins: Vec<_> = coupon.resins.iter().map(named).collect();
    let error = Coupon::new("resins", &["Y".into()], &resins, ("j750-27um", 0.027), 8.0).unwrap_err().to_string();
    assert!(error.starts_with("refractive indices: found 1.5 of black"), "{error}");
}

#[test]
fn what_belongs_to_another_coupon_is_refused() {
    let coupon = coupon();
    let value = read::Value { value: 0.5, error: 0.01 };
    let reading = Reading {
        values: vec![vec![value; 5]],
        card_error: 0.01,
        specular: false,
        pixels_per_mm: PER_MM,
        marks_off_mm: 0.0,
        notes: Vec::new(),
    };
    let error = fit_coupon(&coupon, &reading, &Unwatched).unwrap_err().to_string();
    assert_eq!(error, "reading: found 1 channel of 5 fields, expected 1 channel of 48 fields: one of this coupon");
    let fit = CouponFit {
        channel: "Y".to_owned(),
        coefficients: believed(&coupon)[..2].to_vec(),
        shares: vec![[0.01; 2]; 2],
        misfit: 1.0,
        residual: 0.01,
        aside: vec![0.0; 48],
        missed: vec![0.0; 48],
    };
    let fits = [fit];
    let expected = "fits: found 1 channel of 2 resins and 48 fields, expected 1 channel of 3 resins and 48 fields: \
                    those of this coupon";
    assert_eq!(coupon.notes(&reading, &fits).unwrap_err().to_string(), expected);
    assert_eq!(coupon.toml(&reading, &fits).unwrap_err().to_string(), expected);
}

#[test]
fn coefficients_unlike_the_set_and_fields_missed_are_named() {
    let coupon = coupon();
    let fields = coupon.fields.len();
    let value = read::Value { value: 0.5, error: 0.01 };
    let reading = Reading {
        values: vec![vec![value; fields]],
        card_error: 0.01,
        specular: false,
        pixels_per_mm: PER_MM,
        marks_off_mm: 0.0,
        notes: Vec::new(),
    };
    let notes = |misfit: f64, scattering: f64, share: f64| {
        let mut coefficients = believed(&coupon);
        coefficients[1].sigma_s *= scattering;
        let fit = CouponFit {
            channel: "Y".to_owned(),
            shares: vec![[share; 2]; coefficients.len()],
            coefficients,
            misfit,
            residual: 0.01,
            aside: vec![0.0; fields],
            missed: vec![misfit; fields],
        };
        coupon.notes(&reading, &[fit]).unwrap()
    };
    assert_eq!(notes(1.2, 1.9, 0.05), Vec::<String>::new());
    // Of 42 values to spare.
    assert!(notes(1.35, 1.0, 0.05)[0].contains("fields are missed by 1.4 times their errors"));
    for scattering in [2.4, 0.3] {
        let words = format!("scattering (1 - g) of black is {scattering:.2} times what resins says");
        assert!(notes(1.0, scattering, 0.05)[0].contains(&words));
        // Where it is hardly known, that is what is said.
        assert!(notes(1.0, scattering, 0.4).iter().all(|note| note.contains("is hardly known")));
    }
}

/// What photons of its own say of neighbours, against the walk through voxels.
#[test]
fn neighbours_count_as_voxels_have_it() {
    let coupon = coupon();
    let volumes = believed(&coupon);
    let scene = voxels(&coupon, &volumes);
    let endless: Vec<f64> =
        coupon.fields.iter().map(|field| fit::returned(&field.stack.map(|&resin| volumes[resin]), false)).collect();
    let shares = aside::shares(&coupon, &volumes, &endless, &Unwatched).unwrap();
    let much = shares.iter().fold(0.0, |most: f64, share| most.max(share.abs()));
    assert!(much > 0.05, "{much}: where is the amber that light goes far in?");
    for field in (0..coupon.fields.len()).filter(|field| shares[*field].abs() > 0.01).chain([0, 7]) {
        let [light, error] = seen(&coupon, &scene, field, 100_000);
        let expected = endless[field] * (1.0 + shares[field]);
        let name = coupon.named(&coupon.fields[field]);
        assert!((light - expected).abs() < 3.5 * error + 3e-3 * light, "{name}: {light} ± {error}, not {expected}");
    }
}

/// Resins that are not what was believed, through voxels, in photographs of 1% noise and fields of 1%.
#[test]
fn coefficients_come_back() {
    let coupon = coupon();
    let factors = [[1.2, 0.8], [0.8, 1.3], [1.3, 0.7]];
    let truth: Vec<VolumeCoefficients> = believed(&coupon)
        .into_iter()
        .zip(factors)
        .map(|(volume, [s, a])| VolumeCoefficients {
            sigma_s: s * volume.sigma_s,
            sigma_a: a * volume.sigma_a,
            ..volume
        })
        .collect();
    let scene = voxels(&coupon, &truth);
    let mut dice = Dice(11);
    let values: Vec<f64> =
        (0..coupon.fields.len()).map(|field| dice.noisy(seen(&coupon, &scene, field, 150_000)[0], NOISE)).collect();
    let folder = tempfile::tempdir().unwrap();
    let mut reading = Reading::of(&coupon, &photographs(folder.path(), &coupon, &values, 31.0, false)).unwrap();
    let off_and_stated = |fit: &CouponFit| {
        let of = |(place, truth): (usize, &VolumeCoefficients)| {
            let [(reduced, error), (absorption, its)] = fit.coefficients_with_errors(place);
            let off = [reduced / (truth.sigma_s * (1.0 - truth.g)) - 1.0, absorption / truth.sigma_a - 1.0];
            let stated = [error / reduced, its / absorption];
            println!("{}: {off:.4?}, stated {stated:.4?}", coupon.resins[place].name);
            [0, 1].map(|i| (off[i], stated[i]))
        };
        truth.iter().enumerate().map(of).collect::<Vec<_>>()
    };
    let fit = fit_coupon(&coupon, &reading, &Unwatched).unwrap().remove(0);
    assert!(fit.misfit < 1.5, "{}", fit.misfit);
    // A g that is off by 0.2 is most of it in scattering, and in amber's absorption the noise.
    let most = [[0.06, 0.06], [0.2, 0.03], [0.12, 0.25]];
    for ([(scattering, stated), (absorption, its)], most) in off_and_stated(&fit).into_iter().zip(most) {
        assert!(scattering.abs() < 0.02_f64.max(2.0 * stated) && absorption.abs() < 0.05_f64.max(2.0 * its));
        assert!(stated < most[0] && its < most[1], "{stated} {its}");
    }
    // A card that is darker than its label: no field contradicts it.
    reading.card_error = 0.06;
    reading.values[0].iter_mut().for_each(|value| value.value *= 1.06);
    let off = off_and_stated(&fit_coupon(&coupon, &reading, &Unwatched).unwrap()[0]);
    assert!(off.iter().flatten().all(|(off, stated)| off.abs() < 2.0 * stated), "{off:?}");
    assert!(off[0][1].0.abs() > 0.1, "{off:?}: does a card count at all?");
    let text = coupon.toml(&reading, std::slice::from_ref(&fit)).unwrap();
    let path = folder.path().join("fitted.toml");
    std::fs::write(&path, text).unwrap();
    let file = crate::optics::MaterialFile::read(&path).unwrap();
    let again = file.volume("white").unwrap()[0];
    assert!((again.sigma_s / fit.coefficients[0].sigma_s - 1.0).abs() < 1e-5, "{again:?}");
}
