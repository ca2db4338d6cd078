//! What a stack of layers does to light: the forward problem as a user asks it.
//!
//! Three models share one question and the form of the answer. **Kubelka–Munk** (Hašan et al. 2010, equations 3, 4 and
//! 6) composes spectra and turns them back into profiles ([`InverseHankel`](super::InverseHankel)); it knows diffuse
//! light only and is poor for thin layers. **Transport** solves the transport equation over discrete directions, from
//! the volume coefficients ([`Transport`]). **Monte Carlo** traces photons through the volume coefficients and
//! transforms what it counted; its spectra start at the totals of its profiles, tail included. All three keep the laws
//! of `tests/laws.rs`.
//!
//! Over a core no light is transmitted: the half-space below has no other side.

use std::borrow::Cow;

use super::{
    ChannelPrediction, Composite, FrequencyGrid, Interface, KubelkaMunk, Light, MaterialFile, MaterialSet, Mixture,
    MonteCarlo, OpticsError, Prediction, RingEdges, Stack, Transport, TransportOptions, VolumeCoefficients,
};
use crate::watch::{Thousandths, Watch};

/// A model of light in a stack, and the light on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// Scalar Kubelka–Munk, under diffuse light, with boundaries where refractive indices differ. At once.
    KubelkaMunk,
    /// The transport equation. A fraction of a second; needs volume coefficients.
    Transport {
        /// The source.
        light: Light,
        /// How many directions.
        options: TransportOptions,
    },
    /// Photons. Seconds a million; needs volume coefficients.
    MonteCarlo {
        /// The source.
        light: Light,
        /// Photons per channel, at least 2.
        photons: u64,
        /// Seed of the first channel; the others follow it.
        seed: u64,
    },
}

/// Refractive index of air.
const AIR: f64 = 1.0;

impl Model {
    /// What judges stackings in searches: R̂ under diffuse light within 2.5e-4 rms of Monte Carlo.
    pub const REFLECTION: Self = Self::Transport { light: Light::Diffuse, options: TransportOptions::REFLECTION };
    /// Photons where no number is given: R̂(0) within 4e-4 (one σ), a few seconds a channel.
    pub const DEFAULT_PHOTONS: u64 = 2_000_000;
    /// Seed of photons where none is given.
    pub const DEFAULT_SEED: u64 = 2010;
}

/// What leaves `stack`, of resins of `set` or mixtures of them, by `model`. `watch` hears the stage "photons" where
/// they are traced.
///
/// # Errors
/// [`OpticsError::NoCoefficients`] where the model needs those of a resin that has none;
/// [`OpticsError::Parameter`] where photons are asked what they cannot answer, such as of a core that absorbs nothing;
/// [`OpticsError::Stopped`].
pub fn predict<M: Clone + Into<Mixture>>(
    set: &MaterialSet,
    stack: &Stack<M>,
    model: &Model,
    watch: &dyn Watch,
) -> Result<Prediction, OpticsError> {
    let stack = stack.map(|medium| medium.clone().into());
    let by_channel =
        |light: Vec<ChannelPrediction>| Prediction { channels: set.channels.clone(), grid: set.grid.clone(), light };
    if *model == Model::KubelkaMunk {
        let parameters =
            |channel| stack.map(|mixture| (set.mixed_kubelka_munk(mixture, channel), set.refractive_index(mixture)));
        let light = set.channel_ids().map(|channel| by_kubelka_munk(&parameters(channel), &set.grid));
        return Ok(by_channel(light.collect()));
    }
    let volumes = stack.try_map(|mixture| set.mixed_volumes(mixture))?;
    let volumes = volumes.map(|volumes| volumes.as_slice());
    Ok(by_channel(by_coefficients(&volumes, set.channels.len(), &set.grid, model, watch)?))
}

impl MaterialFile {
    /// [`predict`] by a model that takes the coefficients of the stack's resins and nothing else: without the slow
    /// simulations of [`MaterialFile::into_set`].
    ///
    /// # Errors
    /// As [`predict`]; [`OpticsError::Parameter`] for [`Model::KubelkaMunk`], whose parameters a file does not have
    /// yet.
    pub fn predict<M: Clone + Into<Mixture>>(
        &self,
        stack: &Stack<M>,
        model: &Model,
        watch: &dyn Watch,
    ) -> Result<Prediction, OpticsError> {
        let stack = stack.map(|medium| medium.clone().into());
        let volumes = stack.try_map(|mixture| self.mixed_volumes(mixture))?;
        let volumes = volumes.map(|volumes| volumes.as_slice());
        let grid = FrequencyGrid::default();
        let light = by_coefficients(&volumes, self.channels().len(), &grid, model, watch)?;
        Ok(Prediction { channels: self.channels().to_vec(), grid, light })
    }
}

/// Scalar Kubelka–Munk in one channel, of media with their refractive indices.
fn by_kubelka_munk(stack: &Stack<(Cow<'_, KubelkaMunk>, f64)>, grid: &FrequencyGrid) -> ChannelPrediction {
    let layers = stack.pairs().filter(|(_, mm)| *mm > 0.0);
    let media = layers.clone().map(|((_, index), _)| *index).chain(stack.core.as_ref().map(|(_, index)| *index));
    let surface = media.clone().next().map_or(Interface::NONE, |first| Interface::between(AIR, first));
    let mut above = None;
    let mut whole = surface.surface(grid.len());
    for ((resin, index), mm) in layers {
        let boundary = above.map_or(Interface::NONE, |above| Interface::between(above, *index));
        for part in [boundary.layer(grid.len()), Composite::from_slab(&resin.slab(mm))] {
            whole = whole.over(&part);
        }
        above = Some(*index);
    }
    let below = stack.core.as_ref().map_or(AIR, |(_, index)| *index);
    let whole = whole.over(&above.map_or(Interface::NONE, |above| Interface::between(above, below)).layer(grid.len()));
    let (reflection, transmission) = match &stack.core {
        None => (whole.reflection_top, whole.transmission),
        Some((core, _)) => (whole.reflection_over(&core.half_space()), vec![0.0; grid.len()]),
    };
    ChannelPrediction::from_spectra(reflection, transmission, grid).with_glint(surface.above)
}

/// Transport or photons, with resins given by their coefficients per channel.
fn by_coefficients(
    stack: &Stack<&[VolumeCoefficients]>,
    channels: usize,
    grid: &FrequencyGrid,
    model: &Model,
    watch: &dyn Watch,
) -> Result<Vec<ChannelPrediction>, OpticsError> {
    let in_channel = |channel: usize| stack.map(|resin| resin[channel]);
    match *model {
        Model::KubelkaMunk => {
            let expected = "one that takes coefficients".to_owned();
            Err(OpticsError::parameter("model", "Kubelka-Munk", expected))
        }
        Model::Transport { light, options } => {
            let predicted = (0..channels).map(|channel| {
                let stack = in_channel(channel);
                let model = Transport { stack: &stack, light, options };
                let spectra = model.spectra(grid);
                let predicted = ChannelPrediction::from_spectra(spectra.reflection, spectra.transmission, grid);
                predicted.with_glint(model.glint())
            });
            Ok(predicted.collect())
        }
        Model::MonteCarlo { light, photons, seed } => {
            let stage = Thousandths::begin(watch, "photons", photons.saturating_mul(channels as u64));
            let trace = |channel: usize| {
                let simulation = MonteCarlo {
                    stack: in_channel(channel),
                    light,
                    photons,
                    seed: seed.wrapping_add(channel as u64),
                    rings: RingEdges::growing(),
                };
                let result = simulation.run_with(&stage)?;
                let (reflection, transmission) = (result.reflection_profile, result.transmission_profile);
                let predicted = ChannelPrediction::from_profiles(reflection, transmission, grid);
                Ok(predicted.with_glint(result.glint.mean))
            };
            (0..channels).map(trace).collect()
        }
    }
}
