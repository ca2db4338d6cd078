//! Why a job was not done, and why there is no look of it: each may be the other's reason.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::{JobError, finished::VerifyError};
use crate::{
    blame::{Blame, Blamed, Remedy},
    look::VolumeTooLarge,
    mesh::MeshError,
    optics::OpticsError,
    output::OutputError,
    preview::PreviewError,
    search::SearchError,
    slice::meshes::MeshingError,
    voxel::LatticeError,
    watch::Stopped,
};

/// Why a job was not done.
#[derive(Debug, Error)]
pub enum RunError {
    /// The job file, or what it asks for.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A mesh that cannot be read; the message names its file.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A mesh that was read, but cannot be placed or closed.
    #[error("{}: {source}", file.display())]
    Shape {
        /// The mesh file.
        file: PathBuf,
        /// Why.
        source: MeshError,
    },
    /// A material or a profile.
    #[error(transparent)]
    Optics(OpticsError),
    /// A texture.
    #[error("{}: found {found}, expected {expected}", path.display())]
    Texture {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        found: String,
        /// What should be there.
        expected: &'static str,
    },
    /// The search for stackings.
    #[error("{object}: {source}")]
    Search {
        /// Which object.
        object: String,
        /// Why.
        source: SearchError,
    },
    /// The lattice.
    #[error("printer: {0}")]
    Lattice(#[from] LatticeError),
    /// A range of slices that the job does not have.
    #[error("slices: found {}..{}, expected a range within 0..{slices} that is not empty", found.start, found.end)]
    Slices {
        /// What was asked for.
        found: std::ops::Range<u32>,
        /// Slices of the job.
        slices: u32,
    },
    /// Material meshes.
    #[error("meshes: {0}")]
    Meshes(MeshingError),
    /// Pictures.
    #[error(transparent)]
    Preview(#[from] PreviewError),
    /// The look of what was sliced.
    #[error(transparent)]
    Look(Box<LookError>),
    /// The output folder.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The watch asked to stop.
    #[error("interrupted; files written so far are whole")]
    Stopped(#[from] Stopped),
}

impl From<OpticsError> for RunError {
    fn from(error: OpticsError) -> Self {
        match error {
            OpticsError::Stopped(stopped) => Self::Stopped(stopped),
            error => Self::Optics(error),
        }
    }
}

impl From<MeshingError> for RunError {
    fn from(error: MeshingError) -> Self {
        match error {
            MeshingError::Stopped(stopped) => Self::Stopped(stopped),
            error => Self::Meshes(error),
        }
    }
}

impl Blamed for RunError {
    fn blame(&self) -> Blame {
        match self {
            Self::Job(error) => error.blame(),
            Self::Mesh(error) | Self::Shape { source: error, .. } => error.blame(),
            Self::Optics(error) => error.blame(),
            Self::Search { source, .. } => source.blame(),
            Self::Lattice(error) => error.blame(),
            Self::Meshes(error) => error.blame(),
            Self::Preview(error) => error.blame(),
            Self::Look(error) => error.blame(),
            Self::Output(error) => error.blame(),
            Self::Texture { .. } | Self::Slices { .. } => Blame::Input,
            Self::Stopped(stopped) => stopped.blame(),
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Output(error) => error.remedy(),
            Self::Stopped(_) => Some(Remedy::Resume),
            _ => None,
        }
    }
}

/// Why there is no look.
#[derive(Debug, Error)]
pub enum LookError {
    /// The job.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A folder without a manifest.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// A folder whose slices do not fit what is asked.
    #[error("{}: found {found}, expected {expected}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// A slice.
    #[error(transparent)]
    Slice(#[from] PreviewError),
    /// More voxels than can be held.
    #[error(transparent)]
    TooLarge(#[from] VolumeTooLarge),
    /// The resins.
    #[error(transparent)]
    Optics(OpticsError),
    /// The output folder.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The watch asked to stop.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl LookError {
    pub(in crate::job) fn folder(folder: &Path, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Folder { folder: folder.to_owned(), found: found.into(), expected: expected.into() }
    }
}

impl From<OpticsError> for LookError {
    fn from(error: OpticsError) -> Self {
        match error {
            OpticsError::Stopped(stopped) => Self::Stopped(stopped),
            error => Self::Optics(error),
        }
    }
}

impl Blamed for LookError {
    fn blame(&self) -> Blame {
        match self {
            Self::Run(error) => error.blame(),
            Self::Verify(error) => error.blame(),
            Self::Slice(error) => error.blame(),
            Self::TooLarge(error) => error.blame(),
            Self::Optics(error) => error.blame(),
            Self::Output(error) => error.blame(),
            Self::Stopped(stopped) => stopped.blame(),
            Self::Folder { .. } => Blame::Input,
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Run(error) => error.remedy(),
            Self::Output(error) => error.remedy(),
            _ => None,
        }
    }
}
