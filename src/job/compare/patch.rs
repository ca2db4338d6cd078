//! The patch as it was measured, factored and clustered, and its light.

use std::path::Path;

use super::{CompareError, dataset, texels};
use crate::{
    appearance::{
        LocalProfiles, TexelRings,
        bssrdf::{Channel, Dataset},
    },
    colour::LUMINANCE,
    job::plan::FactoredMap,
    optics::FrequencyGrid,
};

/// The map and what is needed to carry light over it.
pub(super) struct Patch {
    pub map: FactoredMap,
    rings: TexelRings,
    labels: Vec<u32>,
    pub grid: FrequencyGrid,
    /// Hankel transforms `[cluster][channel]`, not scaled.
    pub spectra: Vec<Vec<Vec<f64>>>,
    irradiances: Vec<Vec<f32>>,
}

impl Patch {
    /// With light by the profiles of `channels` under each of `irradiances`.
    pub fn new(map: FactoredMap, channels: &[String], irradiances: Vec<Vec<f32>>) -> Result<Self, CompareError> {
        let grid = FrequencyGrid::default();
        let spectra = map.spectra(channels, &grid)?;
        let rings = TexelRings::holding(map.pitch_mm, spectra.iter().flatten(), &grid);
        let labels = map.labels.iter().map(|label| u32::from(label.0)).collect();
        Ok(Self { map, rings, labels, grid, spectra, irradiances })
    }

    /// Light by equation 7 where each cluster has the profile of its spectrum.
    pub fn radiosity(&self, spectra: &[Vec<f64>]) -> Vec<Vec<f32>> {
        let (labels, width) = (self.labels.clone(), self.map.width as usize);
        LocalProfiles::from_spectra(&self.rings, spectra, &self.grid, labels, width).radiosity(&self.irradiances)
    }

    /// Light by the 4D data, per channel of the resins.
    pub fn original(&self, path: &Path, wanted: usize) -> Result<Vec<Vec<Vec<f32>>>, CompareError> {
        let stored = Dataset::open(path, false)?;
        // As the map was factored, or as its three channels serve one.
        let luminance = wanted == 1 && stored.channels.len() == 3;
        let dataset = if luminance { Dataset::open(path, true)? } else { stored };
        if (dataset.width, dataset.height) != (self.map.width as usize, self.map.height as usize) {
            let found = format!("{} × {} texels", dataset.width, dataset.height);
            return Err(CompareError::OtherPatch { path: path.to_owned(), found });
        }
        if (dataset.pitch_mm / self.map.pitch_mm - 1.0).abs() > 1e-6 {
            let found = format!("texels of {} mm where the map has {} mm", dataset.pitch_mm, self.map.pitch_mm);
            return Err(CompareError::OtherPatch { path: path.to_owned(), found });
        }
        let held = if luminance { 1 } else { dataset.channels.len() };
        let channel = |c: usize| match (luminance, held) {
            (true, _) => (Channel::Luminance, 0),
            (false, held) => (Channel::Stored(c.min(held - 1)), c.min(held - 1)),
        };
        (0..wanted).map(|c| dataset::radiosity(&dataset, channel(c).0, channel(c).1, &self.irradiances)).collect()
    }

    /// Light by the profile of each texel; `None` where they were not kept.
    pub fn factored(&self, folder: &Path, wanted: usize) -> Result<Option<Vec<Vec<Vec<f32>>>>, CompareError> {
        let path = folder.join("profiles.npy");
        let (map, held) = (&self.map, self.map.channels.len());
        if !path.exists() || map.ring_edges_mm.is_empty() {
            return Ok(None);
        }
        let (width, height) = (map.width as usize, map.height as usize);
        let channel = |c: usize| -> Result<Vec<Vec<f32>>, CompareError> {
            let mut weights = vec![0.0; held];
            if held == 3 && wanted == 1 {
                weights = LUMINANCE.to_vec();
            } else {
                weights[c.min(held - 1)] = 1.0;
            }
            let (within, albedo) =
                texels::within(&path, [height, width, held], &map.ring_edges_mm, &self.rings, &weights)?;
            let own = (0..width * height).map(|texel| texel as u32).collect();
            Ok(LocalProfiles::new(&self.rings, &within, &albedo, own, width).radiosity(&self.irradiances))
        };
        (0..wanted).map(channel).collect::<Result<Vec<_>, _>>().map(Some)
    }
}
