//! What looks and rounds of correction found, as manifests and files have it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::output::GENERATOR;
use crate::regular_file;
use crate::watch::Watch;

/// A look in a few numbers, as the manifest has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LookSummary {
    /// Spots that see enough of the sky, which the numbers below are of.
    pub spots: usize,
    /// Spots left out, for they hardly see the sky ([`SpotRecord::is_lit`]).
    #[serde(default)]
    pub unlit: usize,
    /// Walks for each spot and channel.
    pub walks: u64,
    /// Printed against asked, in each channel; `None` where nothing was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against_asked: Option<Vec<Fit>>,
    /// Printed against predicted, in each channel.
    pub against_predicted: Vec<Fit>,
    /// Where colours were asked for: their differences.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_e_2000: Option<Differences>,
    /// How far single spots are from what was asked for, as shares of that; `None` where nothing was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative: Option<Spread>,
    /// The spots that are farthest from what was asked for (or predicted), the worst first.
    pub worst: Vec<SpotRecord>,
}

/// How far printed albedos are from what they should be, over all spots.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Mean of printed less expected.
    pub bias: f64,
    /// Root mean square of printed less expected, the noise of the walks taken off.
    pub rms: f64,
    /// That over the root mean square of what is expected.
    pub relative_rms: f64,
}

/// How far printed colours are from what they should be, ΔE2000 (CIE 142:2001; an albedo of 1 is white): noise is in
/// them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Differences {
    /// Half of the spots are nearer.
    pub median: f64,
    /// Nine tenths of the spots are nearer.
    pub ninety_percent: f64,
    /// 95% of the spots are nearer; `None` in what was written before this was told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ninety_five_percent: Option<f64>,
    /// The largest.
    pub worst: f64,
}

/// How far printed albedos are from what was asked for at single spots: |printed − asked| over |asked|, of all channels
/// together; noise is in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Half of the spots are nearer.
    pub median: f64,
    /// 95% of the spots are nearer.
    pub ninety_five_percent: f64,
}

/// A shadow's edge at a spot, by channel and distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EdgeRecord {
    /// Unit vector along the surface into the light, in the lattice's frame.
    pub into_the_light: [f64; 3],
    /// Radiosity per irradiance that is asked for, as a flat sheet of the target's profile has it; `None` where a
    /// stacking was given.
    pub asked: Option<Vec<Vec<f64>>>,
    /// That of the print.
    pub printed: Vec<Vec<f64>>,
    /// One standard deviation of it.
    pub standard_error: Vec<Vec<f64>>,
}

/// One spot. Albedos are per channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpotRecord {
    /// Index of its object.
    pub object: usize,
    /// Its middle, mm in the lattice's frame.
    pub position_mm: [f64; 3],
    /// Outward unit normal there.
    pub normal: [f64; 3],
    /// What is asked for; `None` where a stacking was given, or where that is not known.
    pub asked: Option<Vec<f64>>,
    /// What was predicted for an endless flat slab; empty where that is not known.
    pub predicted: Vec<f64>,
    /// Share of the sky that it sees, 0 to 1: in a hollow print is held against what a surface of that albedo would
    /// show among its like, see [`against_asked`](super::look::Look::against_asked).
    #[serde(default = "whole_sky")]
    pub sky: f64,
    /// Radiosity per irradiance of the print, under even light.
    pub printed: Vec<f64>,
    /// One standard deviation of it.
    pub standard_error: Vec<f64>,
    /// Printed against asked as ΔE2000, less what noise adds on average, where colours were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_e_2000: Option<f64>,
    /// What shows by a shadow's edge, at the distances of [`edge_mm`](super::look::Look::edge_mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<EdgeRecord>,
}

pub(super) fn whole_sky() -> f64 {
    1.0
}

/// Name of the file that holds what rounds of correction found.
pub const ROUNDS: &str = "rounds.json";
/// Version of its form.
const ROUNDS_VERSION: u32 = 1;
/// Longest file that is read, bytes: some numbers for each of 20,000 points.
const MAX_BYTES: u64 = 16 << 20;

/// What rounds of correction found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rounds {
    /// Program and version.
    pub generator: String,
    /// Version of the file's form.
    pub version: u32,
    /// Digest of the job, its inputs and its stackings as they were before.
    pub sha256: String,
    /// The rounds, in order.
    pub rounds: Vec<RoundRecord>,
    /// What was found for each object that can be corrected.
    pub objects: Vec<ObjectCorrection>,
}

/// How far the print was from what was asked for when a round looked at it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundRecord {
    /// Points of the surface that were looked at.
    pub points: usize,
    /// Walks for each point and channel.
    pub walks: u64,
    /// Printed against asked in each channel, at spots of 0.25 mm around the points. In this and in `worst` points that
    /// see less than 0.3 of the sky count less, down to nothing.
    pub fit: Vec<Fit>,
    /// Greatest difference of ln albedo over any channel, of means over some mm².
    pub worst: f64,
    /// Share of the points where what should be corrected is out of reach of the resins.
    pub out_of_reach: f64,
    /// Why no round followed, where the job asked for more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<Ended>,
}

impl RoundRecord {
    /// Tells it as the `number`th of so many rounds at most, from 1.
    pub(super) fn tell(&self, number: u32, of: u32, watch: &dyn Watch) {
        if let Ok(serde_json::Value::Object(record)) = serde_json::to_value(self) {
            let named = [("round", number), ("of", of)].map(|(key, value)| (key.to_owned(), value.into()));
            watch.found("round", named.into_iter().chain(record).collect());
        }
    }
}

/// Why rounds of correction ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// What the print misses is less than noise lets a round see.
    NothingLeft,
    /// What is left is out of reach of the resins.
    OutOfReach,
    /// The round before brought the print no nearer, beyond noise.
    NoBetter,
    /// The round before brought the print farther off, beyond noise: what had been laid before it is laid again.
    Worse,
}

impl Ended {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::NothingLeft => "no further round: what is left to correct is below the noise",
            Self::OutOfReach => "no further round: what is left is out of reach of the resins",
            Self::NoBetter => "no further round: this one found the print no nearer than the one before, beyond noise",
            Self::Worse => "no further round: this one found the print farther off, and what lay before is laid again",
        }
    }
}

/// The factors of an object's albedo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectCorrection {
    /// Index of the object.
    pub object: usize,
    /// Thousandths of the logarithm of the factor at every point of its surface, by channel; one list where all
    /// channels have the same.
    pub ln_factor_thousandths: Vec<Vec<i32>>,
}

impl Rounds {
    pub(in crate::job) fn new(sha256: String, rounds: Vec<RoundRecord>, objects: Vec<ObjectCorrection>) -> Self {
        Self { generator: GENERATOR.to_owned(), version: ROUNDS_VERSION, sha256, rounds, objects }
    }

    /// What an earlier run of the job with that digest left in `folder`, if any did and it can be read.
    pub(in crate::job) fn read(folder: &Path, sha256: &str) -> Option<Self> {
        let path = folder.join(ROUNDS);
        let whole = path.symlink_metadata().ok().filter(|it| it.is_file() && it.len() <= MAX_BYTES)?;
        let bytes = regular_file::read(&path, MAX_BYTES).ok().filter(|bytes| bytes.len() as u64 == whole.len())?;
        let found: Self = serde_json::from_slice(&bytes).ok()?;
        let same = found.generator == GENERATOR && found.version == ROUNDS_VERSION && found.sha256 == sha256;
        same.then_some(found)
    }
}
