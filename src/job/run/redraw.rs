//! Pictures of a finished folder, drawn again.

use std::path::Path;

use super::{
    labels::{self, LABELS, MAX_LABELS_BYTES, SurfaceLabel},
    report::{draw_again, write_pictures},
};
use crate::{
    blame::{Blame, Blamed, Remedy},
    job::{
        Manifest, RunError,
        finished::{Finding, VerifyError, read_manifest},
        manifest::LatticeRecord,
    },
    output::{MANIFEST, OutputError, OutputFolder, pretty},
    preview::PreviewFile,
    voxel::Lattice,
    watch::Watch,
};

/// Why the pictures of a folder cannot be drawn again.
#[derive(Debug, thiserror::Error)]
pub enum RedrawError {
    /// There is no manifest of this version.
    #[error(transparent)]
    Folder(#[from] VerifyError),
    /// The manifest is damaged.
    #[error("{0}")]
    Manifest(Finding),
    /// Drawing or writing failed.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl Blamed for RedrawError {
    fn blame(&self) -> Blame {
        match self {
            Self::Folder(error) => error.blame(),
            Self::Run(error) => error.blame(),
            Self::Manifest(_) => Blame::Input,
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        if let Self::Run(error) = self { error.remedy() } else { None }
    }
}

/// Draws the pictures of the finished job in `folder` again from its slices (of a part of a job from those that are
/// there), with the page that shows them, and lists them in the manifest. Returns their paths relative to the folder.
///
/// # Errors
/// [`RedrawError`]; before anything is replaced unless writing itself fails.
pub fn redraw(folder: &Path, watch: &dyn Watch) -> Result<Vec<String>, RedrawError> {
    let (mut manifest, output) = reopened(folder)?;
    check(&manifest)?;
    let mut pictures = looks(&output, &manifest);
    pictures.extend(draw_again(folder, &manifest, watch)?);
    write_pictures(&output, &manifest, &pictures, &labels(&output, &manifest))?;
    Ok(list_written(&output, &mut manifest).map_err(RunError::from)?)
}

/// A finished folder, held while it is read: what another run replaced meanwhile must not come back.
pub(super) fn reopened(folder: &Path) -> Result<(Manifest, OutputFolder), RedrawError> {
    let manifest = read_manifest(folder)?.map_err(RedrawError::Manifest)?;
    let output = OutputFolder::reopen(folder, &manifest.files).map_err(RunError::from)?;
    if read_manifest(folder)?.as_ref() != Ok(&manifest) {
        return Err(RunError::from(OutputError::Busy { path: folder.to_owned() }).into());
    }
    Ok((manifest, output))
}

/// Lists in the manifest what was written since the folder was reopened. Returns the files' paths.
pub(super) fn list_written(output: &OutputFolder, manifest: &mut Manifest) -> Result<Vec<String>, OutputError> {
    let written = output.files();
    manifest.files.retain(|file| written.iter().all(|new| new.path != file.path));
    manifest.files.extend(written.iter().cloned());
    manifest.files.sort_by(|a, b| a.path.cmp(&b.path));
    output.write_unlisted(MANIFEST, &pretty(manifest))?;
    Ok(written.into_iter().map(|file| file.path).collect())
}

/// The pictures of a look, which slices alone do not give again; what cannot be read is left out.
fn looks(output: &OutputFolder, manifest: &Manifest) -> Vec<PreviewFile> {
    let listed = manifest.files.iter().filter(|file| file.path.starts_with("look/") && file.path.ends_with(".png"));
    let mut found: Vec<PreviewFile> = listed
        .filter_map(|file| Some(PreviewFile { path: file.path.clone(), png: output.read(file, MAX_PICTURE_BYTES)? }))
        .collect();
    // As they are drawn: under the sky first.
    found.sort_by_key(|file| ["soft", "edge", "behind", "spot"].iter().position(|name| file.path.contains(name)));
    found
}

/// The labels of the surface, which slices do not have either; none where they cannot be read.
fn labels(output: &OutputFolder, manifest: &Manifest) -> Vec<SurfaceLabel> {
    let found = manifest.files.iter().find(|file| file.path == LABELS);
    let text = found.and_then(|file| String::from_utf8(output.read(file, MAX_LABELS_BYTES)?).ok());
    text.and_then(|text| labels::read(&text)).unwrap_or_default()
}

/// Longest picture of a look, bytes.
const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// Most pixels of a slice: a tray of half a metre at 15 µm.
const MAX_PIXELS: u64 = 1 << 30;

/// Whether there is a whole job to be drawn, of a size that can be.
pub(super) fn check(manifest: &Manifest) -> Result<(), RedrawError> {
    let LatticeRecord { dims, pitch_mm, .. } = manifest.lattice;
    let fault = |key: &str, problem: String| Err(RedrawError::Manifest(Finding::manifest(key, problem)));
    if !dims.iter().all(|dim| (1..=Lattice::MAX_DIM).contains(dim)) {
        return fault("lattice.dims", format!("found {dims:?}, expected 1 to {} per axis", Lattice::MAX_DIM));
    }
    let pixels = u64::from(dims[0]) * u64::from(dims[1]);
    if pixels > MAX_PIXELS {
        return fault("lattice.dims", format!("found slices of {pixels} pixels, expected at most {MAX_PIXELS}"));
    }
    if !pitch_mm.iter().all(|pitch| pitch.is_finite() && *pitch > 0.0) {
        return fault("lattice.pitch_mm", format!("found {pitch_mm:?}, expected positive lengths"));
    }
    let [first, end] = manifest.slices;
    if first >= end || end > dims[2] {
        return fault("slices", format!("found {first}..{end}, expected a range within 0..{}", dims[2]));
    }
    Ok(())
}
