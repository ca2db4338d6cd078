//! The synthetic resins, and a stack of them in all three models.

use lumislice::{
    optics::{
        KubelkaMunk, Light, MaterialSet, OpticsError, PhotonOptions, Prediction, TransportOptions, VolumeCoefficients,
    },
    search::{ResinLimit, SearchOptions, Stacking},
    watch::Unwatched,
};

/// Layers by the names of their resins, top first, mm.
pub type Stack<'a> = &'a [(&'a str, f64)];

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

    pub fn index(&self, name: &str) -> usize {
        self.set.resin(name).map(|(index, _)| index).unwrap_or_else(|| panic!("the set has no {name}"))
    }

    pub fn parameters(&self) -> Vec<Vec<KubelkaMunk>> {
        self.set.resins.iter().map(|resin| resin.kubelka_munk.clone()).collect()
    }

    pub fn volumes(&self) -> Vec<Vec<VolumeCoefficients>> {
        self.set.resins.iter().filter_map(|resin| resin.volume.clone()).collect()
    }

    /// The paper's search over black, support at least 0.2 mm deep.
    pub fn options(&self) -> SearchOptions {
        let limit =
            |name: &str| ResinLimit { min_depth_mm: if name == "support" { 0.2 } else { 0.0 }, ..ResinLimit::NONE };
        let limits = self.set.resins.iter().map(|resin| limit(&resin.name)).collect();
        SearchOptions { core: Some(self.index("black")), limits, ..SearchOptions::default() }
    }

    pub fn named(&self, stacking: &Stacking) -> String {
        let layers = stacking.layers.iter();
        let layers = layers.map(|layer| format!("{} {:.3}", self.set.resins[layer.resin].name, layer.thickness_mm));
        layers.collect::<Vec<_>>().join(", ")
    }

    pub fn by_km(&self, layers: &[(usize, f64)], core: Option<usize>) -> Prediction {
        Prediction::kubelka_munk(&self.set, layers, core)
    }

    pub fn by_transport(&self, layers: &[(usize, f64)], core: Option<usize>) -> Prediction {
        let volumes = self.volumes();
        let layers: Vec<_> = layers.iter().map(|&(resin, mm)| (volumes[resin].as_slice(), mm)).collect();
        let core = core.map(|core| volumes[core].as_slice());
        Prediction::transport(&self.set.channels, &layers, core, Light::Diffuse, TransportOptions::default())
    }

    pub fn by_photons(
        &self,
        layers: &[(usize, f64)],
        core: Option<usize>,
        photons: u64,
    ) -> Result<Prediction, OpticsError> {
        let volumes = self.volumes();
        let layers: Vec<_> = layers.iter().map(|&(resin, mm)| (volumes[resin].as_slice(), mm)).collect();
        let core = core.map(|core| volumes[core].as_slice());
        let options = PhotonOptions { light: Light::Diffuse, photons, seed: 5 };
        Prediction::monte_carlo(&self.set.channels, &layers, core, options, &Unwatched)
    }

    pub fn predict(&self, stack: Stack, photons: u64) -> Result<Predicted, OpticsError> {
        let layers: Vec<_> = stack.iter().map(|&(name, mm)| (self.index(name), mm)).collect();
        Ok(Predicted {
            km: self.by_km(&layers, None),
            transport: self.by_transport(&layers, None),
            photons: self.by_photons(&layers, None, photons)?,
        })
    }
}

/// Root mean square difference of two spectra.
pub fn rms(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt()
}
