//! Re-reads a finished folder and checks it against its manifest.
//!
//! **In:** the folder. **Out:** a [`Verification`]: every [`Finding`] is one thing that is not as the manifest has it.
//! The manifest is not trusted: nothing outside the folder is read, and what it claims bounds no memory.
//!
//! | file | what it does |
//! | --- | --- |
//! | `records`   | what the manifest says of itself |
//! | `files`     | every listed file: there, of its size, of its digest; no others |
//! | `layers`    | the images: names, numbering, voxels per resin |
//! | `image`     | one image, row by row |
//! | `solids`    | the material meshes |
//! | `exports`   | files that hold a whole job: `gcvf`, `bitmaps`, `volumes` |
//! | `stackings` | `stackings.json` |

mod bitmaps;
mod exports;
mod files;
mod gcvf;
mod image;
mod layers;
mod records;
mod remade;
mod solids;
mod stackings;
#[cfg(test)]
mod tests;
mod volumes;

use std::{
    fmt, fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

pub use remade::{Remake, RemakeError, verify_job};
use serde::Serialize;
use thiserror::Error;

use crate::job::manifest::{MANIFEST_VERSION, Manifest, MaterialRecord};
use crate::{
    blame::{Blame, Blamed},
    container::Counts,
    output::{MANIFEST, MAX_MANIFEST_BYTES},
    voxel::Lattice,
    watch::{Stopped, Watch},
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
    fn new(path: &str, problem: impl Into<String>) -> Self {
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

/// What a check came to.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Verification {
    /// What is wrong, in the order of the files; empty if nothing is.
    pub findings: Vec<Finding>,
    /// Files that the manifest lists.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Slices decoded.
    pub slices: u64,
    /// Voxels of printed resins counted in them.
    pub voxels: u64,
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

/// Checks every file of the finished job in `folder`. Damage is not an error but in the findings.
///
/// # Errors
/// [`VerifyError`]: there is no manifest this program can judge the folder by, or [`VerifyError::Stopped`].
pub fn verify(folder: &Path, watch: &dyn Watch) -> Result<Verification, VerifyError> {
    let fault = |source| VerifyError::Io { path: folder.to_path_buf(), source };
    let no_folder = |found| VerifyError::NoFolder { path: folder.to_path_buf(), found };
    match fs::metadata(folder) {
        Ok(metadata) if metadata.is_dir() => {}
        Ok(_) => return Err(no_folder("something else")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(no_folder("nothing")),
        Err(error) => return Err(fault(error)),
    }
    let manifest = match read_manifest(folder)? {
        Ok(manifest) => manifest,
        Err(finding) => return Ok(Verification { findings: vec![finding], ..Default::default() }),
    };
    let check = Check { root: folder.canonicalize().map_err(fault)?, manifest: &manifest, watch };
    let mut result = Verification {
        findings: records::check(&manifest),
        files: manifest.files.len() as u64,
        bytes: manifest.files.iter().fold(0, |sum, file| sum.saturating_add(file.bytes)),
        ..Default::default()
    };
    let sound = files::check(&check, &mut result)?;
    layers::check(&check, &sound, &mut result)?;
    solids::check(&check, &sound, &mut result)?;
    exports::check(&check, &sound, &mut result)?;
    result.findings.extend(stackings::check(&check, &sound));
    Ok(result)
}

/// What all checks share.
struct Check<'a> {
    /// The folder, without symbolic links.
    root: PathBuf,
    manifest: &'a Manifest,
    watch: &'a dyn Watch,
}

impl Check<'_> {
    /// Whether the job asked for a format, so that its files must be there.
    fn wants(&self, format: &str) -> bool {
        let formats = self.manifest.job.pointer("/output/formats").and_then(serde_json::Value::as_array);
        formats.is_some_and(|formats| formats.iter().any(|name| name == format))
    }

    /// Whether files can be held against the lattice at all; `records` says so where it cannot be.
    fn has_lattice(&self) -> bool {
        self.manifest.lattice.dims.iter().all(|dim| *dim <= Lattice::MAX_DIM)
    }

    /// What differs between voxels of printed resins that were counted and those of the manifest. Of background and
    /// support a finished folder knows less than its job did.
    fn miscounted(&self, counts: &Counts) -> Vec<String> {
        let printed = self.manifest.materials.iter().filter(|material| material.rgba[3] != 0);
        let counted = printed.map(|material| (material, counts[usize::from(material.id)]));
        counted.filter_map(|(material, voxels)| miscount(material, voxels)).collect()
    }
}

/// What is said where other voxels were counted than the manifest has.
fn miscount(material: &MaterialRecord, voxels: u64) -> Option<String> {
    let MaterialRecord { name, voxels: expected, .. } = material;
    (voxels != *expected).then(|| format!("found {voxels} voxels of {name}, the manifest has {expected}"))
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
    fs::File::open(&path).and_then(|file| file.take(MAX_MANIFEST_BYTES + 1).read_to_end(&mut bytes)).map_err(fault)?;
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
