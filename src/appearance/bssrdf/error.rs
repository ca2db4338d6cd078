//! What can go wrong with a dataset, by who is to blame: the disk, the file's contents, or an option.

use std::{io, path::PathBuf};

use crate::{
    blame::{Blame, Blamed},
    watch::Stopped,
};

/// Errors of this room; every message is one line.
#[derive(Debug, thiserror::Error)]
pub enum BssrdfError {
    /// A file could not be read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The dataset could not be unpacked for lack of room or rights.
    #[error("{}: writing a working copy failed: {source}", folder.display())]
    Scratch {
        /// Folder of temporary files.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file says something it may not say.
    #[error("{}: {place}: found {found}, expected {expected}", file.display())]
    Entry {
        /// The file.
        file: PathBuf,
        /// Line, key, array or texel.
        place: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// Luminance is made of red, green and blue.
    #[error("{}: channels: found {found} channels, expected three", file.display())]
    NotThree {
        /// The file.
        file: PathBuf,
        /// Channels that it has.
        found: usize,
    },
    /// An option outside its range.
    #[error("{name}: found {found}, expected {expected}")]
    Option {
        /// The option's name.
        name: &'static str,
        /// What was given.
        found: String,
        /// What is accepted.
        expected: String,
    },
    /// The watch asked to stop.
    #[error("interrupted")]
    Stopped(#[from] Stopped),
}

impl Blamed for BssrdfError {
    fn blame(&self) -> Blame {
        match self {
            Self::Scratch { .. } => Blame::Disk,
            Self::Stopped(_) => Blame::Interrupt,
            _ => Blame::Input,
        }
    }
}
