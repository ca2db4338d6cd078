//! Where files are written before they appear under their names: a folder of the run's own inside the output folder, so
//! that a rename takes them to their place, under a name that cannot be guessed.

use std::{
    fs::{self, File, OpenOptions},
    io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use tempfile::TempDir;

/// How names of scratch folders begin.
const PREFIX: &str = ".lumislice-";

/// A scratch folder; goes with all that is in it.
#[derive(Debug)]
pub(super) struct Scratch {
    folder: TempDir,
    next: AtomicU64,
}

impl Scratch {
    /// A new one in `root`, which only this user may enter.
    pub(super) fn new(root: &Path) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(root)?;
        Ok(Self { folder, next: AtomicU64::new(0) })
    }

    /// A new file, opened for appending.
    pub(super) fn file(&self) -> io::Result<(PathBuf, File)> {
        let path = self.folder.path().join(self.next.fetch_add(1, Ordering::Relaxed).to_string());
        let file = OpenOptions::new().append(true).create_new(true).open(&path)?;
        Ok((path, file))
    }

    /// A new file, which may be written anywhere.
    pub(super) fn seekable_file(&self) -> io::Result<(PathBuf, File)> {
        let path = self.folder.path().join(self.next.fetch_add(1, Ordering::Relaxed).to_string());
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        Ok((path, file))
    }

    /// Removes what runs that were killed left in `root`. Nothing else bears such names, so that a folder with other
    /// things in it stays.
    pub(super) fn sweep(root: &Path) {
        let leftovers = fs::read_dir(root).into_iter().flatten().flatten().filter(is_scratch);
        for folder in leftovers.map(|entry| entry.path()) {
            let numbered = |name: &std::ffi::OsStr| name.to_string_lossy().bytes().all(|byte| byte.is_ascii_digit());
            for file in fs::read_dir(&folder).into_iter().flatten().flatten() {
                if numbered(&file.file_name()) && file.file_type().is_ok_and(|kind| kind.is_file()) {
                    // What cannot be removed does no harm.
                    let _ = fs::remove_file(file.path());
                }
            }
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Whether a folder's entry is a scratch folder.
pub(super) fn is_scratch(entry: &fs::DirEntry) -> bool {
    entry.file_name().to_string_lossy().starts_with(PREFIX) && entry.file_type().is_ok_and(|kind| kind.is_dir())
}
