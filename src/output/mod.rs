//! The output folder: files appear under their final name only when complete, and nothing of somebody else's is
//! replaced.
//!
//! **In:** files, from any thread. **Out:** an [`OutputFolder`] with a manifest once it is finished, and until then a
//! journal of what is whole in it.

mod journal;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    path::{Path, PathBuf},
    sync::Mutex,
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

pub use journal::{JOURNAL, SliceCounts, Task};
use journal::{Journal, Recorded};

use crate::blame::{Blame, Blamed, Remedy};

/// Program and version, as manifests and journals have it.
pub(crate) const GENERATOR: &str = concat!("lumislice ", env!("CARGO_PKG_VERSION"));

/// What to do with a folder that holds something.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Existing {
    /// Leave it alone.
    #[default]
    Refuse,
    /// Replace the files of an earlier job, finished or not; only those that it wrote.
    Overwrite,
    /// Go on with the same job where it was interrupted.
    Resume,
}

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

impl Existing {
    /// Replaces an earlier job's files if the user said so.
    pub fn overwrite(said: bool) -> Self {
        if said { Self::Overwrite } else { Self::Refuse }
    }
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
    /// Files of this very job that an interrupted run wrote, found whole.
    kept: Mutex<BTreeMap<String, FileEntry>>,
    written: Mutex<BTreeMap<String, FileEntry>>,
    journal: Option<Journal>,
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
    pub fn check(root: &Path, existing: Existing) -> Result<(), OutputError> {
        Self::recorded(root, existing)?;
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

    /// Opens `root` for a run, creating it if need be. When an interrupted run is gone on with, also tells the slices
    /// whose files may be whole: [`Self::keep`] says whether they are.
    ///
    /// # Errors
    /// As [`Self::check`]; [`OutputError::AnotherJob`] when what was begun there is not `task`.
    pub fn begin(
        root: &Path,
        existing: Existing,
        task: &Task,
    ) -> Result<(Self, BTreeMap<u32, SliceCounts>), OutputError> {
        let mut recorded = Self::recorded(root, existing)?;
        fs::create_dir_all(root).map_err(|source| io_error("creating the folder", root, source))?;
        let (journal, manifest) = (root.join(JOURNAL), root.join(MANIFEST));
        let mut replaceable = std::mem::take(&mut recorded.replaces);
        if existing == Existing::Resume {
            if replaceable.contains(MANIFEST) {
                let (found, expected) = ("a finished job".to_owned(), "one that was interrupted".to_owned());
                return Err(OutputError::AnotherJob { path: manifest, found, expected });
            }
            if let Some(begun) = recorded.task.take().filter(|begun| begun != task) {
                return Err(begun.is_not(task, journal));
            }
        }
        let files = std::mem::take(&mut recorded.files);
        replaceable.extend(files.keys().cloned());
        // What another job noted of its slices says nothing of this one's.
        let (kept, slices) = match existing {
            Existing::Resume => {
                (files.into_par_iter().filter(|(_, entry)| entry.is_whole(root)).collect(), recorded.slices)
            }
            _ => (BTreeMap::new(), BTreeMap::new()),
        };
        let begun = Recorded {
            task: Some(task.clone()),
            replaces: replaceable.iter().filter(|path| !kept.contains_key(*path)).cloned().collect(),
            files: kept.clone(),
            slices: slices.clone(),
        };
        let begun = Journal::begin(&journal, &begun).map_err(|source| io_error("writing", &journal, source))?;
        if replaceable.remove(MANIFEST) {
            // From here on the folder does not claim to be a finished job.
            fs::remove_file(&manifest).map_err(|source| io_error("removing", &manifest, source))?;
        }
        let output = Self {
            root: root.to_path_buf(),
            replaceable: Mutex::new(replaceable),
            kept: Mutex::new(kept),
            written: Mutex::default(),
            journal: Some(begun),
        };
        Ok((output, slices))
    }

    /// Opens `root` for files that are made at once and never gone on with, creating it if need be.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn create(root: &Path, existing: Existing) -> Result<Self, OutputError> {
        let recorded = Self::recorded(root, existing)?;
        fs::create_dir_all(root).map_err(|source| io_error("creating the folder", root, source))?;
        let mut replaceable = recorded.replaces;
        replaceable.extend(recorded.files.into_keys());
        if replaceable.remove(MANIFEST) {
            let manifest = root.join(MANIFEST);
            fs::remove_file(&manifest).map_err(|source| io_error("removing", &manifest, source))?;
        }
        let (kept, written) = (Mutex::default(), Mutex::default());
        Ok(Self { root: root.to_path_buf(), replaceable: Mutex::new(replaceable), kept, written, journal: None })
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
        Ok(Self {
            root: root.to_path_buf(),
            replaceable: Mutex::new(replaceable),
            kept: Mutex::default(),
            written: Mutex::default(),
            journal: None,
        })
    }

    /// What earlier runs left in `root`, as far as `existing` lets it be replaced or gone on with.
    fn recorded(root: &Path, existing: Existing) -> Result<Recorded, OutputError> {
        let entries = match fs::read_dir(root) {
            Ok(mut entries) => entries.next().is_some(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => false,
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                return Err(OutputError::NotAFolder { path: root.to_path_buf() });
            }
            Err(source) => return Err(io_error("reading the folder", root, source)),
        };
        if !entries {
            return Ok(Recorded::default());
        }
        if existing == Existing::Refuse {
            return Err(OutputError::NotEmpty { path: root.to_path_buf() });
        }
        let journal = root.join(JOURNAL);
        let mut recorded = Recorded::read(&journal).map_err(|source| io_error("reading", &journal, source))?;
        let path = root.join(MANIFEST);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let Some(mut recorded) = recorded.take() else {
                    return Err(OutputError::NoManifest { path: root.to_path_buf() });
                };
                recorded.replaces.remove(MANIFEST);
                recorded.replaces.extend([JOURNAL, TIMINGS].map(String::from));
                return Ok(recorded);
            }
            Err(source) => return Err(io_error("reading", &path, source)),
        };
        let manifest: OldManifest = serde_json::from_str(&text)
            .map_err(|error| OutputError::BadManifest { path: path.clone(), reason: error.to_string() })?;
        let mut replaces: BTreeSet<_> = manifest.files.into_iter().map(|file| file.path).collect();
        if let Some(odd) = replaces.iter().find(|path| !is_plain(path)) {
            let reason = format!("it lists `{odd}`, which is not inside the folder");
            return Err(OutputError::BadManifest { path, reason });
        }
        replaces.extend([MANIFEST, TIMINGS].map(String::from));
        if recorded.is_some() {
            // A run that ended between its manifest and the removal of its journal, or just before it replaced the
            // manifest.
            replaces.insert(JOURNAL.to_owned());
        }
        Ok(Recorded { replaces, ..Recorded::default() })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Writes a file whole: under its final name there is either nothing or all of it. Subfolders are created.
    pub fn write(&self, relative: &str, content: &[u8]) -> Result<(), OutputError> {
        let entry = FileEntry::of(relative, content);
        self.write_unlisted(relative, content)?;
        if let Some(journal) = &self.journal {
            journal.file(&entry).map_err(|source| io_error("writing", &self.root.join(JOURNAL), source))?;
        }
        lock(&self.written).insert(relative.to_owned(), entry);
        Ok(())
    }

    /// Lists the file of an interrupted run as written, if it is there and whole.
    pub fn keep(&self, relative: &str) -> bool {
        let Some(entry) = lock(&self.kept).remove(relative) else { return false };
        lock(&self.replaceable).remove(relative);
        lock(&self.written).insert(relative.to_owned(), entry);
        true
    }

    /// Notes that all files of a slice are written.
    pub fn finish_slice(&self, slice: u32, counts: SliceCounts) -> Result<(), OutputError> {
        match &self.journal {
            Some(journal) => {
                journal.slice(slice, counts).map_err(|source| io_error("writing", &self.root.join(JOURNAL), source))
            }
            None => Ok(()),
        }
    }

    /// Like [`Self::write`], for the files that no manifest lists: the manifest itself and the timings.
    pub fn write_unlisted(&self, relative: &str, content: &[u8]) -> Result<(), OutputError> {
        let path = self.root.join(relative);
        let ours = lock(&self.replaceable).remove(relative);
        // A file with the very bytes is of this job's: an earlier run ended before it could note that.
        if !ours && path.exists() && !FileEntry::of(relative, content).is_whole(&self.root) {
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

    /// Ends a run: removes the files of the replaced job that were not written again, writes the manifest, then drops
    /// the journal.
    pub fn finish(self, manifest: &[u8]) -> Result<(), OutputError> {
        if self.journal.is_some() {
            lock(&self.replaceable).remove(JOURNAL);
        }
        self.remove_stale()?;
        self.write_unlisted(MANIFEST, manifest)?;
        let journal = self.root.join(JOURNAL);
        match self.journal {
            // Some systems keep a file that is open.
            Some(open) => {
                drop(open);
                fs::remove_file(&journal).map_err(|source| io_error("removing", &journal, source))
            }
            None => Ok(()),
        }
    }

    /// Everything written so far, sorted by path.
    pub fn files(&self) -> Vec<FileEntry> {
        lock(&self.written).values().cloned().collect()
    }

    /// Removes the files of the replaced job that were not written again.
    fn remove_stale(&self) -> Result<(), OutputError> {
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

impl FileEntry {
    fn of(path: &str, content: &[u8]) -> Self {
        Self { path: path.to_owned(), bytes: content.len() as u64, sha256: hex(&Sha256::digest(content)) }
    }

    /// Whether the file is in `root` with this size and digest.
    fn is_whole(&self, root: &Path) -> bool {
        let path = root.join(&self.path);
        let same_size = fs::symlink_metadata(&path).is_ok_and(|found| found.is_file() && found.len() == self.bytes);
        same_size && fs::read(&path).is_ok_and(|content| hex(&Sha256::digest(&content)) == self.sha256)
    }
}

impl Task {
    /// The error of a run that would do `other` where this one was begun.
    fn is_not(&self, other: &Self, path: PathBuf) -> OutputError {
        let tell = |task: &Self| match task {
            _ if self.generator != other.generator => task.generator.clone(),
            _ if self.slices != other.slices => format!("slices {}..{}", task.slices[0], task.slices[1]),
            _ => format!("a job and inputs of digest {}", task.sha256.get(..12).unwrap_or(&task.sha256)),
        };
        OutputError::AnotherJob { path, found: tell(self), expected: tell(other) }
    }
}

/// Timings of a run, the one file that may differ between runs.
pub const TIMINGS: &str = "timings.json";

const PARTIAL_SUFFIX: &str = ".part";

/// Whether a manifest's path stays inside its folder.
pub(crate) fn is_plain(path: &str) -> bool {
    !path.is_empty() && Path::new(path).components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

/// JSON as written to files: indented, with a newline at the end.
pub(crate) fn pretty(value: &impl Serialize) -> Vec<u8> {
    let mut text = serde_json::to_vec_pretty(value).unwrap_or_default();
    text.push(b'\n');
    text
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
