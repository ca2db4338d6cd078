//! What an earlier run left in the folder: read, and held against what it says of itself, before anything is touched.

use std::{
    collections::BTreeMap,
    fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

use serde::Deserialize;

use super::{
    Existing, JOURNAL, MANIFEST, Owner, TIMINGS,
    error::{OutputError, io_error},
    journal::{Recorded, SliceCounts, Task},
    place::{FileEntry, is_plain, lies_at},
    scratch::is_scratch,
};
use crate::parallel;
use crate::regular_file;

/// Longest manifest that is read, bytes: a full tray of 14 µm layers with six masks each lists 100 000 files in 20 MB.
pub const MAX_MANIFEST_BYTES: u64 = 256 << 20;

/// Longest timings that are read, bytes: three numbers with their names.
const MAX_TIMINGS_BYTES: u64 = 1 << 16;

/// What stands in a folder, as far as it may be replaced or gone on with.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    /// What was begun there, if it was not finished.
    pub(super) task: Option<Task>,
    /// Files that may be replaced, with what may lie under their names.
    pub(super) replaces: BTreeMap<String, Vec<FileEntry>>,
    /// Files that the unfinished run wrote.
    pub(super) files: BTreeMap<String, FileEntry>,
    /// Slices that it finished.
    pub(super) slices: BTreeMap<u32, SliceCounts>,
}

/// The part of a manifest that replacing needs.
#[derive(Deserialize)]
struct OldManifest {
    generator: String,
    /// Manifests of jobs told themselves by their lattice once.
    command: Option<String>,
    lattice: Option<serde::de::IgnoredAny>,
    files: Vec<FileEntry>,
}

impl Earlier {
    /// What earlier runs of `owner` left in `root`, as far as `existing` lets it be replaced or gone on with.
    pub(super) fn read(root: &Path, owner: &Owner, existing: Existing) -> Result<Self, OutputError> {
        let something = match fs::read_dir(root) {
            Ok(entries) => entries.flatten().any(|entry| !is_scratch(&entry)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => false,
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                return Err(OutputError::NotAFolder { path: root.to_path_buf() });
            }
            Err(source) => return Err(io_error("reading the folder", root, source)),
        };
        if !something {
            return Ok(Self::default());
        }
        if existing == Existing::Refuse {
            return Err(OutputError::NotEmpty { path: root.to_path_buf() });
        }
        let journal = root.join(JOURNAL);
        let recorded = match lies_at(root, JOURNAL)? {
            Some(found) if found.is_file() => Recorded::read(&journal).map_err(|s| io_error("reading", &journal, s))?,
            Some(_) => return Err(OutputError::Foreign { path: journal }),
            None => None,
        };
        // A manifest takes precedence: the run ended between it and the removal of its journal.
        let earlier = match (read_manifest(root)?, recorded) {
            (Some(manifest), recorded) => {
                Self::finished(manifest, root, owner)?.with_own_files(root, recorded.is_some())?
            }
            (None, Some(recorded)) => Self::begun(recorded, root, owner)?.with_own_files(root, true)?,
            (None, None) => return Err(OutputError::NoManifest { path: root.to_path_buf() }),
        };
        if existing == Existing::Overwrite {
            earlier.check_unchanged(root)?;
        }
        Ok(earlier)
    }

    fn finished(manifest: OldManifest, root: &Path, owner: &Owner) -> Result<Self, OutputError> {
        let path = root.join(MANIFEST);
        let command = match manifest.command {
            Some(command) => command,
            None if manifest.lattice.is_some() => "slice".to_owned(),
            None => "a command that it does not name".to_owned(),
        };
        if !manifest.generator.starts_with("lumislice ") || command != owner.command {
            let found = if manifest.generator.starts_with("lumislice ") { command } else { manifest.generator };
            return Err(OutputError::AnotherCommand { path, found, expected: owner.command });
        }
        let odd = |file: &&FileEntry| !is_plain(&file.path) || !owner.writes(&file.path);
        if let Some(odd) = manifest.files.iter().find(odd) {
            let reason = match is_plain(&odd.path) {
                true => format!("it lists `{}`, which {} does not write", odd.path, owner.command),
                false => format!("it lists `{}`, which is not inside the folder", odd.path),
            };
            return Err(OutputError::BadManifest { path, reason });
        }
        let mut earlier = Self::default();
        manifest.files.into_iter().for_each(|file| earlier.may_replace(file));
        earlier.replaces.insert(MANIFEST.to_owned(), Vec::new());
        Ok(earlier)
    }

    fn begun(recorded: Recorded, root: &Path, owner: &Owner) -> Result<Self, OutputError> {
        let Some(task) = recorded.task else {
            return Err(OutputError::NoManifest { path: root.to_path_buf() });
        };
        if task.command != owner.command {
            let path = root.join(JOURNAL);
            return Err(OutputError::AnotherCommand { path, found: task.command, expected: owner.command });
        }
        let mut earlier = Self { task: Some(task), slices: recorded.slices, ..Self::default() };
        let ours = |file: &FileEntry| is_plain(&file.path) && owner.writes(&file.path);
        recorded.replaces.into_iter().filter(ours).for_each(|file| earlier.may_replace(file));
        earlier.files = recorded.files.into_iter().filter(|(_, file)| ours(file)).collect();
        earlier.files.clone().into_values().for_each(|file| earlier.may_replace(file));
        Ok(earlier)
    }

    fn may_replace(&mut self, file: FileEntry) {
        self.replaces.entry(file.path.clone()).or_default().push(file);
    }

    /// Adds what no manifest lists: the journal, and timings, which must be such or were never written.
    fn with_own_files(mut self, root: &Path, journal: bool) -> Result<Self, OutputError> {
        if journal {
            self.replaces.insert(JOURNAL.to_owned(), Vec::new());
        }
        if let Some(found) = lies_at(root, TIMINGS)? {
            let path = root.join(TIMINGS);
            let numbers = |text: Vec<u8>| serde_json::from_slice::<BTreeMap<String, Seconds>>(&text).is_ok();
            let ours = found.is_file()
                && (found.len() == 0 || regular_file::read(&path, MAX_TIMINGS_BYTES).is_ok_and(numbers));
            if !ours {
                return Err(OutputError::Foreign { path });
            }
            self.replaces.insert(TIMINGS.to_owned(), Vec::new());
        }
        Ok(self)
    }

    /// Refuses if a file that would be replaced is not, or no longer, what was listed.
    fn check_unchanged(&self, root: &Path) -> Result<(), OutputError> {
        let listed: Vec<_> = self.replaces.iter().filter(|(_, entries)| !entries.is_empty()).collect();
        let unchanged = |(path, entries): &(&String, &Vec<FileEntry>)| {
            let there = lies_at(root, path)?.is_some();
            if there && !entries.iter().any(|entry| entry.is_whole(root)) {
                return Err(OutputError::Changed { path: root.join(path) });
            }
            Ok(())
        };
        parallel::map_all(&listed, unchanged).into_iter().collect()
    }

    /// Refuses if one of `inputs`, files or folders, is or holds what may be replaced.
    pub(super) fn refuse_inputs(&self, root: &Path, inputs: &[PathBuf]) -> Result<(), OutputError> {
        let Ok(root) = root.canonicalize() else { return Ok(()) };
        for input in inputs {
            let Ok(whole) = input.canonicalize() else { continue };
            let Ok(inside) = whole.strip_prefix(&root) else { continue };
            if self.replaces.keys().any(|path| Path::new(path).starts_with(inside)) {
                return Err(OutputError::InputInside { path: input.clone() });
            }
        }
        Ok(())
    }
}

/// What timings hold under a name.
#[derive(Deserialize)]
#[serde(untagged)]
#[expect(dead_code, reason = "only whether it can be read is asked")]
enum Seconds {
    One(f64),
    Each(Vec<f64>),
}

impl Owner {
    /// Whether the command writes files of this name.
    fn writes(&self, path: &str) -> bool {
        self.names.iter().any(|name| match (name.strip_suffix('/'), name.strip_suffix('*')) {
            (Some(folder), _) => Path::new(path).starts_with(folder) && path.len() > name.len(),
            (_, Some(start)) => path.starts_with(start) && !path.contains('/'),
            _ => path == *name,
        })
    }
}

/// The manifest in `root`, if there is one.
fn read_manifest(root: &Path) -> Result<Option<OldManifest>, OutputError> {
    let path = root.join(MANIFEST);
    match lies_at(root, MANIFEST)? {
        None => return Ok(None),
        Some(found) if found.is_file() && found.len() <= MAX_MANIFEST_BYTES => {}
        Some(found) => {
            let reason = match found.is_file() {
                true => format!("{} bytes, at most {MAX_MANIFEST_BYTES} are read", found.len()),
                false => "not a regular file".to_owned(),
            };
            return Err(OutputError::BadManifest { path, reason });
        }
    }
    let mut text = Vec::new();
    let file = regular_file::open(&path).map_err(|source| io_error("reading", &path, source))?;
    file.take(MAX_MANIFEST_BYTES).read_to_end(&mut text).map_err(|source| io_error("reading", &path, source))?;
    match serde_json::from_slice(&text) {
        Ok(manifest) => Ok(Some(manifest)),
        Err(error) => Err(OutputError::BadManifest { path, reason: error.to_string() }),
    }
}
