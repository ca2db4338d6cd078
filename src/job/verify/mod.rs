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
//! | `exports`   | files that hold a whole job: `gcvf`, `bitmaps`, `volumes`, of these `vti` and `fractions` |
//! | `stackings` | `stackings.json` |

mod bitmaps;
mod exports;
mod files;
mod fractions;
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
mod vti;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

pub use remade::{Remake, RemakeError, verify_job};
use serde::Serialize;

use super::finished::read_manifest;
pub use super::finished::{Finding, VerifyError};
use crate::job::manifest::{Manifest, MaterialRecord};
use crate::{container::Counts, voxel::Lattice, watch::Watch};

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
