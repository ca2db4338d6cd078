//! What may be wrong with an output folder.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::JOURNAL;
use crate::blame::{Blame, Blamed, Remedy};

/// What went wrong with the output folder.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The folder holds something and the caller did not ask to replace it.
    #[error("{}: found a folder that is not empty, expected a new or empty one", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A folder that no job wrote can neither be overwritten nor gone on with.
    #[error("{}: found files but neither a manifest.json nor a {JOURNAL} that lists them, expected an earlier job's \
        output; choose another folder or empty it", path.display())]
    NoManifest {
        /// The folder.
        path: PathBuf,
    },
    /// The manifest of the job to be replaced is damaged.
    #[error("{}: found a manifest that cannot be read ({reason}), expected an earlier job's manifest", path.display())]
    BadManifest {
        /// The manifest.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// What was begun in the folder is not what is asked for now.
    #[error("{}: found {found}, expected {expected}: what was begun there is another job", path.display())]
    AnotherJob {
        /// The journal or the manifest.
        path: PathBuf,
        /// What was begun.
        found: String,
        /// What is asked for.
        expected: String,
    },
    /// The folder is another command's.
    #[error("{}: found the output of {found}, expected that of {expected}; choose another folder", path.display())]
    AnotherCommand {
        /// The manifest.
        path: PathBuf,
        /// Which command wrote it.
        found: String,
        /// The one that would replace it.
        expected: &'static str,
    },
    /// Another run is at work in the folder.
    #[error("{}: found another run of lumislice at work there, expected to have the folder to itself", path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// A link, or something else that is neither a file nor a folder, stands below the folder.
    #[error("{}: found {found}, expected {expected}; links below an output folder are not followed", path.display())]
    Link {
        /// Where.
        path: PathBuf,
        /// What stands there.
        found: &'static str,
        /// What should.
        expected: &'static str,
    },
    /// A file of the earlier job is no longer what that job wrote.
    #[error("{}: found a file that was changed since the earlier job wrote it, expected its size and SHA-256; move it \
        elsewhere to have the rest replaced", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// An input lies among the files that would be replaced.
    #[error("{}: found an input of this run among the files that it would replace, expected inputs elsewhere; move it \
        or choose another folder", path.display())]
    InputInside {
        /// The input.
        path: PathBuf,
    },
    /// A file that no manifest lists is in the way.
    #[error("{}: found a file that the earlier job did not write, expected nothing under that name", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The path is not a folder.
    #[error("{}: found a file, expected a folder", path.display())]
    NotAFolder {
        /// The path.
        path: PathBuf,
    },
    /// Reading or writing failed.
    #[error("{}: {action} failed: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Blamed for OutputError {
    fn blame(&self) -> Blame {
        if matches!(self, Self::Io { .. }) { Blame::Disk } else { Blame::Input }
    }

    fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::NotEmpty { .. } => Some(Remedy::OverwriteOrResume),
            Self::AnotherJob { .. } => Some(Remedy::Overwrite),
            _ => None,
        }
    }
}

pub(super) fn io_error(action: &'static str, path: &Path, source: io::Error) -> OutputError {
    OutputError::Io { action, path: path.to_path_buf(), source }
}
