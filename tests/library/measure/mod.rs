//! Photographs of resins whose profiles are known, measured: the round trip through files.

mod asymmetry;
mod faults;
mod inputs;
mod predictions;
mod round_trips;
mod sound;

use std::path::Path;
use std::sync::OnceLock;

use lumislice::measure::simulate::{Laboratory, Scene, Truth, write_capture};
use lumislice::measure::{Aperture, Capture, Measurement, ResinFacts, SeriesMeasurement, measure};
use lumislice::optics::{MaterialSet, Resin};
use lumislice::watch::Unwatched;

const SQUARE: Aperture = Aperture::Square { side_mm: 0.1 };
const PINHOLE: Aperture = Aperture::Disc { diameter_mm: 0.5 };

/// A resin of the built-in synthetic set in front of the camera.
struct Round {
    reflection: (Scene, Truth),
    transmission: (Scene, Truth),
    resin: Resin,
}

impl Round {
    fn new(name: &str, farthest_mm: f64) -> Self {
        Self::of("synthetic", name, 0, farthest_mm)
    }

    /// A channel of a resin of a built-in set.
    fn of(set: &str, name: &str, channel: usize, farthest_mm: f64) -> Self {
        let set = MaterialSet::builtin(set).unwrap();
        let resin = set.resin(name).unwrap().1.clone();
        let light = &resin.channels[channel];
        let (r, t) = (Truth::new(&light.reflection, true), Truth::new(&light.transmission, false));
        let reflection = (Scene::around(&r, SQUARE, farthest_mm), r);
        let transmission = (Scene::around(&t, PINHOLE, farthest_mm), t);
        Self { reflection, transmission, resin }
    }

    fn write(&self, laboratory: &Laboratory, folder: &Path) -> std::path::PathBuf {
        let facts = ResinFacts {
            name: self.resin.name.clone(),
            rgba: self.resin.rgba,
            density_g_per_cm3: self.resin.density_g_per_cm3,
            print_as_background: self.resin.print_as_background,
            thickness_mm: self.resin.channels[0].slab_mm,
            refractive_index: 1.0,
            notes: String::new(),
        };
        let (reflection, transmission) = (&self.reflection, &self.transmission);
        let pair = |both: &(Scene, Truth)| (both.0.clone(), both.1.clone());
        let (r, t) = (pair(reflection), pair(transmission));
        write_capture(laboratory, &facts, (&r.0, &r.1), (&t.0, &t.1), folder).unwrap()
    }

    fn measure(&self, laboratory: &Laboratory) -> Measurement {
        let folder = tempfile::tempdir().unwrap();
        let capture = self.write(laboratory, folder.path());
        measured(&capture)
    }
}

/// A resin of the synthetic set before the default laboratory, over a field of 22 mm: measured once for all who ask.
fn whole(resin: &str) -> &'static (Round, Measurement) {
    const RESINS: [&str; 3] = ["white", "black", "support"];
    static MEASURED: [OnceLock<(Round, Measurement)>; 3] = [const { OnceLock::new() }; 3];
    let at = RESINS.iter().position(|known| *known == resin).unwrap();
    MEASURED[at].get_or_init(|| {
        let round = Round::new(resin, 22.0);
        let measurement = round.measure(&Laboratory::default());
        (round, measurement)
    })
}

fn measured(capture: &Path) -> Measurement {
    measure(Capture::read(capture).unwrap(), &Unwatched).unwrap()
}

/// How far a measured profile is from the true one.
#[derive(Debug)]
struct Errors {
    /// log₁₀, rms over the rings of at least 1e-4 of the first.
    bright: f64,
    /// The same down to 1e-5.
    faint: f64,
    albedo: f64,
    centre_px: f64,
    half_radius: f64,
}

fn errors(measured: &SeriesMeasurement, (scene, truth): &(Scene, Truth)) -> Errors {
    let edges = measured.profile.ring_edges().unwrap();
    let exact: Vec<f64> = edges.windows(2).map(|edge| truth.ring_mean(edge[0].max(1e-9), edge[1])).collect();
    let largest = exact.iter().copied().fold(0.0, f64::max);
    let values = measured.profile.value_per_mm2();
    let rms = |least: f64| {
        let squares: Vec<f64> = exact
            .iter()
            .zip(values)
            .take_while(|(exact, _)| **exact >= least * largest)
            .map(|(exact, value)| (value.max(1e-30) / exact).log10().powi(2))
            .collect();
        assert!(exact[squares.len()..].iter().all(|exact| *exact < least * largest) || squares.len() == values.len());
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    if std::env::var_os("LUMISLICE_SHOW").is_some() {
        for (i, exact) in exact.iter().enumerate().take_while(|(_, exact)| **exact > 1e-6 * largest) {
            let error = measured.profile.standard_error().unwrap()[i];
            println!("{i} {:.3} {exact:.4e} {:.4e} {:.4}", edges[i], values[i], (values[i] - exact) / error);
        }
    }
    let integral = truth.integral();
    // Within a micrometre, for half of a thin dark slab's light leaves within 30 of them.
    let (mut light, mut half) = (0.0, 0.0);
    for r in (0..40_000).map(|i| f64::from(i) * 0.001) {
        let next = r + 0.001;
        let ring = truth.ring_mean(r.max(1e-9), next) * std::f64::consts::PI * (next * next - r * r);
        if light + ring >= 0.5 * integral {
            half = r + 0.001 * (0.5 * integral - light) / ring;
            break;
        }
        light += ring;
    }
    Errors {
        bright: rms(1e-4),
        faint: rms(1e-5),
        albedo: measured.profile.hankel(&Default::default()).values[0] / integral - 1.0,
        centre_px: (measured.scan.centre_px[0] - scene.centre[0]).hypot(measured.scan.centre_px[1] - scene.centre[1]),
        half_radius: measured.profile.radius_of_energy(0.5).unwrap() / half - 1.0,
    }
}

fn show(name: &str, measurement: &Measurement, errors: &Errors) {
    println!("{name}: {errors:.4?}");
    measurement.channels[0].all_findings().for_each(|(series, finding)| println!("  {series}: {finding}"));
}

/// `times` the bounds: log₁₀ 0.05 down to 1e-4, 0.15 down to 1e-5, albedo half a percent, centre a tenth of a pixel.
fn hold(name: &str, errors: &Errors, times: f64) {
    assert!(errors.bright <= 0.05 * times, "{name}: {errors:.4?}");
    assert!(errors.faint <= 0.15 * times, "{name}: {errors:.4?}");
    assert!(errors.albedo.abs() <= 0.005 * times, "{name}: {errors:.4?}");
    assert!(errors.centre_px <= 0.1 * times, "{name}: {errors:.4?}");
    assert!(errors.half_radius.abs() <= 0.03 * times, "{name}: {errors:.4?}");
}
