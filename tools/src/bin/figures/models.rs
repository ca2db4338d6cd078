//! The synthetic resins, and a stack of them in all three models.

use std::ops::ControlFlow;

use lumislice::{
    optics::{
        KubelkaMunk, Light, MaterialSet, OpticsError, PhotonOptions, Prediction, Resin, ResinId, Stack,
        TransportOptions, VolumeCoefficients,
    },
    search::{ResinLimit, SearchOptions},
};

/// Layers by the names of their resins, top first, mm.
pub type Layers<'a> = &'a [(&'a str, f64)];

/// A stack in all models.
pub struct Predicted {
    pub km: Prediction,
    pub transport: Prediction,
    pub photons: Prediction,
}

/// The built-in set.
pub struct Resins {
    pub set: MaterialSet,
}

impl Resins {
    pub fn synthetic() -> Result<Self, OpticsError> {
        Ok(Self { set: MaterialSet::builtin("synthetic")? })
    }

    pub fn id(&self, name: &str) -> ResinId {
        self.set.resin(name).map(|(id, _)| id).unwrap_or_else(|| panic!("the set has no {name}"))
    }

    pub fn parameters(&self) -> Vec<Vec<KubelkaMunk>> {
        let channels = |resin: &Resin| resin.channels.iter().map(|channel| channel.kubelka_munk.clone()).collect();
        self.set.resins.iter().map(channels).collect()
    }

    pub fn volumes(&self) -> Vec<Vec<VolumeCoefficients>> {
        self.set.resins.iter().filter_map(Resin::volumes).collect()
    }

    /// The paper's search over black, support at least 0.2 mm deep.
    pub fn options(&self) -> SearchOptions {
        let limit =
            |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
        let limits = self.set.resins.iter().map(|resin| limit(&resin.name)).collect();
        SearchOptions { core: Some(self.id("black")), limits, ..SearchOptions::default() }
    }

    pub fn named(&self, stacking: &Stack) -> String {
        let layers = stacking.pairs().map(|(&resin, mm)| format!("{} {mm:.3}", self.set[resin].name));
        layers.collect::<Vec<_>>().join(", ")
    }

    /// The set's resins in layers over nothing.
    pub fn stack(&self, layers: Layers) -> Stack {
        Stack::new(layers.iter().map(|&(name, mm)| (self.id(name), mm)))
    }

    fn coefficients(&self, stack: &Stack) -> Stack<Vec<VolumeCoefficients>> {
        let volumes = self.volumes();
        stack.map(|resin| volumes[resin.0].clone())
    }

    pub fn by_transport(&self, stack: &Stack) -> Prediction {
        let stack = self.coefficients(stack);
        let stack = stack.map(|resin| resin.as_slice());
        Prediction::transport(&self.set.channels, &stack, Light::Diffuse, TransportOptions::default())
    }

    pub fn by_photons(&self, stack: &Stack, photons: u64) -> Result<Prediction, OpticsError> {
        let stack = self.coefficients(stack);
        let stack = stack.map(|resin| resin.as_slice());
        let options = PhotonOptions { light: Light::Diffuse, photons, seed: 5 };
        Prediction::monte_carlo(&self.set.channels, &stack, options, |_| ControlFlow::Continue(()))
    }

    pub fn predict(&self, layers: Layers, photons: u64) -> Result<Predicted, OpticsError> {
        let stack = self.stack(layers);
        Ok(Predicted {
            km: Prediction::kubelka_munk(&self.set, &stack),
            transport: self.by_transport(&stack),
            photons: self.by_photons(&stack, photons)?,
        })
    }
}

/// Root mean square difference of two spectra.
pub fn rms(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt()
}
