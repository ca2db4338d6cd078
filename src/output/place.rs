//! Where a file of the folder lies: reached without following any link below the folder.

use std::{
    fs,
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::{OutputError, io_error};
use crate::{regular_file, words::hex};

/// A file of the output folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Path relative to the folder, with forward slashes.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// Lower-case hexadecimal digest of the content.
    pub sha256: String,
}

impl FileEntry {
    pub(super) fn of(path: &str, content: &[u8]) -> Self {
        Self { path: path.to_owned(), bytes: content.len() as u64, sha256: hex(&Sha256::digest(content)) }
    }

    /// Whether the file lies in `root`, behind no link, with this size and digest.
    pub(crate) fn is_whole(&self, root: &Path) -> bool {
        let same_size = |found: &fs::Metadata| found.is_file() && found.len() == self.bytes;
        matches!(lies_at(root, &self.path), Ok(Some(found)) if same_size(&found))
            && digest(&root.join(&self.path)).is_ok_and(|sha256| sha256 == self.sha256)
    }
}

/// Lower-case hexadecimal SHA-256 of a file, which may be longer than memory.
pub(crate) fn digest(path: &Path) -> io::Result<String> {
    let mut file = regular_file::open(path)?;
    let (mut hasher, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(hex(&hasher.finalize())),
            read => hasher.update(&buffer[..read]),
        }
    }
}

/// Whether a manifest's path stays inside its folder, and is the one way to write it.
pub(crate) fn is_plain(path: &str) -> bool {
    let parts: Vec<_> = Path::new(path).components().collect();
    let names: Vec<_> = parts.iter().map(|part| part.as_os_str().to_string_lossy()).collect();
    !path.is_empty() && parts.iter().all(|part| matches!(part, Component::Normal(_))) && names.join("/") == path
}

/// What stands at `relative` below `root`, itself not followed; `None` where nothing does.
///
/// # Errors
/// [`OutputError::Link`] where a part on the way there is not a folder.
pub(super) fn lies_at(root: &Path, relative: &str) -> Result<Option<fs::Metadata>, OutputError> {
    let mut folders: Vec<&Path> = Path::new(relative).ancestors().skip(1).collect();
    folders.reverse();
    for folder in folders.into_iter().filter(|folder| *folder != Path::new("")) {
        if !is_folder(&root.join(folder))? {
            return Ok(None);
        }
    }
    look(&root.join(relative))
}

/// Creates the folder that `relative` is to lie in, and tells it.
///
/// # Errors
/// [`OutputError::Link`] where a part on the way there is not a folder, and what the disk says.
pub(super) fn make_folder_of(root: &Path, relative: &str) -> Result<PathBuf, OutputError> {
    let mut folder = root.to_path_buf();
    let parent = Path::new(relative).parent().unwrap_or(Path::new(""));
    for part in parent.components() {
        folder.push(part);
        if !is_folder(&folder)? {
            match fs::create_dir(&folder) {
                // Another thread was quicker.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && is_folder(&folder)? => {}
                Err(source) => return Err(io_error("creating the folder", &folder, source)),
                Ok(()) => {}
            }
        }
    }
    Ok(folder)
}

/// Whether a folder stands at `path`: an error where something else does.
fn is_folder(path: &Path) -> Result<bool, OutputError> {
    match look(path)? {
        None => Ok(false),
        Some(found) if found.is_dir() => Ok(true),
        Some(found) => {
            let found = if found.is_symlink() { "a link" } else { "a file" };
            Err(OutputError::Link { path: path.to_path_buf(), found, expected: "a folder" })
        }
    }
}

fn look(path: &Path) -> Result<Option<fs::Metadata>, OutputError> {
    match fs::symlink_metadata(path) {
        Ok(found) => Ok(Some(found)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(io_error("reading", path, source)),
    }
}
