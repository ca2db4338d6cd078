//! What `lumislice factor` wrote, as a target: a profile for each cluster, and the cluster of each texel.

use std::path::{Path, PathBuf};

use super::images::read_labels;
use crate::job::{
    RunError,
    factor::entry,
    factor::{FACTORED, Factored, LABELS},
};
use crate::{
    appearance::ClusterId,
    colour::LUMINANCE,
    optics::{FrequencyGrid, ProfileFile, RadialProfile},
};

/// A factored dataset.
#[derive(Debug)]
pub struct FactoredMap {
    /// Distance between texels, mm.
    pub pitch_mm: f64,
    /// Texels per row.
    pub width: u32,
    /// Rows, the first at the largest y.
    pub height: u32,
    /// Names of the profiles' channels.
    pub channels: Vec<String>,
    /// Edges of the rings of the texels' own profiles, if they were kept.
    pub ring_edges_mm: Vec<f64>,
    /// Cluster of every texel, row by row.
    pub labels: Vec<ClusterId>,
    /// Profile of each cluster and channel.
    pub profiles: Vec<Vec<RadialProfile>>,
    record: PathBuf,
}

impl FactoredMap {
    /// Paths in `folder` of the files that a target is made of.
    ///
    /// # Errors
    /// A record that is missing or says what it may not.
    pub fn files(folder: &Path) -> Result<Vec<String>, RunError> {
        let record = Factored::read(&folder.join(FACTORED))?;
        let profiles = record.clusters.into_iter().flat_map(|cluster| cluster.profiles);
        Ok([FACTORED, LABELS].map(String::from).into_iter().chain(profiles).collect())
    }

    /// Reads the folder.
    ///
    /// # Errors
    /// A file that is missing or damaged, or that does not fit the record.
    pub fn read(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(FACTORED);
        let record = Factored::read(&path)?;
        let labels_path = folder.join(LABELS);
        let (width, height, labels) = read_labels(&labels_path)?;
        let fault = |found: String, expected| RunError::Texture { path: labels_path.clone(), found, expected };
        if [width, height].map(|texels| texels as usize) != [record.width, record.height] {
            let found = format!("{width} × {height} texels, not {} × {}", record.width, record.height);
            return Err(fault(found, "as many as factored.json says"));
        }
        let clusters = record.clusters.len();
        if let Some(odd) = labels.iter().find(|label| label.index() >= clusters) {
            return Err(fault(format!("label {} with {clusters} clusters", odd.0), "labels from 0 to one less"));
        }
        let profile = |name: &String| -> Result<RadialProfile, RunError> {
            let file = folder.join(name);
            ProfileFile::read(&file)?.reflection.ok_or_else(|| {
                let (element, found, expected) = ("header", "no reflection_per_mm2", "that column");
                entry(&file, element, found, expected).into()
            })
        };
        let profiles = record.clusters.iter().map(|cluster| cluster.profiles.iter().map(profile).collect());
        let profiles = profiles.collect::<Result<_, _>>()?;
        let Factored { pitch_mm, channels, ring_edges_mm, .. } = record;
        Ok(Self { pitch_mm, ring_edges_mm, width, height, channels, labels, profiles, record: path })
    }

    /// Hankel transforms by cluster and channel of `channels`, over `grid`: one channel serves all, three serve one by
    /// their luminance.
    ///
    /// # Errors
    /// Numbers of channels that are neither alike nor of these.
    pub fn spectra(&self, channels: &[String], grid: &FrequencyGrid) -> Result<Vec<Vec<Vec<f64>>>, RunError> {
        let (held, wanted) = (self.channels.len(), channels.len());
        if held != 1 && held != wanted && (held, wanted) != (3, 1) {
            let found = format!("{held} channels for resins with {wanted}");
            return Err(
                entry(&self.record, "channels", &found, "one, as many as the resins have, or three for one").into()
            );
        }
        let of_cluster = |profiles: &Vec<RadialProfile>| {
            let mut spectra: Vec<_> = profiles.iter().map(|profile| profile.hankel(grid).values).collect();
            if (held, wanted) == (3, 1) {
                let weighted = |i| spectra.iter().zip(LUMINANCE).map(|(spectrum, weight)| weight * spectrum[i]).sum();
                spectra = vec![(0..grid.len()).map(weighted).collect()];
            }
            spectra.resize(wanted, spectra[0].clone());
            spectra
        };
        Ok(self.profiles.iter().map(of_cluster).collect())
    }
}
