//! What rounds of correction found, as a file has it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{job::look::Fit, output::GENERATOR};

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
    /// Printed against asked in each channel, at spots of 0.25 mm around the points.
    pub fit: Vec<Fit>,
    /// Greatest difference of ln albedo over any channel, of means over some mm².
    pub worst: f64,
    /// Share of the points where what should be corrected is out of reach of the resins.
    pub out_of_reach: f64,
}

/// The factors of an object's albedo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectCorrection {
    /// Index of the object.
    pub object: usize,
    /// Thousandths of the logarithm of the factor at every point of its surface, by channel; one list where all channels
    /// have the same.
    pub ln_factor_thousandths: Vec<Vec<i32>>,
}

impl Rounds {
    pub(super) fn new(sha256: String, rounds: Vec<RoundRecord>, objects: Vec<ObjectCorrection>) -> Self {
        Self { generator: GENERATOR.to_owned(), version: ROUNDS_VERSION, sha256, rounds, objects }
    }

    /// What an earlier run of the job with that digest left in `folder`, if any did and it can be read.
    pub(super) fn read(folder: &Path, sha256: &str) -> Option<Self> {
        let path = folder.join(ROUNDS);
        let whole = path.symlink_metadata().ok().filter(|it| it.is_file() && it.len() <= MAX_BYTES)?;
        let bytes = std::fs::read(&path).ok().filter(|bytes| bytes.len() as u64 == whole.len())?;
        let found: Self = serde_json::from_slice(&bytes).ok()?;
        let same = found.generator == GENERATOR && found.version == ROUNDS_VERSION && found.sha256 == sha256;
        same.then_some(found)
    }
}
