//! The output folder: files appear under their final name only when complete, and nothing of somebody else's is replaced.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    path::{Path, PathBuf},
    sync::Mutex,
};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

/// What went wrong with the output folder.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The folder holds something and the caller did not ask to replace it.
    #[error("{}: found a folder that is not empty, expected a new or empty one (--overwrite replaces an earlier job's files)", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A folder that no finished job wrote cannot be overwritten.
    #[error("{}: found files but no manifest.json that lists them, expected an earlier job's output; choose another folder or empty it", path.display())]
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

impl OutputError {
    /// Whether the disk is to blame rather than the request.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Io { .. })
    }
}

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

/// Name of the list of all files.
pub const MANIFEST: &str = "manifest.json";

/// An output folder being written.
#[derive(Debug)]
pub struct OutputFolder {
    root: PathBuf,
    /// Files of the job that is being replaced, still there.
    replaceable: Mutex<BTreeSet<String>>,
    written: Mutex<BTreeMap<String, FileEntry>>,
}

/// The part of a manifest that overwriting needs.
#[derive(Deserialize)]
struct OldManifest {
    files: Vec<FileEntry>,
}

impl OutputFolder {
    /// Checks that `root` may be written, leaving no trace.
    ///
    /// # Errors
    /// A folder that may not be replaced, or one that the disk does not let anyone write to.
    pub fn check(root: &Path, overwrite: bool) -> Result<(), OutputError> {
        Self::replaceable(root, overwrite)?;
        // `""` is the parent of a relative path of one part.
        let parents = root.ancestors().map(|folder| if folder == Path::new("") { Path::new(".") } else { folder });
        let existing = parents.clone().find(|folder| folder.exists()).unwrap_or(root);
        match tempfile::tempfile_in(existing) {
            Ok(_) => Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                Err(OutputError::NotAFolder { path: existing.to_path_buf() })
            }
            Err(source) => Err(io_error("writing into the folder", existing, source)),
        }
    }

    /// Opens `root`, creating it if need be.
    pub fn create(root: &Path, overwrite: bool) -> Result<Self, OutputError> {
        let replaceable = Self::replaceable(root, overwrite)?;
        fs::create_dir_all(root).map_err(|source| io_error("creating the folder", root, source))?;
        let manifest = root.join(MANIFEST);
        if replaceable.contains(MANIFEST) {
            // From here on the folder does not claim to be a finished job.
            fs::remove_file(&manifest).map_err(|source| io_error("removing", &manifest, source))?;
        }
        Ok(Self { root: root.to_path_buf(), replaceable: Mutex::new(replaceable), written: Mutex::default() })
    }

    /// Opens the folder of a finished job to add to it or replace some of its `files`; the rest stays.
    ///
    /// # Errors
    /// A list with a file outside the folder.
    pub fn reopen(root: &Path, files: &[FileEntry]) -> Result<Self, OutputError> {
        if let Some(odd) = files.iter().find(|file| !is_plain(&file.path)) {
            let reason = format!("it lists `{}`, which is not inside the folder", odd.path);
            return Err(OutputError::BadManifest { path: root.join(MANIFEST), reason });
        }
        let replaceable = files.iter().map(|file| file.path.clone()).chain([MANIFEST.to_owned()]).collect();
        Ok(Self { root: root.to_path_buf(), replaceable: Mutex::new(replaceable), written: Mutex::default() })
    }

    fn replaceable(root: &Path, overwrite: bool) -> Result<BTreeSet<String>, OutputError> {
        let entries = match fs::read_dir(root) {
            Ok(mut entries) => entries.next().is_some(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => false,
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                return Err(OutputError::NotAFolder { path: root.to_path_buf() });
            }
            Err(source) => return Err(io_error("reading the folder", root, source)),
        };
        if !entries {
            return Ok(BTreeSet::new());
        }
        if !overwrite {
            return Err(OutputError::NotEmpty { path: root.to_path_buf() });
        }
        let path = root.join(MANIFEST);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(OutputError::NoManifest { path: root.to_path_buf() });
            }
            Err(source) => return Err(io_error("reading", &path, source)),
        };
        let manifest: OldManifest = serde_json::from_str(&text)
            .map_err(|error| OutputError::BadManifest { path: path.clone(), reason: error.to_string() })?;
        let mut files: BTreeSet<_> = manifest.files.into_iter().map(|file| file.path).collect();
        if let Some(odd) = files.iter().find(|path| !is_plain(path)) {
            let reason = format!("it lists `{odd}`, which is not inside the folder");
            return Err(OutputError::BadManifest { path, reason });
        }
        files.extend([MANIFEST, TIMINGS].map(String::from));
        Ok(files)
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Writes a file whole: under its final name there is either nothing or all of it. Subfolders are created.
    pub fn write(&self, relative: &str, content: &[u8]) -> Result<(), OutputError> {
        self.write_unlisted(relative, content)?;
        let entry =
            FileEntry { path: relative.to_owned(), bytes: content.len() as u64, sha256: hex(&Sha256::digest(content)) };
        lock(&self.written).insert(relative.to_owned(), entry);
        Ok(())
    }

    /// Like [`Self::write`], for the files that no manifest lists: the manifest itself and the timings.
    pub fn write_unlisted(&self, relative: &str, content: &[u8]) -> Result<(), OutputError> {
        let path = self.root.join(relative);
        if path.exists() && !lock(&self.replaceable).remove(relative) {
            return Err(OutputError::Foreign { path });
        }
        let folder = path.parent().unwrap_or(&self.root);
        fs::create_dir_all(folder).map_err(|source| io_error("creating the folder", folder, source))?;
        let mut partial = path.clone().into_os_string();
        partial.push(PARTIAL_SUFFIX);
        let partial = PathBuf::from(partial);
        let result = fs::write(&partial, content).and_then(|()| fs::rename(&partial, &path));
        result.map_err(|source| {
            // The error at hand matters more than one of the clean-up.
            let _ = fs::remove_file(&partial);
            io_error("writing", &path, source)
        })
    }

    /// Everything written so far, sorted by path.
    pub fn files(&self) -> Vec<FileEntry> {
        lock(&self.written).values().cloned().collect()
    }

    /// Removes the files of the replaced job that were not written again.
    pub fn remove_stale(&self) -> Result<(), OutputError> {
        for relative in std::mem::take(&mut *lock(&self.replaceable)) {
            let path = self.root.join(relative);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(io_error("removing", &path, error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Timings of a run, the one file that may differ between runs.
pub const TIMINGS: &str = "timings.json";

const PARTIAL_SUFFIX: &str = ".part";

/// Whether a manifest's path stays inside its folder.
pub(crate) fn is_plain(path: &str) -> bool {
    !path.is_empty() && Path::new(path).components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn io_error(action: &'static str, path: &Path, source: io::Error) -> OutputError {
    OutputError::Io { action, path: path.to_path_buf(), source }
}

/// A poisoned lock means that another worker panicked, which ends the job anyway.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
