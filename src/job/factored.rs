//! What `lumislice factor` wrote, as a target: a profile for each cluster, and the cluster of each texel.

use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::{FACTORED, FACTORED_VERSION, LABELS, RunError, images::read_labels};
use crate::{
    optics::{FrequencyGrid, OpticsError, ProfileFile, RadialProfile},
    target::bssrdf::LUMINANCE,
};

/// What of the record a job needs.
#[derive(Debug, Deserialize)]
struct Record {
    version: u32,
    pitch_mm: f64,
    width: u32,
    height: u32,
    channels: Vec<String>,
    #[serde(default)]
    ring_edges_mm: Vec<f64>,
    clusters: Vec<Cluster>,
}

#[derive(Debug, Deserialize)]
struct Cluster {
    /// Paths in the folder, one per channel.
    profiles: Vec<String>,
}

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
    pub labels: Vec<u16>,
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
        let record = Record::read(&folder.join(FACTORED))?;
        let profiles = record.clusters.into_iter().flat_map(|cluster| cluster.profiles);
        Ok([FACTORED, LABELS].map(String::from).into_iter().chain(profiles).collect())
    }

    /// Reads the folder.
    ///
    /// # Errors
    /// A file that is missing or damaged, or that does not fit the record.
    pub fn read(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(FACTORED);
        let record = Record::read(&path)?;
        let labels_path = folder.join(LABELS);
        let (width, height, labels) = read_labels(&labels_path)?;
        let fault = |found: String, expected| RunError::Texture { path: labels_path.clone(), found, expected };
        if (width, height) != (record.width, record.height) {
            let found = format!("{width} × {height} texels, not {} × {}", record.width, record.height);
            return Err(fault(found, "as many as factored.json says"));
        }
        let clusters = record.clusters.len();
        if let Some(odd) = labels.iter().find(|&&label| usize::from(label) >= clusters) {
            return Err(fault(format!("label {odd} with {clusters} clusters"), "labels from 0 to one less"));
        }
        let profile = |name: &String| -> Result<RadialProfile, RunError> {
            let file = folder.join(name);
            ProfileFile::read(&file)?.reflection.ok_or_else(|| {
                let (element, found, expected) = ("header", "no reflection_per_mm2", "that column");
                entry(&file, element, found, expected)
            })
        };
        let profiles = record.clusters.iter().map(|cluster| cluster.profiles.iter().map(profile).collect());
        let profiles = profiles.collect::<Result<_, _>>()?;
        let Record { pitch_mm, channels, ring_edges_mm, .. } = record;
        Ok(Self { pitch_mm, ring_edges_mm, width, height, channels, labels, profiles, record: path })
    }

    /// Hankel transforms by cluster and channel of `channels`, over `grid`: one channel serves all, three serve one by their luminance.
    ///
    /// # Errors
    /// Numbers of channels that are neither alike nor of these.
    pub fn spectra(&self, channels: &[String], grid: &FrequencyGrid) -> Result<Vec<Vec<Vec<f64>>>, RunError> {
        let (held, wanted) = (self.channels.len(), channels.len());
        if held != 1 && held != wanted && (held, wanted) != (3, 1) {
            let found = format!("{held} channels for resins with {wanted}");
            return Err(entry(&self.record, "channels", &found, "one, as many as the resins have, or three for one"));
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

impl Record {
    fn read(path: &Path) -> Result<Self, RunError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| OpticsError::File { file: path.to_owned(), source })?;
        let record: Self = serde_json::from_str(&text).map_err(|error| OpticsError::Entry {
            file: path.to_owned(),
            line: Some(error.line()),
            element: "record".into(),
            found: error.to_string(),
            expected: "what `lumislice factor` writes".into(),
        })?;
        let refuse = |element: &str, found: String, expected: &str| Err(entry(path, element, &found, expected));
        if record.version != FACTORED_VERSION {
            return refuse("version", record.version.to_string(), "1");
        }
        if !(record.pitch_mm > 0.0 && record.pitch_mm.is_finite()) {
            return refuse("pitch_mm", record.pitch_mm.to_string(), "finite millimetres above 0");
        }
        let channels = record.channels.len();
        if channels == 0 || record.clusters.is_empty() || record.clusters.len() > usize::from(u16::MAX) {
            let found = format!("{channels} channels, {} clusters", record.clusters.len());
            return refuse("clusters", found, "at least one channel and 1 to 65535 clusters");
        }
        for (index, cluster) in record.clusters.iter().enumerate() {
            let place = || format!("clusters[{index}].profiles");
            if cluster.profiles.len() != channels {
                return refuse(&place(), format!("{} paths", cluster.profiles.len()), "one for each channel");
            }
            let inside = |path: &&String| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
            if let Some(odd) = cluster.profiles.iter().find(|path| !inside(path)) {
                return refuse(&place(), format!("`{odd}`"), "the path of a file in the folder");
            }
        }
        Ok(record)
    }
}

fn entry(file: &Path, element: &str, found: &str, expected: &str) -> RunError {
    let [element, found, expected] = [element, found, expected].map(String::from);
    OpticsError::Entry { file: file.to_owned(), line: None, element, found, expected }.into()
}
