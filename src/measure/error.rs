//! What can go wrong in this room, by who is to blame: the capture file, a picture, or what the pictures show.

use std::path::{Path, PathBuf};

use crate::{
    blame::{Blame, Blamed},
    optics::OpticsError,
    toml_reader::Fault,
    watch::Stopped,
};

/// Why photographs yield no material; every message is one line.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The capture file cannot be read or says something it may not say.
    #[error(transparent)]
    Capture(#[from] OpticsError),
    /// A picture cannot be read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The picture.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A picture is not what a measurement can use.
    #[error("{}: found {found}, expected {expected}", file.display())]
    Frame {
        /// The picture.
        file: PathBuf,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// The pictures are fine one by one, but what they show is no measurement.
    #[error("{what}: found {found}, expected {expected}")]
    Scene {
        /// Series and step, such as `reflection: centre`.
        what: String,
        /// What they show.
        found: String,
        /// What they should show.
        expected: String,
    },
    /// The watch asked to stop.
    #[error("measurement cancelled")]
    Stopped(#[from] Stopped),
}

impl Blamed for MeasureError {
    fn blame(&self) -> Blame {
        match self {
            Self::Capture(error) => error.blame(),
            Self::Stopped(_) => Blame::Interrupt,
            _ => Blame::Input,
        }
    }
}

impl From<Fault> for MeasureError {
    fn from(fault: Fault) -> Self {
        Self::Capture(fault.into())
    }
}

impl MeasureError {
    pub(super) fn frame(file: &Path, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Frame { file: file.to_path_buf(), found: found.into(), expected: expected.into() }
    }

    pub(super) fn scene(what: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Scene { what: what.into(), found: found.into(), expected: expected.into() }
    }
}
