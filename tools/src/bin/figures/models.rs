//! The synthetic resins, and a stack of them in all three models.

use lumislice::{
    optics::{Light, MaterialSet, Mixture, Model, OpticsError, Prediction, ResinId, Stack, TransportOptions, predict},
    search::{Judge, MatchOptions, ResinLimit, SearchOptions},
    watch::Unwatched,
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

    /// The paper's search over black, support at least 0.2 mm deep, refined by transport.
    pub fn options(&self) -> MatchOptions {
        let limit =
            |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
        let limits = self.set.resins.iter().map(|resin| limit(&resin.name)).collect();
        let search = SearchOptions { core: Some(self.id("black")), limits, ..SearchOptions::default() };
        MatchOptions { search, judge: Judge::Transport, ..MatchOptions::default() }
    }

    pub fn named(&self, stacking: &Stack<Mixture>) -> String {
        let named = self.set.named(stacking);
        named.pairs().map(|(name, mm)| format!("{name} {mm:.3}")).collect::<Vec<_>>().join(", ")
    }

    /// The set's resins in layers over nothing.
    pub fn stack(&self, layers: Layers) -> Stack {
        Stack::new(layers.iter().map(|&(name, mm)| (self.id(name), mm)))
    }

    pub fn by_transport<M: Clone + Into<Mixture>>(&self, stack: &Stack<M>) -> Result<Prediction, OpticsError> {
        let model = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
        predict(&self.set, stack, &model, &Unwatched)
    }

    pub fn by_photons<M: Clone + Into<Mixture>>(
        &self,
        stack: &Stack<M>,
        photons: u64,
    ) -> Result<Prediction, OpticsError> {
        let model = Model::MonteCarlo { light: Light::Diffuse, photons, seed: 5 };
        predict(&self.set, stack, &model, &Unwatched)
    }

    pub fn predict(&self, layers: Layers, photons: u64) -> Result<Predicted, OpticsError> {
        let stack = self.stack(layers);
        Ok(Predicted {
            km: predict(&self.set, &stack, &Model::KubelkaMunk, &Unwatched)?,
            transport: self.by_transport(&stack)?,
            photons: self.by_photons(&stack, photons)?,
        })
    }
}

/// Root mean square difference of two spectra.
pub fn rms(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt()
}
