//! Laws of the random walk; the referee's own proof is in `reference.rs`.

use super::reference::numbers;
use crate::optics::{Light, MonteCarlo, OpticsError, RingEdges, Stack, VolumeCoefficients};
use crate::watch::Interrupt;

const WHITE: VolumeCoefficients = VolumeCoefficients { sigma_s: 8.0, sigma_a: 0.17, g: 0.5, refractive_index: 1.0 };
const SUPPORT: VolumeCoefficients = VolumeCoefficients { sigma_s: 1.6, sigma_a: 0.025, g: 0.75, refractive_index: 1.0 };

fn slab(coefficients: VolumeCoefficients, thickness_mm: f64) -> MonteCarlo {
    MonteCarlo {
        stack: Stack::new([(coefficients, thickness_mm)]),
        light: Light::Diffuse,
        photons: 50_000,
        seed: 7,
        rings: RingEdges::growing(),
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let job = slab(WHITE, 0.5);
    let on =
        |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| job.run().unwrap());
    assert_eq!(on(1), on(3));
    assert_ne!(on(1), MonteCarlo { seed: 8, ..job }.run().unwrap());
}

#[test]
fn without_absorption_nothing_is_lost() {
    let result = slab(VolumeCoefficients { sigma_a: 0.0, ..WHITE }, 1.0).run().unwrap();
    assert!((result.reflection.mean + result.transmission.mean - 1.0).abs() < 1e-12);
}

#[test]
fn profiles_sum_to_the_totals() {
    let result = slab(SUPPORT, 2.0).run().unwrap();
    assert!((result.reflection_profile.energy() - result.reflection.mean).abs() < 1e-12);
    assert!((result.transmission_profile.energy() - result.transmission.mean).abs() < 1e-12);
    assert!((result.unscattered_profile.energy() - result.unscattered_transmission.mean).abs() < 1e-12);
}

#[test]
fn unscattered_light_of_a_diffuse_source_follows_its_closed_form() {
    let h = 0.3_f64;
    let job = MonteCarlo { photons: 400_000, ..slab(SUPPORT, h) };
    let profile = job.run().unwrap().unscattered_profile;
    let errors = profile.standard_error().unwrap();
    let mut chi2 = 0.0;
    let mut rings = 0;
    for ((r, value), error) in profile.r_mm().iter().zip(profile.value_per_mm2()).zip(errors) {
        if *error > 0.0 && *value > 3.0 * error && *r < 2.0 {
            let d2 = r * r + h * h;
            let exact = (-SUPPORT.sigma_t() * d2.sqrt()).exp() * h * h / (std::f64::consts::PI * d2 * d2);
            chi2 += ((value - exact) / error).powi(2);
            rings += 1;
        }
    }
    let chi2 = chi2 / f64::from(rings);
    assert!(rings > 50 && (0.6..1.5).contains(&chi2), "{rings} rings, chi2 {chi2}");
}

#[test]
fn splitting_a_layer_or_adding_an_empty_one_changes_nothing() {
    let whole = slab(WHITE, 1.0);
    let split = MonteCarlo { stack: Stack::new([(WHITE, 0.25), (SUPPORT, 0.0), (WHITE, 0.75)]), ..whole.clone() };
    // The same random numbers, so equal to rounding, save for the rare photon whose ring or fate flips.
    let (a, b) = (whole.run().unwrap(), split.run().unwrap());
    assert!((a.reflection.mean - b.reflection.mean).abs() < 0.2 * a.reflection.standard_error);
    assert!((a.transmission.mean - b.transmission.mean).abs() < 0.2 * a.transmission.standard_error);
}

#[test]
fn a_stack_of_nothing_lets_everything_through() {
    let result = slab(WHITE, 0.0).run().unwrap();
    assert_eq!((result.reflection.mean, result.transmission.mean), (0.0, 1.0));
    let void = VolumeCoefficients { sigma_s: 0.0, sigma_a: 0.0, g: 0.0, refractive_index: 1.0 };
    let result = slab(void, 3.0).run().unwrap();
    assert_eq!((result.reflection.mean, result.unscattered_transmission.mean), (0.0, 1.0));
}

#[test]
fn a_half_space_is_the_limit_of_thick_slabs() {
    let thick = slab(WHITE, 12.0).run().unwrap();
    let endless = MonteCarlo { stack: Stack::default().over(WHITE), seed: 99, ..slab(WHITE, 1.0) }.run().unwrap();
    let sigma = thick.reflection.standard_error.hypot(endless.reflection.standard_error);
    assert!((thick.reflection.mean - endless.reflection.mean).abs() < 4.0 * sigma);
    assert_eq!(endless.transmission.mean, 0.0);
}

/// Light between the two faces of a slab that only absorbs, summed over its reflections.
#[test]
fn a_clear_slab_reflects_at_both_faces() {
    let dye = VolumeCoefficients { sigma_s: 0.0, sigma_a: 0.5, g: 0.0, refractive_index: 1.5 };
    let result = MonteCarlo { light: Light::Normal, ..slab(dye, 2.0) }.run().unwrap();
    let (face, once) = (0.04_f64, (-1.0_f64).exp());
    let between = 1.0 / (1.0 - (face * once).powi(2));
    let expected = (1.0 - face).powi(2) * once * between;
    assert!((result.glint.mean - face).abs() < 1e-12 && result.glint.standard_error < 1e-9);
    assert!((result.transmission.mean - expected).abs() < 4.0 * result.transmission.standard_error, "{result:?}");
    let back = (1.0 - face).powi(2) * face * once * once * between;
    assert!((result.reflection.mean - back).abs() < 4.0 * result.reflection.standard_error);
    assert_eq!(result.unscattered_transmission, result.transmission);
}

#[test]
fn without_absorption_nothing_is_lost_between_mirrors() {
    let resin =
        |refractive_index| VolumeCoefficients { sigma_a: 0.0, ..SUPPORT }.with_refractive_index(refractive_index);
    let stack = Stack::new([1.5, 1.3, 1.7].map(|index| (resin(index), 0.4)));
    let result = MonteCarlo { stack, ..slab(SUPPORT, 1.0) }.run().unwrap();
    let sum = result.reflection.mean + result.transmission.mean + result.glint.mean;
    // Light that hardly gets in at a grazing angle plays roulette.
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    // 0.0918 of diffuse light is reflected by n = 1.5.
    assert!((result.glint.mean - 0.0918).abs() < 4.0 * result.glint.standard_error + 5e-5, "{:?}", result.glint);
}

/// Against iadpython's adding–doubling: `scripts/fresnel-slabs`.
#[test]
fn slabs_in_air_are_those_of_adding_doubling() {
    let rows = numbers(include_str!("fresnel_slabs.csv"));
    for (index, row) in rows.iter().enumerate().filter(|(_, row)| row[1] <= 1.0).step_by(5) {
        let [albedo, tau, g, r_normal, t_normal, r_diffuse, t_diffuse] = row[..] else { panic!("columns") };
        let resin =
            VolumeCoefficients { sigma_s: albedo * tau, sigma_a: (1.0 - albedo) * tau, g, refractive_index: 1.5 };
        for (light, r, t) in [(Light::Normal, r_normal, t_normal), (Light::Diffuse, r_diffuse, t_diffuse)] {
            let found = MonteCarlo { light, seed: 100 + index as u64, ..slab(resin, 1.0) }.run().unwrap();
            let error = found.reflection.standard_error.hypot(found.glint.standard_error);
            let off = found.reflection.mean + found.glint.mean - r;
            assert!(off.abs() < 4.0 * error + 3e-4, "{row:?}, {light:?}: R {found:?}");
            let off = found.transmission.mean - t;
            assert!(off.abs() < 4.0 * found.transmission.standard_error + 3e-4, "{row:?}, {light:?}: T {found:?}");
        }
    }
}

#[test]
fn out_of_range_input_is_named() {
    let message = |job: MonteCarlo| job.run().unwrap_err().to_string();
    assert_eq!(message(slab(WHITE, f64::NAN)), "thickness: found NaN, expected finite millimetres, 0 or more");
    assert!(message(slab(VolumeCoefficients { g: 1.0, ..WHITE }, 1.0)).starts_with("g: found 1,"));
    let mut endless = slab(WHITE, 1.0);
    endless.stack.core = Some(VolumeCoefficients { sigma_a: 0.0, ..WHITE });
    assert!(message(endless).contains("half-space"));
    let stop = Interrupt::new();
    stop.request();
    assert!(matches!(slab(WHITE, 1.0).run_with(&stop), Err(OpticsError::Stopped(_))));
}

#[test]
#[ignore = "a measurement, not a law: photons per second on one thread"]
fn photons_per_second() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, coefficients, thickness_mm) in [
        ("support 0.25 mm", SUPPORT, 0.25),
        ("support 1 mm", SUPPORT, 1.0),
        ("white 0.25 mm", WHITE, 0.25),
        ("white 1 mm", WHITE, 1.0),
        ("white 3 mm", WHITE, 3.0),
    ] {
        let job = MonteCarlo { photons: 2_000_000, rings: RingEdges::fine(), ..slab(coefficients, thickness_mm) };
        let started = std::time::Instant::now();
        let result = pool.install(|| job.run().unwrap());
        let speed = job.photons as f64 / started.elapsed().as_secs_f64() / 1e6;
        // Photons a second are worth the more the less each varies.
        let worth = 1.0 / (started.elapsed().as_secs_f64() * result.reflection.standard_error.powi(2));
        println!("{name}: {speed:.2} M photons/s, 1/(s σ_R²) {worth:.2e}");
    }
}
