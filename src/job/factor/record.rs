//! `factored.json`: what was factored, how well, and what is measured and what fitted. A target is made of a few of its
//! fields, and a record that another program wrote may leave the others out.

use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use super::FactorRequest;
use crate::{
    appearance::bssrdf::{ClusterCount, Factors, Freedom, Misses, Rings},
    optics::OpticsError,
};

/// Name of the record in its folder.
pub const FACTORED: &str = "factored.json";
/// Version of the record's form; raised when readers must change.
pub const FACTORED_VERSION: u32 = 1;

/// A factored dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Factored {
    /// Program and version that wrote it.
    #[serde(default)]
    pub generator: String,
    /// [`FACTORED_VERSION`].
    pub version: u32,
    /// Distance between texels, mm.
    pub pitch_mm: f64,
    /// Texels per row.
    pub width: usize,
    /// Rows, the first on top.
    pub height: usize,
    /// Names.
    pub channels: Vec<String>,
    /// Columns and rows of the response windows.
    #[serde(default)]
    pub window: [usize; 2],
    /// Edges of the profiles' rings, mm, one more than rings.
    #[serde(default)]
    pub ring_edges_mm: Vec<f64>,
    /// The first so many rings were measured; those beyond are the fitted tail.
    #[serde(default)]
    pub window_rings: usize,
    /// What was asked for.
    #[serde(default)]
    pub settings: FactorSettings,
    /// Per channel.
    #[serde(default)]
    pub fits: Vec<ChannelFit>,
    /// Texels that were masked and have their nearest neighbour's profile.
    #[serde(default)]
    pub texels_without_data: usize,
    /// Root mean square error of R̂ by putting clusters in place of texels.
    #[serde(default)]
    pub cluster_rms: f64,
    /// In the order of the labels.
    pub clusters: Vec<ClusterRecord>,
}

impl Factored {
    /// Reads a record and checks what a target is made of.
    ///
    /// # Errors
    /// A file that is missing, of another form, or says what it may not.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let text = crate::regular_file::read_text(path)
            .map_err(|source| OpticsError::File { file: path.to_owned(), source })?;
        let record: Self = serde_json::from_slice(text.as_bytes()).map_err(|error| OpticsError::Entry {
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

/// A fault of the record.
pub(in crate::job) fn entry(file: &Path, element: &str, found: &str, expected: &str) -> OpticsError {
    let [element, found, expected] = [element, found, expected].map(String::from);
    OpticsError::Entry { file: file.to_owned(), line: None, element, found, expected }
}

/// What was asked for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FactorSettings {
    /// Clusters asked for; more than there are where texels are too much alike.
    pub clusters: usize,
    /// Bound that chose their number.
    pub max_rms: Option<f64>,
    /// Seed of the clusters.
    pub seed: u64,
    /// Weight of the albedo.
    pub dc_weight: f64,
    /// Expected second difference of ln P from ring to ring.
    pub roughness: f64,
    /// Three channels were read as one.
    pub luminance: bool,
}

impl FactorSettings {
    pub(super) fn new(request: &FactorRequest, clusters: usize) -> Self {
        Self {
            clusters,
            max_rms: match request.count {
                Some(ClusterCount::Within(bound)) => Some(bound),
                _ => None,
            },
            seed: request.seed,
            dc_weight: request.dc_weight,
            roughness: request.options.roughness,
            luminance: request.luminance,
        }
    }
}

/// A point of what all profiles have in common.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CommonProfile {
    /// Distance from the lit texel.
    pub r_mm: f64,
    /// g there.
    pub per_mm2: f64,
}

/// How well a channel is described.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelFit {
    /// Its name.
    pub channel: String,
    /// Whether the last round changed next to nothing.
    pub converged: bool,
    /// Rounds of the fit.
    pub rounds: Vec<RoundRecord>,
    /// √(Σ(D − R̂)² / ΣD²) of equation 7 over all pairs within the patch.
    pub relative_error: f64,
    /// The same without the lit texels themselves, where equation 7 is no more than P(x, 0).
    pub relative_error_beyond_centre: f64,
    /// The part of that which is noise, by the floor and gain of the dataset or the estimated floor.
    pub noise_beyond_centre: f64,
    /// √(Σ(D − D′)² / ½Σ(D² + D′²)) of pairs of texels a few pixels apart, D′ the other way; noise makes √2 times
    /// itself.
    #[serde(default)]
    pub reciprocity: Option<f64>,
    /// What all texels' profiles have in common: g at every distance that occurs in a window. P/g of a texel lies
    /// between its rings on straight lines of ln(P/g) over r.
    #[serde(default)]
    pub common: Vec<CommonProfile>,
    /// What makes the data hard to believe.
    #[serde(default)]
    pub doubts: Vec<String>,
    /// The errors of simpler models, if asked for.
    pub simpler: Vec<Simpler>,
    /// Standard deviation of the measurements where there is no light, per mm²: the dataset's, or estimated.
    pub noise_floor_per_mm2: f64,
    /// What equation 7 itself misses, as a share of R.
    pub model_error: f64,
    /// Values missing in windows that should be there.
    pub missing_values: u64,
    /// By ring.
    pub by_ring: Vec<RingResidual>,
    /// The light beyond the window.
    pub tail: TailRecord,
}

/// A round of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundRecord {
    /// Steps of conjugate gradients.
    pub steps: usize,
    /// Root mean square change of ln P.
    pub change: f64,
    /// √(Σ(D − R̂)² / ΣD²) before it.
    pub relative_error: f64,
}

/// A simpler model than equation 7.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Simpler {
    /// `global` or `scaled`.
    pub model: String,
    /// √(Σ(D − R̂)² / ΣD²).
    pub relative_error: f64,
    /// Without the lit texels themselves.
    pub relative_error_beyond_centre: f64,
}

/// What is missed in a ring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RingResidual {
    /// Edges of the ring, mm.
    pub r_lo_mm: f64,
    /// Its outer one.
    pub r_hi_mm: f64,
    /// Measurements within the patch.
    pub measurements: u64,
    /// √(Σ(D − R̂)² / ΣD²).
    pub relative_error: f64,
    /// Σ(D − R̂) / ΣR̂.
    pub bias: f64,
}

/// The light beyond the window, texels counted by how their tail came about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TailRecord {
    /// Where the window ends, mm.
    pub from_mm: f64,
    /// Fitted to the albedo.
    pub fitted: usize,
    /// Fitted, with another slope than the window's: the albedo leaves more than the slope allows.
    pub stretched: usize,
    /// Albedo unknown: continued by slope.
    pub continued: usize,
    /// The window holds all of the albedo.
    pub none: usize,
    /// Mean over texels.
    pub mean_energy_in_window: f64,
    /// Mean over texels.
    pub mean_energy_in_tail: f64,
    /// Mean over texels of what tails by slope alone would hold.
    #[serde(default)]
    pub mean_energy_continued: f64,
    /// Root mean square difference of the light that leaves within the window and the measured albedo.
    pub albedo_rms_error_without: Option<f64>,
    /// With a tail by slope alone, as where no albedo is known.
    pub albedo_rms_error_continued: Option<f64>,
    /// With the tail.
    pub albedo_rms_error_with: Option<f64>,
}

/// Albedos that leave this many times as much beyond the window as its slope does…
const BEYOND_SLOPE: f64 = 3.0;
/// …and this share of all light more, are doubted.
const BEYOND_SHARE: f64 = 0.1;

impl TailRecord {
    /// Whether the albedo and the windows are of one sample.
    fn doubt(&self) -> Option<String> {
        let (tail, continued) = (self.mean_energy_in_tail, self.mean_energy_continued);
        let all = self.mean_energy_in_window + tail;
        let known = self.fitted + self.stretched > 0;
        let apart = tail > BEYOND_SLOPE * continued && tail - continued > BEYOND_SHARE * all;
        (known && apart).then(|| {
            format!(
                "the albedo puts {:.1}% of the light beyond the windows, their slope {:.1}%: is the albedo that of \
                 this sample, are values per mm², and is the pitch right?",
                100.0 * tail / all,
                100.0 * continued / all
            )
        })
    }
}

/// A cluster.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClusterRecord {
    /// Share of the texels.
    #[serde(default)]
    pub share: f64,
    /// Albedo per channel.
    #[serde(default)]
    pub albedo: Vec<f64>,
    /// Radius inside which half of the light leaves, mm, per channel.
    #[serde(default)]
    pub half_energy_radius_mm: Vec<Option<f64>>,
    /// Root mean square error of R̂ over its texels.
    #[serde(default)]
    pub rms: f64,
    /// That of the texel it describes worst.
    #[serde(default)]
    pub worst: f64,
    /// Profile CSV per channel.
    pub profiles: Vec<String>,
}

impl ChannelFit {
    pub(super) fn new(
        channel: &str,
        factors: &Factors,
        rings: &Rings,
        tail: TailRecord,
        simpler: &[(Freedom, Misses)],
    ) -> Self {
        let name = |freedom| if freedom == Freedom::Global { "global" } else { "scaled" };
        let last = factors.rounds.last();
        let by_ring = factors.misses.rings.iter().zip(rings.edges_mm.windows(2)).map(|(sums, edge)| RingResidual {
            r_lo_mm: edge[0],
            r_hi_mm: edge[1],
            measurements: sums.count as u64,
            relative_error: if sums.data > 0.0 { (sums.error / sums.data).sqrt() } else { 0.0 },
            bias: if sums.model > 0.0 { sums.bias / sums.model } else { 0.0 },
        });
        Self {
            channel: channel.to_owned(),
            converged: factors.converged,
            rounds: factors
                .rounds
                .iter()
                .map(|round| RoundRecord {
                    steps: round.steps,
                    change: round.change,
                    relative_error: round.relative_error,
                })
                .collect(),
            relative_error: factors.misses.relative(),
            relative_error_beyond_centre: factors.misses.relative_beyond_centre(),
            noise_beyond_centre: factors.misses.noise_beyond_centre(factors.variance),
            reciprocity: Some(factors.reciprocity.relative).filter(|relative| relative.is_finite()),
            common: (rings.distances_mm.iter().zip(&factors.global))
                .map(|(r, g)| CommonProfile { r_mm: *r, per_mm2: f64::from(*g) })
                .collect(),
            doubts: factors.doubts.iter().cloned().chain(tail.doubt()).collect(),
            simpler: simpler
                .iter()
                .map(|(freedom, misses)| Simpler {
                    model: name(*freedom).into(),
                    relative_error: misses.relative(),
                    relative_error_beyond_centre: misses.relative_beyond_centre(),
                })
                .collect(),
            noise_floor_per_mm2: last.map_or(0.0, |round| round.floor_per_mm2),
            model_error: last.map_or(0.0, |round| round.relative),
            missing_values: factors.missing,
            by_ring: by_ring.collect(),
            tail,
        }
    }
}

impl ChannelFit {
    /// Noise of the measurement as a share of the light beyond the lit texel: by floor and gain, or by how far light is
    /// from going both ways alike, whichever is more. A noise that grows with the light shows in the second only.
    pub fn noise(&self) -> f64 {
        let both_ways = self.reciprocity.map_or(0.0, |both| both / std::f64::consts::SQRT_2);
        self.noise_beyond_centre.max(both_ways)
    }
}
