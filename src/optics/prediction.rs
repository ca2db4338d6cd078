//! What leaves a stack: spectra, profiles and radii, per channel.

use super::{FrequencyGrid, InverseHankel, RadialProfile, RingEdges};

/// Rings of predicted profiles end here, mm: beyond π/Δk of the default grid, 20 mm, the inverse transform aliases.
const PROFILE_REACH_MM: f64 = 20.0;

/// What leaves a stack, per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Frequencies of the spectra.
    pub grid: FrequencyGrid,
    /// One per channel.
    pub light: Vec<ChannelPrediction>,
}

impl Prediction {
    /// R̂ per channel.
    pub fn reflection(&self) -> Vec<Vec<f64>> {
        self.light.iter().map(|light| light.reflection_hankel.clone()).collect()
    }
}

/// What leaves a stack in one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelPrediction {
    /// R̂(k); the first is the albedo.
    pub reflection_hankel: Vec<f64>,
    /// T̂(k); the first is the total transmission.
    pub transmission_hankel: Vec<f64>,
    /// Share of the light that the top surface reflects like a mirror before any has entered, which R̂ leaves out; 0
    /// where the first resin is index-matched, and by Kubelka–Munk.
    pub glint: f64,
    profiles: Profiles,
}

/// Where profiles come from.
#[derive(Debug, Clone, PartialEq)]
enum Profiles {
    /// The spectra over this grid, turned back: not cheap, so only when they are asked for.
    Spectra(FrequencyGrid),
    /// What photons counted: R(r), T(r).
    Counted(RadialProfile, RadialProfile),
}

/// Light leaving between two radii, per mm² of unit incident flux.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedRing {
    /// Middle of the ring, mm: where a profile that falls like 1/r has its mean over the ring.
    pub r_mm: f64,
    /// Mean R over the ring.
    pub reflection_per_mm2: f64,
    /// Mean T over the ring.
    pub transmission_per_mm2: f64,
}

impl ChannelPrediction {
    /// From R̂ and T̂ over `grid`.
    pub fn from_spectra(reflection: Vec<f64>, transmission: Vec<f64>, grid: &FrequencyGrid) -> Self {
        let profiles = Profiles::Spectra(grid.clone());
        Self { reflection_hankel: reflection, transmission_hankel: transmission, glint: 0.0, profiles }
    }

    /// From R(r) and T(r) counted in the same rings, with their transforms over `grid`.
    pub(super) fn from_profiles(reflection: RadialProfile, transmission: RadialProfile, grid: &FrequencyGrid) -> Self {
        Self {
            reflection_hankel: reflection.hankel(grid).values,
            transmission_hankel: transmission.hankel(grid).values,
            glint: 0.0,
            profiles: Profiles::Counted(reflection, transmission),
        }
    }

    pub(super) fn with_glint(self, glint: f64) -> Self {
        Self { glint, ..self }
    }

    /// Radius in mm within which a share of the reflected light leaves, 0 to 1; `None` where nothing is reflected or
    /// the radius is out of reach.
    pub fn radius_of_energy_mm(&self, share: f64) -> Option<f64> {
        match &self.profiles {
            Profiles::Spectra(grid) => InverseHankel::new(&self.reflection_hankel, grid).radius_of_energy(share),
            Profiles::Counted(reflection, _) => reflection.radius_of_energy(share),
        }
    }

    /// Profiles as ring means: those of spectra as far as their grid tells (20 mm on the default one), those of photons
    /// as far as any got.
    pub fn rings(&self) -> Vec<PredictedRing> {
        match &self.profiles {
            Profiles::Spectra(grid) => self.turned_back(grid),
            Profiles::Counted(reflection, transmission) => counted(reflection, transmission),
        }
    }

    fn turned_back(&self, grid: &FrequencyGrid) -> Vec<PredictedRing> {
        let (r, t) = (&self.reflection_hankel, &self.transmission_hankel);
        let (r, t) = (InverseHankel::new(r, grid), InverseHankel::new(t, grid));
        let mut edges: Vec<f64> =
            RingEdges::growing().as_slice().iter().copied().filter(|edge| *edge < PROFILE_REACH_MM).collect();
        edges.push(PROFILE_REACH_MM);
        let energies: Vec<(f64, f64)> =
            edges.iter().map(|&r_mm| (r.energy_within(r_mm), t.energy_within(r_mm))).collect();
        let rings = edges.windows(2).zip(energies.windows(2)).map(|(edge, energy)| {
            let area = std::f64::consts::PI * (edge[1] * edge[1] - edge[0] * edge[0]);
            PredictedRing {
                r_mm: 0.5 * (edge[0] + edge[1]),
                reflection_per_mm2: (energy[1].0 - energy[0].0) / area,
                transmission_per_mm2: (energy[1].1 - energy[0].1) / area,
            }
        });
        rings.collect()
    }

    /// The profiles as CSV: `r_mm,reflection_per_mm2,transmission_per_mm2`, to be read back as point samples.
    pub fn to_csv(&self) -> String {
        use super::profile_csv::six_digits;
        let row = |ring: &PredictedRing| {
            [ring.r_mm, ring.reflection_per_mm2, ring.transmission_per_mm2].map(six_digits).join(",") + "\n"
        };
        let rows: String = self.rings().iter().map(row).collect();
        "r_mm,reflection_per_mm2,transmission_per_mm2\n".to_owned() + &rows
    }
}

/// The rings that photons were counted in; outer ones that none reached are left out, not zero.
fn counted(reflection: &RadialProfile, transmission: &RadialProfile) -> Vec<PredictedRing> {
    let edges = reflection.ring_edges().unwrap_or_default();
    let values = reflection.value_per_mm2().iter().zip(transmission.value_per_mm2());
    let lit = values.clone().rposition(|(r, t)| *r > 0.0 || *t > 0.0).map(|i| i + 1);
    let rings = edges.windows(2).zip(values).take(lit.unwrap_or(0)).map(|(edge, (r, t))| PredictedRing {
        r_mm: 0.5 * (edge[0] + edge[1]),
        reflection_per_mm2: *r,
        transmission_per_mm2: *t,
    });
    rings.collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{
        optics::{Light, MaterialSet, Model, OpticsError, ProfileFile, ResinId, Stack, predict},
        watch::{Interrupt, Unwatched},
    };

    fn by(model: Model, stack: &str, core: Option<&str>) -> Prediction {
        let set = MaterialSet::builtin("synthetic").unwrap();
        let named = stack.parse::<Stack<String>>().unwrap().over(core.map(str::to_owned));
        predict(&set, &set.stack(&named).unwrap(), &model, &Unwatched).unwrap()
    }

    fn photons(photons: u64) -> Model {
        Model::MonteCarlo { light: Light::Diffuse, photons, seed: 1 }
    }

    #[test]
    fn five_millimetres_of_white_on_black_are_the_papers_0_6() {
        let prediction = by(Model::KubelkaMunk, "white:5", Some("black"));
        assert!((prediction.light[0].reflection_hankel[0] - 0.628).abs() < 1e-3);
        assert_eq!(prediction.light[0].transmission_hankel, [0.0; 128]);
    }

    #[test]
    fn models_agree_on_a_thick_layer() {
        let km = &by(Model::KubelkaMunk, "white:3", None).light[0];
        let mc = &by(photons(150_000), "white:3", None).light[0];
        // The resin's parameters come from a slab of just this thickness, so what differs is noise.
        assert!((km.reflection_hankel[0] - mc.reflection_hankel[0]).abs() < 4e-3);
        assert!((km.transmission_hankel[0] - mc.transmission_hankel[0]).abs() < 1e-3);
        for share in [0.5, 0.9] {
            let [km, mc] = [km, mc].map(|light| light.radius_of_energy_mm(share).unwrap());
            assert!((km / mc - 1.0).abs() < 0.03, "{km} against {mc}");
        }
    }

    #[test]
    fn csv_read_back_has_the_predicted_spectrum() {
        for model in [Model::KubelkaMunk, photons(100_000)] {
            let prediction = by(model, "white:0.5,support:1", None);
            let light = &prediction.light[0];
            let read = ProfileFile::parse(&light.to_csv(), Path::new("p.csv")).unwrap();
            let spectrum = read.reflection.unwrap().hankel(&prediction.grid).values;
            let worst = spectrum.iter().zip(&light.reflection_hankel).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 2e-3, "{worst}");
        }
    }

    #[test]
    fn nothing_transmits_everything() {
        let set = MaterialSet::builtin("synthetic").unwrap();
        let nothing = predict(&set, &Stack::<ResinId>::default(), &Model::KubelkaMunk, &Unwatched).unwrap();
        let light = &nothing.light[0];
        assert_eq!((light.reflection_hankel[0], light.transmission_hankel[0]), (0.0, 1.0));
        assert_eq!(light.radius_of_energy_mm(0.5), None);
    }

    #[test]
    fn breaking_off_is_an_error() {
        let set = MaterialSet::builtin("synthetic").unwrap();
        let stop = Interrupt::new();
        stop.request();
        let result = predict(&set, &Stack::<ResinId>::default(), &photons(10), &stop);
        assert!(matches!(result, Err(OpticsError::Stopped(_))));
    }
}
