//! Is a finished folder what its job makes? Made again and held against what lies there: a manifest that was changed
//! together with the files it lists agrees with them, but not with the job.

use std::{
    hash::{BuildHasher, RandomState},
    ops::Range,
    path::Path,
};

use serde_json::Value;
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::{Finding, Verification, VerifyError, read_manifest, verify};
use crate::{
    blame::{Blame, Blamed, Remedy},
    job::{
        MAPPING, Manifest, Prepared, REPORT, RunError, RunOptions,
        manifest::{Outcome, STACKINGS, json},
        run::run,
    },
    output::{Existing, FileEntry, MANIFEST, OutputError},
    watch::Watch,
    words::hex,
};

/// How much is made again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Remake {
    /// The stackings, and slices spread over the height.
    #[default]
    Sample,
    /// Every file.
    All,
}

/// Slabs of slices that a sample makes again.
const SAMPLED_SLABS: u64 = 8;

/// Keys of the manifest that are known before the first slice is made.
const PREPARED_KEYS: [&str; 9] =
    ["generator", "command", "version", "name", "job", "inputs", "objects", "lattice", "stackings"];

/// Why a folder could not be held against its job.
#[derive(Debug, Error)]
pub enum RemakeError {
    /// The folder cannot be checked.
    #[error(transparent)]
    Folder(#[from] VerifyError),
    /// The job cannot be done.
    #[error(transparent)]
    Job(#[from] RunError),
}

impl Blamed for RemakeError {
    fn blame(&self) -> Blame {
        match self {
            Self::Folder(error) => error.blame(),
            Self::Job(error) => error.blame(),
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        None
    }
}

/// Checks the finished job in `folder` as [`verify`] does, and holds it against what `prepared` makes.
///
/// # Errors
/// [`RemakeError`]; what differs is not an error but in the findings.
pub fn verify_job(
    folder: &Path,
    prepared: &Prepared,
    remake: Remake,
    watch: &dyn Watch,
) -> Result<Verification, RemakeError> {
    let mut result = verify(folder, watch)?;
    let Ok(manifest) = read_manifest(folder)? else { return Ok(result) };
    let [start, end] = manifest.slices;
    let all = 0..prepared.lattice.dims[2];
    if start >= end || end > all.end {
        let problem = format!("found {start}..{end}, expected slices of 0..{}, which the job makes", all.end);
        result.findings.push(Finding::manifest("slices", problem));
        return Ok(result);
    }
    let again = Again { prepared, manifest: &manifest, slices: start..end };
    let found = match remake {
        Remake::Sample => again.sample(watch)?,
        Remake::All => again.all(watch)?,
    };
    // What the first check found is not said twice.
    let new: Vec<_> = found
        .into_iter()
        .filter(|new| new.path == MANIFEST || result.findings.iter().all(|known| known.path != new.path))
        .collect();
    result.findings.extend(new);
    Ok(result)
}

/// A folder's manifest beside the job that is to have made it.
struct Again<'a> {
    prepared: &'a Prepared,
    manifest: &'a Manifest,
    slices: Range<u32>,
}

impl Again<'_> {
    fn sample(&self, watch: &dyn Watch) -> Result<Vec<Finding>, RunError> {
        let outcome = Outcome {
            slices: self.manifest.slices,
            counts: [0; 256],
            meshes: Vec::new(),
            warnings: Vec::new(),
            print_warnings: 0,
        };
        let expected = Manifest::new(self.prepared, outcome);
        let mut findings = self.keys(&expected, |key| PREPARED_KEYS.contains(&key));
        findings.extend(self.file(STACKINGS, &self.prepared.stackings_json()));
        // Others every time: who tampers cannot know which.
        let drawn = RandomState::new();
        let count = u64::from(self.slices.end - self.slices.start);
        let slabs: Vec<u32> = (0..SAMPLED_SLABS)
            .map(|n| {
                let within = drawn.hash_one(n) % (count / SAMPLED_SLABS + 1);
                self.slices.start + (count * n / SAMPLED_SLABS + within).min(count - 1) as u32
            })
            .collect();
        watch.stage("slices made again", 0);
        self.prepared.for_each_sliced_file(
            self.slices.clone(),
            |held| slabs.iter().any(|slice| held.contains(slice)),
            watch,
            |path, content| findings.extend(self.file(path, content)),
        )?;
        Ok(findings)
    }

    fn all(&self, watch: &dyn Watch) -> Result<Vec<Finding>, RunError> {
        let folder = tempfile::Builder::new().prefix("lumislice-").tempdir().map_err(|source| OutputError::Io {
            action: "creating a folder",
            path: std::env::temp_dir(),
            source,
        })?;
        let options = RunOptions { existing: Existing::Refuse, slices: Some(self.slices.clone()) };
        let expected = run(self.prepared, &folder.path().join("again"), &options, watch)?.manifest;
        let mut findings = self.keys(&expected, |key| key != "files");
        for file in &expected.files {
            findings.extend(self.entry(file));
        }
        // `preview` adds pictures to a finished folder, `convert` the job in other formats, which `exports` reads.
        let added = ["preview/", "exports/", "bmp/"];
        let drawn =
            |path: &str| added.iter().any(|folder| path.starts_with(folder)) || [REPORT, MAPPING].contains(&path);
        let made = |file: &&FileEntry| drawn(&file.path) || expected.files.iter().any(|other| other.path == file.path);
        for odd in self.manifest.files.iter().filter(|file| !made(file)) {
            findings.push(Finding::new(&odd.path, "found a file that the job does not make, expected none"));
        }
        Ok(findings)
    }

    /// Keys of the manifest that differ.
    fn keys(&self, expected: &Manifest, wanted: impl Fn(&str) -> bool) -> Vec<Finding> {
        let (found, expected) = (json(self.manifest), json(expected));
        let (Value::Object(found), Value::Object(expected)) = (found, expected) else { return Vec::new() };
        let keys: std::collections::BTreeSet<&String> = found.keys().chain(expected.keys()).collect();
        let differs = |key: &&String| wanted(key) && found.get(*key) != expected.get(*key);
        let problem = "found what differs from what the job makes, expected the same";
        keys.into_iter().filter(differs).map(|key| Finding::manifest(key, problem)).collect()
    }

    /// Whether a file is listed with the digest of `content`.
    fn file(&self, path: &str, content: &[u8]) -> Option<Finding> {
        let sha256 = hex(&Sha256::digest(content));
        self.entry(&FileEntry { path: path.to_owned(), bytes: content.len() as u64, sha256 })
    }

    fn entry(&self, expected: &FileEntry) -> Option<Finding> {
        let FileEntry { path, sha256, .. } = expected;
        match self.manifest.files.iter().find(|file| file.path == *path) {
            Some(found) if found == expected => None,
            Some(found) => Some(Finding::new(
                path,
                format!("found SHA-256 {}, expected {sha256}, which the job makes", found.sha256),
            )),
            None => Some(Finding::new(path, "not listed, expected a file that the job makes")),
        }
    }
}
