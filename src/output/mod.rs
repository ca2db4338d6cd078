//! The output folder: files appear under their final name only when complete, nothing of somebody else's is replaced,
//! no link below it is followed, and one run at a time is at work in it.
//!
//! **In:** files, from any thread. **Out:** an [`OutputFolder`] with a manifest once it is finished, and until then a
//! journal of what is whole in it.

mod earlier;
mod error;
mod journal;
mod lock;
mod place;
mod scratch;

use std::{
    collections::BTreeMap,
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::Mutex,
};

use earlier::Earlier;

use crate::parallel;
pub use earlier::MAX_MANIFEST_BYTES;
pub use error::OutputError;
use error::io_error;
pub use journal::{JOURNAL, SliceCounts, Task};
use journal::{Journal, Recorded};
use lock::FolderLock;
pub use place::FileEntry;
pub(crate) use place::{digest, is_plain};
use place::{lies_at, make_folder_of};
use scratch::Scratch;
use serde::Serialize;

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

impl Existing {
    /// Replaces an earlier job's files if the user said so.
    pub fn overwrite(said: bool) -> Self {
        if said { Self::Overwrite } else { Self::Refuse }
    }
}

/// The command that a folder is written by: only its own earlier output is ever replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Owner {
    /// Its name, as manifests have it.
    pub command: &'static str,
    /// Every file it writes; with a slash at the end, every folder it writes into; with an asterisk, how names begin.
    pub names: &'static [&'static str],
}

/// Name of the list of all files.
pub const MANIFEST: &str = "manifest.json";

/// A file that grows while a job runs, out of sight until [`OutputFolder::place`] puts it under its name.
#[derive(Debug)]
pub struct Growing {
    relative: String,
    partial: PathBuf,
}

impl Growing {
    /// The name it is to have, relative to the folder.
    pub fn relative(&self) -> &str {
        &self.relative
    }
}

/// An output folder being written, held for this process alone.
#[derive(Debug)]
pub struct OutputFolder {
    root: PathBuf,
    /// Files of the job that is being replaced, still there, with what may lie under their names.
    replaceable: Mutex<BTreeMap<String, Vec<FileEntry>>>,
    /// Files of this very job that an interrupted run wrote, found whole.
    kept: Mutex<BTreeMap<String, FileEntry>>,
    written: Mutex<BTreeMap<String, FileEntry>>,
    journal: Option<Journal>,
    scratch: Scratch,
    _lock: FolderLock,
}

impl OutputFolder {
    /// Checks that `root` may be written, leaving no trace.
    ///
    /// # Errors
    /// A folder that may not be replaced, or one that the disk does not let anyone write to.
    pub fn check(root: &Path, owner: &Owner, existing: Existing) -> Result<(), OutputError> {
        let held = if root.is_dir() { Some(FolderLock::take(root)?) } else { None };
        Earlier::read(root, owner, existing)?;
        drop(held);
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

    /// Opens `root` for a run that reads `inputs`, creating it if need be. When an interrupted run is gone on with,
    /// also tells the slices whose files may be whole: [`Self::keep`] says whether they are.
    ///
    /// # Errors
    /// As [`Self::check`]; [`OutputError::AnotherJob`] when what was begun there is not `task`;
    /// [`OutputError::InputInside`] when an input is among what would be replaced.
    pub fn begin(
        root: &Path,
        owner: &Owner,
        existing: Existing,
        task: &Task,
        inputs: &[PathBuf],
    ) -> Result<(Self, BTreeMap<u32, SliceCounts>), OutputError> {
        let (mut output, mut earlier) = Self::open(root, owner, existing, inputs)?;
        let (journal, manifest) = (root.join(JOURNAL), root.join(MANIFEST));
        if existing == Existing::Resume {
            if earlier.replaces.contains_key(MANIFEST) {
                let (found, expected) = ("a finished job".to_owned(), "one that was interrupted".to_owned());
                return Err(OutputError::AnotherJob { path: manifest, found, expected });
            }
            if let Some(begun) = earlier.task.take().filter(|begun| begun != task) {
                return Err(begun.is_not(task, journal));
            }
        }
        // What another job noted of its slices says nothing of this one's.
        let (kept, slices) = match existing {
            Existing::Resume => {
                let files: Vec<_> = earlier.files.into_iter().collect();
                let whole = parallel::map_all(&files, |(_, entry)| entry.is_whole(root));
                let kept = files.into_iter().zip(whole).filter(|(_, whole)| *whole).map(|(file, _)| file);
                (kept.collect(), earlier.slices)
            }
            _ => (BTreeMap::new(), BTreeMap::new()),
        };
        let replaces = earlier.replaces.iter().filter(|(path, _)| !kept.contains_key(*path));
        let begun = Recorded {
            task: Some(task.clone()),
            replaces: replaces.flat_map(|(_, entries)| entries).cloned().collect(),
            files: kept.clone(),
            slices: slices.clone(),
        };
        let begun = Journal::begin(&output.scratch, &journal, &begun);
        output.journal = Some(begun.map_err(|source| io_error("writing", &journal, source))?);
        output.claim(earlier.replaces)?;
        output.kept = Mutex::new(kept);
        Ok((output, slices))
    }

    /// Opens `root` for files that are made at once from `inputs` and never gone on with, creating it if need be.
    ///
    /// # Errors
    /// As [`Self::begin`].
    pub fn create(root: &Path, owner: &Owner, existing: Existing, inputs: &[PathBuf]) -> Result<Self, OutputError> {
        let (output, earlier) = Self::open(root, owner, existing, inputs)?;
        output.claim(earlier.replaces)?;
        Ok(output)
    }

    /// Opens the folder of a finished job to add to it or replace some of its `files`; the rest stays.
    ///
    /// # Errors
    /// A list with a file outside the folder, and a folder in which another run is at work.
    pub fn reopen(root: &Path, files: &[FileEntry]) -> Result<Self, OutputError> {
        if let Some(odd) = files.iter().find(|file| !is_plain(&file.path)) {
            let reason = format!("it lists `{}`, which is not inside the folder", odd.path);
            return Err(OutputError::BadManifest { path: root.join(MANIFEST), reason });
        }
        let output = Self::held(root)?;
        let names = files.iter().map(|file| file.path.clone()).chain([MANIFEST.to_owned()]);
        *lock(&output.replaceable) = names.map(|name| (name, Vec::new())).collect();
        Ok(output)
    }

    fn open(
        root: &Path,
        owner: &Owner,
        existing: Existing,
        inputs: &[PathBuf],
    ) -> Result<(Self, Earlier), OutputError> {
        fs::create_dir_all(root).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => {
                OutputError::NotAFolder { path: root.to_path_buf() }
            }
            _ => io_error("creating the folder", root, error),
        })?;
        let output = Self::held(root)?;
        let earlier = Earlier::read(root, owner, existing)?;
        earlier.refuse_inputs(root, inputs)?;
        Ok((output, earlier))
    }

    /// The folder, held, with a scratch folder in it.
    fn held(root: &Path) -> Result<Self, OutputError> {
        let held = FolderLock::take(root)?;
        if held.is_certain() {
            Scratch::sweep(root);
        }
        Ok(Self {
            root: root.to_path_buf(),
            replaceable: Mutex::default(),
            kept: Mutex::default(),
            written: Mutex::default(),
            journal: None,
            scratch: Scratch::new(root).map_err(|source| io_error("writing into the folder", root, source))?,
            _lock: held,
        })
    }

    /// Takes over what may be replaced. From here on the folder does not claim to be a finished job.
    fn claim(&self, mut replaces: BTreeMap<String, Vec<FileEntry>>) -> Result<(), OutputError> {
        if replaces.remove(MANIFEST).is_some() {
            let manifest = self.root.join(MANIFEST);
            fs::remove_file(&manifest).map_err(|source| io_error("removing", &manifest, source))?;
        }
        *lock(&self.replaceable) = replaces;
        Ok(())
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Writes a file whole: under its final name there is either nothing or all of it. Subfolders are created.
    pub fn write(&self, relative: &str, content: &[u8]) -> Result<(), OutputError> {
        let entry = FileEntry::of(relative, content);
        // Noted first: whatever ends the run here, the journal knows both what lay there and what was to.
        if let Some(journal) = &self.journal {
            journal.file(&entry).map_err(|source| io_error("writing", &self.root.join(JOURNAL), source))?;
        }
        self.put(relative, content, Durable::WhenTheSystemLikes)?;
        lock(&self.written).insert(relative.to_owned(), entry);
        Ok(())
    }

    /// The content of a listed file, if it lies there with its size and digest and is not longer than `most` bytes.
    pub fn read(&self, entry: &FileEntry, most: u64) -> Option<Vec<u8>> {
        let whole = is_plain(&entry.path) && entry.bytes <= most && entry.is_whole(&self.root);
        whole.then(|| fs::read(self.root.join(&entry.path)).ok()).flatten()
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
        self.put(relative, content, Durable::WhenTheSystemLikes)
    }

    fn put(&self, relative: &str, content: &[u8], durable: Durable) -> Result<(), OutputError> {
        let path = self.root.join(relative);
        let writing = |source| io_error("writing", &path, source);
        self.make_room(relative, || FileEntry::of(relative, content))?;
        let (partial, mut file) = self.scratch.file().map_err(writing)?;
        file.write_all(content).map_err(writing)?;
        if durable == Durable::Now {
            file.sync_all().map_err(writing)?;
        }
        drop(file);
        fs::rename(&partial, &path).map_err(writing)
    }

    /// Makes the folder that a file is to lie in, and sees that nothing of somebody else's lies under its name.
    fn make_room(&self, relative: &str, entry: impl FnOnce() -> FileEntry) -> Result<(), OutputError> {
        make_folder_of(&self.root, relative)?;
        let ours = lock(&self.replaceable).remove(relative).is_some();
        // A file with the very bytes is of this job's: an earlier run ended before it could note that.
        if !ours && lies_at(&self.root, relative)?.is_some() && !entry().is_whole(&self.root) {
            return Err(OutputError::Foreign { path: self.root.join(relative) });
        }
        Ok(())
    }

    /// Begins a file that is too large to be made in memory: what is written to it lies out of sight.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn grow(&self, relative: &str) -> Result<(Growing, fs::File), OutputError> {
        let path = self.root.join(relative);
        let (partial, file) = self.scratch.seekable_file().map_err(|source| io_error("writing", &path, source))?;
        Ok((Growing { relative: relative.to_owned(), partial }, file))
    }

    /// A file without a name, for what waits to be copied into one that grows; it is gone when it is closed.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn aside(&self) -> io::Result<fs::File> {
        tempfile::tempfile_in(&self.root)
    }

    /// Puts a file that has grown under its name, as [`Self::write`] does, and lists it. It must be closed.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn place(&self, grown: Growing) -> Result<(), OutputError> {
        let Growing { relative, partial } = grown;
        let path = self.root.join(&relative);
        let failed = |action| {
            let path = path.clone();
            move |source| io_error(action, &path, source)
        };
        let bytes = fs::metadata(&partial).map_err(failed("reading"))?.len();
        let sha256 = digest(&partial).map_err(failed("reading"))?;
        let entry = FileEntry { path: relative.clone(), bytes, sha256 };
        if let Some(journal) = &self.journal {
            journal.file(&entry).map_err(|source| io_error("writing", &self.root.join(JOURNAL), source))?;
        }
        self.make_room(&relative, || entry.clone())?;
        fs::rename(&partial, &path).map_err(failed("writing"))?;
        lock(&self.written).insert(relative, entry);
        Ok(())
    }

    /// Ends a run: removes the files of the replaced job that were not written again, writes the manifest, then drops
    /// the journal.
    pub fn finish(self, manifest: &[u8]) -> Result<(), OutputError> {
        if self.journal.is_some() {
            lock(&self.replaceable).remove(JOURNAL);
        }
        self.remove_stale()?;
        self.put(MANIFEST, manifest, Durable::Now)?;
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

    /// Ends a run whose manifest need only say what was written: the list of its files, under the command of `owner`;
    /// `version` is that of the files' form.
    pub fn finish_with_list(self, owner: &Owner, version: u32) -> Result<(), OutputError> {
        let list = serde_json::json!({
            "generator": GENERATOR, "command": owner.command, "version": version, "files": self.files(),
        });
        self.finish(&pretty(&list))
    }

    /// Everything written so far, sorted by path.
    pub fn files(&self) -> Vec<FileEntry> {
        lock(&self.written).values().cloned().collect()
    }

    /// Removes the files of the replaced job that were not written again, but for those that are no longer what that
    /// job wrote.
    fn remove_stale(&self) -> Result<(), OutputError> {
        for (relative, entries) in std::mem::take(&mut *lock(&self.replaceable)) {
            let unlisted = entries.is_empty() && lies_at(&self.root, &relative)?.is_some_and(|found| found.is_file());
            if unlisted || entries.iter().any(|entry| entry.is_whole(&self.root)) {
                let path = self.root.join(relative);
                fs::remove_file(&path).map_err(|source| io_error("removing", &path, source))?;
            }
        }
        Ok(())
    }
}

/// When a file must be on the disk for good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Durable {
    WhenTheSystemLikes,
    /// Before it appears under its name.
    Now,
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

/// JSON as written to files: indented, with a newline at the end.
pub(crate) fn pretty(value: &impl Serialize) -> Vec<u8> {
    let mut text = serde_json::to_vec_pretty(value).unwrap_or_default();
    text.push(b'\n');
    text
}

/// A poisoned lock means that another worker panicked, which ends the job anyway.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
