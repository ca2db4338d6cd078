//! What a stack of layers does to light: the forward problem as a user asks it.
//!
//! Three models share the form of the answer. **Kubelka–Munk** (Hašan et al. 2010, equations 3, 4 and 6) composes spectra and turns
//! them back into profiles ([`InverseHankel`]); it knows diffuse light only and is poor for thin layers. **Transport** solves
//! the transport equation over discrete directions, from the volume coefficients ([`Transport`]). **Monte Carlo** traces
//! photons through the volume coefficients and transforms what it counted. Its spectra start at the totals of its profiles,
//! tail included.
//!
//! Over a core no light is transmitted: the half-space below has no other side.

use std::ops::ControlFlow;

use super::{
    Composite, FrequencyGrid, InverseHankel, Light, MaterialSet, MonteCarlo, OpticsError, RadialProfile, ResinId,
    RingEdges, Stack, Transport, TransportOptions, VolumeCoefficients,
};

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

/// What leaves a stack in one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelPrediction {
    /// R̂(k); the first is the albedo.
    pub reflection_hankel: Vec<f64>,
    /// T̂(k); the first is the total transmission.
    pub transmission_hankel: Vec<f64>,
    /// Share of the light that the top surface reflects like a mirror before any has entered, which R̂ leaves out; 0 where the first resin is
    /// index-matched, and by Kubelka–Munk.
    pub glint: f64,
    /// Radius in mm within which half of the reflected light leaves; `None` where nothing is reflected or the radius is out of reach.
    pub half_energy_radius_mm: Option<f64>,
    /// The same for nine tenths of it.
    pub ninety_percent_radius_mm: Option<f64>,
    /// Profiles as ring means.
    pub rings: Vec<PredictedRing>,
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

/// How many photons to trace, and which.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhotonOptions {
    /// The source.
    pub light: Light,
    /// Photons per channel, at least 2.
    pub photons: u64,
    /// Seed of the first channel; the others follow it.
    pub seed: u64,
}

impl Prediction {
    /// By scalar Kubelka–Munk under diffuse light. The stack's resins must be the set's.
    pub fn kubelka_munk(set: &MaterialSet, stack: &Stack) -> Self {
        let light = set.channel_ids().map(|channel| {
            let parameters = |resin: &ResinId| &set[*resin][channel].kubelka_munk;
            let slabs = stack.pairs().map(|(resin, mm)| Composite::from_slab(&parameters(resin).slab(mm)));
            let layers = slabs.fold(Composite::identity(set.grid.len()), |top, slab| top.over(&slab));
            let (reflection, transmission) = match &stack.core {
                None => (layers.reflection_top, layers.transmission),
                Some(core) => (layers.reflection_over(&parameters(core).half_space()), vec![0.0; set.grid.len()]),
            };
            ChannelPrediction::from_spectra(reflection, transmission, &set.grid)
        });
        Self { channels: set.channels.clone(), grid: set.grid.clone(), light: light.collect() }
    }

    /// By the transport equation, with resins given by their coefficients per channel.
    pub fn transport(
        channels: &[String],
        stack: &Stack<&[VolumeCoefficients]>,
        light: Light,
        options: TransportOptions,
    ) -> Self {
        let grid = FrequencyGrid::default();
        let predicted = (0..channels.len()).map(|channel| {
            let stack = stack.map(|resin| resin[channel]);
            let model = Transport { stack: &stack, light, options };
            let spectra = model.spectra(&grid);
            let glint = model.glint();
            ChannelPrediction {
                glint,
                ..ChannelPrediction::from_spectra(spectra.reflection, spectra.transmission, &grid)
            }
        });
        Self { channels: channels.to_vec(), light: predicted.collect(), grid }
    }

    /// By Monte Carlo, with resins given by their coefficients per channel. `progress` hears the share that is done, 0 to 1, about
    /// every million photons, and may break off.
    ///
    /// # Errors
    /// As [`MonteCarlo::run_with`].
    pub fn monte_carlo(
        channels: &[String],
        stack: &Stack<&[VolumeCoefficients]>,
        options: PhotonOptions,
        mut progress: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, OpticsError> {
        let grid = FrequencyGrid::default();
        let mut light = Vec::with_capacity(channels.len());
        for channel in 0..channels.len() {
            let simulation = MonteCarlo {
                stack: stack.map(|resin| resin[channel]),
                light: options.light,
                photons: options.photons,
                seed: options.seed.wrapping_add(channel as u64),
                rings: RingEdges::growing(),
            };
            let result = simulation.run_with(|photons| {
                progress((channel as f64 + photons as f64 / options.photons as f64) / channels.len() as f64)
            })?;
            let profiles = (&result.reflection_profile, &result.transmission_profile);
            let predicted = ChannelPrediction::from_profiles(profiles.0, profiles.1, &grid);
            light.push(ChannelPrediction { glint: result.glint.mean, ..predicted });
        }
        Ok(Self { channels: channels.to_vec(), grid, light })
    }
}

impl ChannelPrediction {
    /// From R̂ and T̂ over `grid`, turned back into profiles as far as the grid tells (20 mm on the default one).
    pub fn from_spectra(reflection: Vec<f64>, transmission: Vec<f64>, grid: &FrequencyGrid) -> Self {
        let (r, t) = (InverseHankel::new(&reflection, grid), InverseHankel::new(&transmission, grid));
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
        Self {
            glint: 0.0,
            half_energy_radius_mm: r.radius_of_energy(0.5),
            ninety_percent_radius_mm: r.radius_of_energy(0.9),
            rings: rings.collect(),
            reflection_hankel: reflection,
            transmission_hankel: transmission,
        }
    }

    fn from_profiles(reflection: &RadialProfile, transmission: &RadialProfile, grid: &FrequencyGrid) -> Self {
        let edges = reflection.ring_edges().unwrap_or_default();
        let values = reflection.value_per_mm2().iter().zip(transmission.value_per_mm2());
        // Outer rings that no photon reached are left out, not zero.
        let lit = values.clone().rposition(|(r, t)| *r > 0.0 || *t > 0.0).map(|i| i + 1);
        let rings = edges.windows(2).zip(values).take(lit.unwrap_or(0)).map(|(edge, (r, t))| PredictedRing {
            r_mm: 0.5 * (edge[0] + edge[1]),
            reflection_per_mm2: *r,
            transmission_per_mm2: *t,
        });
        Self {
            glint: 0.0,
            half_energy_radius_mm: reflection.radius_of_energy(0.5),
            ninety_percent_radius_mm: reflection.radius_of_energy(0.9),
            rings: rings.collect(),
            reflection_hankel: reflection.hankel(grid).values,
            transmission_hankel: transmission.hankel(grid).values,
        }
    }

    /// The profiles as CSV: `r_mm,reflection_per_mm2,transmission_per_mm2`, to be read back as point samples.
    pub fn to_csv(&self) -> String {
        use super::profile_csv::six_digits;
        let row = |ring: &PredictedRing| {
            [ring.r_mm, ring.reflection_per_mm2, ring.transmission_per_mm2].map(six_digits).join(",") + "\n"
        };
        "r_mm,reflection_per_mm2,transmission_per_mm2\n".to_owned() + &self.rings.iter().map(row).collect::<String>()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::optics::ProfileFile;

    fn synthetic() -> MaterialSet {
        MaterialSet::builtin("synthetic").unwrap()
    }

    fn stack(set: &MaterialSet, text: &str, core: Option<&str>) -> Stack {
        let named = text.parse::<Stack<String>>().unwrap().over(core.map(str::to_owned));
        set.stack(&named).unwrap()
    }

    fn by_photons(set: &MaterialSet, stack: &Stack, photons: u64) -> Prediction {
        let volumes = stack.map(|&resin| set[resin].volumes().unwrap());
        let options = PhotonOptions { light: Light::Diffuse, photons, seed: 1 };
        let go_on = |_| ControlFlow::Continue(());
        Prediction::monte_carlo(&set.channels, &volumes.map(|resin| resin.as_slice()), options, go_on).unwrap()
    }

    #[test]
    fn five_millimetres_of_white_on_black_are_the_papers_0_6() {
        let set = synthetic();
        let prediction = Prediction::kubelka_munk(&set, &stack(&set, "white:5", Some("black")));
        assert!((prediction.light[0].reflection_hankel[0] - 0.628).abs() < 1e-3);
        assert_eq!(prediction.light[0].transmission_hankel, [0.0; 128]);
    }

    #[test]
    fn models_agree_on_a_thick_layer() {
        let set = synthetic();
        let white = stack(&set, "white:3", None);
        let km = &Prediction::kubelka_munk(&set, &white).light[0];
        let mc = &by_photons(&set, &white, 150_000).light[0];
        // The resin's parameters come from a slab of just this thickness, so what differs is noise.
        assert!((km.reflection_hankel[0] - mc.reflection_hankel[0]).abs() < 4e-3);
        assert!((km.transmission_hankel[0] - mc.transmission_hankel[0]).abs() < 1e-3);
        let radii = |p: &ChannelPrediction| [p.half_energy_radius_mm, p.ninety_percent_radius_mm].map(Option::unwrap);
        for (km, mc) in radii(km).into_iter().zip(radii(mc)) {
            assert!((km / mc - 1.0).abs() < 0.03, "{km} against {mc}");
        }
    }

    #[test]
    fn csv_read_back_has_the_predicted_spectrum() {
        let set = synthetic();
        let stack = stack(&set, "white:0.5,support:1", None);
        for prediction in [Prediction::kubelka_munk(&set, &stack), by_photons(&set, &stack, 100_000)] {
            let light = &prediction.light[0];
            let read = ProfileFile::parse(&light.to_csv(), Path::new("p.csv")).unwrap();
            let spectrum = read.reflection.unwrap().hankel(&prediction.grid).values;
            let worst = spectrum.iter().zip(&light.reflection_hankel).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 2e-3, "{worst}");
        }
    }

    #[test]
    fn nothing_transmits_everything() {
        let set = synthetic();
        let light = &Prediction::kubelka_munk(&set, &Stack::default()).light[0];
        assert_eq!((light.reflection_hankel[0], light.transmission_hankel[0]), (0.0, 1.0));
        assert_eq!(light.half_energy_radius_mm, None);
    }

    #[test]
    fn breaking_off_is_an_error() {
        let volume = [VolumeCoefficients::new(1.0, 1.0, 0.0).unwrap()];
        let options = PhotonOptions { light: Light::Normal, photons: 10, seed: 1 };
        let stop = |_: f64| ControlFlow::Break(());
        let stack = Stack::new([(volume.as_slice(), 1.0)]);
        let result = Prediction::monte_carlo(&["Y".into()], &stack, options, stop);
        assert!(matches!(result, Err(OpticsError::Cancelled)));
    }
}
