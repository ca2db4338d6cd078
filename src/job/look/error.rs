//! Why there is no look.

use std::path::PathBuf;

use thiserror::Error;

use crate::{
    blame::{Blame, Blamed, Remedy},
    job::{RunError, verify::VerifyError},
    look::VolumeTooLarge,
    optics::OpticsError,
    output::OutputError,
    preview::PreviewError,
    watch::Stopped,
};

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
