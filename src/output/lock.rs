//! One run at a time in a folder.

use std::{fs::File, path::Path};

use super::error::{OutputError, io_error};

/// Holds a folder for one process, until dropped or until the process ends however it ends.
#[derive(Debug)]
pub(super) struct FolderLock {
    /// The folder itself, so that no file is left behind. Only Unix opens and locks folders.
    open: Option<File>,
}

impl FolderLock {
    /// Whether the system says that no other process holds the folder.
    pub(super) fn is_certain(&self) -> bool {
        self.open.is_some()
    }

    /// Takes the folder at `root`, which exists.
    ///
    /// # Errors
    /// [`OutputError::Busy`] while another process holds it.
    pub(super) fn take(root: &Path) -> Result<Self, OutputError> {
        if !cfg!(unix) {
            return Ok(Self { open: None });
        }
        let open = File::open(root).map_err(|source| io_error("reading the folder", root, source))?;
        match open.try_lock() {
            Ok(()) => Ok(Self { open: Some(open) }),
            Err(std::fs::TryLockError::WouldBlock) => Err(OutputError::Busy { path: root.to_path_buf() }),
            // Some network file systems know no locks.
            Err(std::fs::TryLockError::Error(_)) => Ok(Self { open: None }),
        }
    }
}
