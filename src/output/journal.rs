//! The journal of an unfinished run: what is whole in its folder, so that an interrupted job goes on where it stopped.
//!
//! One JSON document a line: first the [`Task`], then every file just before it appears under its final name, and every
//! slice once all of its files have. A last line that was cut off does not count. The folder of a finished job has a
//! manifest and no journal.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Write},
    path::Path,
    sync::Mutex,
};

use serde::{Deserialize, Serialize};

use super::{FileEntry, is_plain, lock, scratch::Scratch};
use crate::regular_file;

/// Name of the journal.
pub const JOURNAL: &str = "journal.jsonl";

/// Longest journal that is read, bytes: a full tray of 14 µm layers with six masks each takes 25 MB.
const MAX_JOURNAL_BYTES: u64 = 256 << 20;

/// What a run does: another run can go on with it only if it would do the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// The command.
    pub command: String,
    /// Program and version.
    pub generator: String,
    /// Digest of the job, its inputs and its stackings.
    pub sha256: String,
    /// First slice, and one past the last.
    pub slices: [u32; 2],
}

/// How many voxels of a slice have every id that occurs in it.
pub type SliceCounts = BTreeMap<u8, u64>;

/// A line.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Line {
    Task {
        #[serde(flatten)]
        task: Task,
        /// Files of an earlier job that this one replaces.
        replaces: Vec<FileEntry>,
    },
    File(FileEntry),
    Slice {
        slice: u32,
        counts: SliceCounts,
    },
}

/// What a journal says.
#[derive(Debug, Default)]
pub(super) struct Recorded {
    pub(super) task: Option<Task>,
    pub(super) replaces: Vec<FileEntry>,
    pub(super) files: BTreeMap<String, FileEntry>,
    pub(super) slices: BTreeMap<u32, SliceCounts>,
}

impl Recorded {
    /// Reads the journal at `path`; `None` if there is none. Lines from the first one on that is no line of a journal
    /// are left out.
    pub(super) fn read(path: &Path) -> io::Result<Option<Self>> {
        let file = match regular_file::open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        let mut bytes = Vec::new();
        file.take(MAX_JOURNAL_BYTES).read_to_end(&mut bytes)?;
        let mut recorded = Self::default();
        for line in bytes.split_inclusive(|&byte| byte == b'\n').filter(|line| line.ends_with(b"\n")) {
            match serde_json::from_slice(line) {
                Ok(Line::Task { task, replaces }) => {
                    recorded.task = Some(task);
                    recorded.replaces = replaces.into_iter().filter(|file| is_plain(&file.path)).collect();
                }
                Ok(Line::File(entry)) if is_plain(&entry.path) => {
                    recorded.files.insert(entry.path.clone(), entry);
                }
                Ok(Line::Slice { slice, counts }) => {
                    recorded.slices.insert(slice, counts);
                }
                Ok(Line::File(_)) | Err(_) => break,
            }
        }
        Ok(Some(recorded))
    }
}

/// A journal being written.
#[derive(Debug)]
pub(super) struct Journal(Mutex<File>);

impl Journal {
    /// Begins the journal at `path` anew with what is already `recorded`.
    pub(super) fn begin(scratch: &Scratch, path: &Path, recorded: &Recorded) -> io::Result<Self> {
        let mut text = Vec::new();
        if let Some(task) = recorded.task.clone() {
            line(&mut text, &Line::Task { task, replaces: recorded.replaces.clone() })?;
        }
        for entry in recorded.files.values() {
            line(&mut text, &Line::File(entry.clone()))?;
        }
        for (&slice, counts) in &recorded.slices {
            line(&mut text, &Line::Slice { slice, counts: counts.clone() })?;
        }
        // Whole or not at all: the old journal may be the only record of what is there.
        let (partial, mut file) = scratch.file()?;
        file.write_all(&text)?;
        file.sync_all()?;
        std::fs::rename(&partial, path)?;
        Ok(Self(Mutex::new(file)))
    }

    pub(super) fn file(&self, entry: &FileEntry) -> io::Result<()> {
        self.append(&Line::File(entry.clone()))
    }

    pub(super) fn slice(&self, slice: u32, counts: SliceCounts) -> io::Result<()> {
        self.append(&Line::Slice { slice, counts })
    }

    fn append(&self, entry: &Line) -> io::Result<()> {
        let mut text = Vec::new();
        line(&mut text, entry)?;
        lock(&self.0).write_all(&text)
    }
}

fn line(text: &mut Vec<u8>, line: &Line) -> io::Result<()> {
    serde_json::to_writer(&mut *text, line)?;
    text.push(b'\n');
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_cut_off_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        let task = Task { command: "slice".into(), generator: "lumislice".into(), sha256: "ab".into(), slices: [0, 3] };
        let replaces = ["slices/slice_9.png", "../outside"]
            .map(|path| FileEntry { path: path.into(), bytes: 1, sha256: "ef".into() })
            .to_vec();
        let begun = Recorded { task: Some(task.clone()), replaces, ..Default::default() };
        let journal = Journal::begin(&Scratch::new(folder.path()).unwrap(), &path, &begun).unwrap();
        let entry = FileEntry { path: "slices/slice_0.png".into(), bytes: 3, sha256: "cd".into() };
        journal.file(&entry).unwrap();
        journal.slice(0, SliceCounts::from([(1, 7)])).unwrap();
        journal.slice(1, SliceCounts::from([(2, 8)])).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in [1, 5] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let read = Recorded::read(&path).unwrap().unwrap();
            assert_eq!(read.task.as_ref(), Some(&task));
            assert_eq!(read.replaces.len(), 1, "a path out of the folder is dropped");
            assert_eq!(read.files["slices/slice_0.png"], entry);
            assert_eq!(read.slices, BTreeMap::from([(0, SliceCounts::from([(1, 7)]))]));
        }
        assert!(Recorded::read(&folder.path().join("nothing")).unwrap().is_none());
    }
}
