//! A finished folder's manifest, read without trust in it.

use std::{
    fmt, fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

use serde::Serialize;
use thiserror::Error;

use super::manifest::{MANIFEST_VERSION, Manifest};
use crate::{
    blame::{Blame, Blamed},
    output::{MANIFEST, MAX_MANIFEST_BYTES},
    regular_file,
    watch::Stopped,
    words::escaped,
};

/// One thing that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The file, relative to the folder, or a key of the manifest after `manifest.json: `.
    pub path: String,
    /// What was found there and what was expected, on one line.
    pub problem: String,
}

impl Finding {
    pub(super) fn new(path: &str, problem: impl Into<String>) -> Self {
        Self { path: escaped(path), problem: escaped(&problem.into()) }
    }

    pub(super) fn manifest(key: &str, problem: impl Into<String>) -> Self {
        Self::new(MANIFEST, format!("{key}: {}", problem.into()))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.problem)
    }
}

/// Why a folder could not be checked.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// Not a folder.
    #[error("{}: found {found}, expected the folder of a finished job", path.display())]
    NoFolder {
        /// The path.
        path: PathBuf,
        /// What is there.
        found: &'static str,
    },
    /// Nothing says what the folder should hold.
    #[error("{}: found no manifest.json, expected the folder of a finished job", path.display())]
    NoManifest {
        /// The folder.
        path: PathBuf,
    },
    /// The manifest is that of another command.
    #[error("{}: found the manifest of a folder without slices, as factor and compare write, expected a finished \
        job's", path.display())]
    NoJob {
        /// The manifest.
        path: PathBuf,
    },
    /// The manifest is of another time.
    #[error("{}: found version {found}, expected {MANIFEST_VERSION}, the one this program knows", path.display())]
    Version {
        /// The manifest.
        path: PathBuf,
        /// Its version.
        found: u64,
    },
    /// The manifest cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The watch asked to stop.
    #[error("interrupted before everything was checked")]
    Stopped(#[from] Stopped),
}

impl Blamed for VerifyError {
    fn blame(&self) -> Blame {
        match self {
            Self::Stopped(_) => Blame::Interrupt,
            _ => Blame::Input,
        }
    }
}

/// Reads the manifest; what is wrong with its text is a finding.
pub(super) fn read_manifest(folder: &Path) -> Result<Result<Manifest, Finding>, VerifyError> {
    let path = folder.join(MANIFEST);
    let fault = |source| VerifyError::Io { path: path.clone(), source };
    match fs::symlink_metadata(&path) {
        Ok(metadata) if metadata.is_file() => {}
        Ok(_) => return Ok(Err(Finding::new(MANIFEST, "found no regular file, expected one"))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(VerifyError::NoManifest { path: folder.to_path_buf() });
        }
        Err(error) => return Err(fault(error)),
    }
    let mut bytes = Vec::new();
    regular_file::open(&path)
        .and_then(|file| file.take(MAX_MANIFEST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(fault)?;
    if bytes.len() as u64 > MAX_MANIFEST_BYTES {
        let problem = format!("found more than {MAX_MANIFEST_BYTES} bytes, expected a manifest of at most that");
        return Ok(Err(Finding::new(MANIFEST, problem)));
    }
    /// What is asked first, whatever else a later version may hold.
    #[derive(serde::Deserialize)]
    struct Versioned {
        version: u64,
        job: Option<serde::de::IgnoredAny>,
        lattice: Option<serde::de::IgnoredAny>,
    }
    match serde_json::from_slice::<Versioned>(&bytes) {
        Ok(Versioned { job: None, lattice: None, .. }) => Err(VerifyError::NoJob { path }),
        Ok(Versioned { version, .. }) if version != u64::from(MANIFEST_VERSION) => {
            Err(VerifyError::Version { path, found: version })
        }
        _ => {
            Ok(serde_json::from_slice(&bytes)
                .map_err(|error| Finding::new(MANIFEST, format!("cannot be read: {error}"))))
        }
    }
}
