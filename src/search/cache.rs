//! Searches that were made before: what a dry run or a gamut has found, a slice run need not find again.
//!
//! **In:** a question, all that the answer depends on, and a way to answer it. **Out:** the answer, from a file if the
//! same program was asked the same. An answer that cannot be kept, or read again to the bit, is found again: a cache
//! never fails.

use std::{
    env,
    fmt::Debug,
    fs, io,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use crate::{regular_file, words::hex};

/// A folder of answers. Results do not depend on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SearchCache {
    folder: PathBuf,
}

/// Largest answer that is kept, bytes.
const MAX_ANSWER: u64 = 32 << 20;
/// Answers that are kept, and their bytes together; the oldest go first.
const MAX_ANSWERS: usize = 200;
const MAX_BYTES: u64 = 128 << 20;

impl SearchCache {
    /// Answers in `folder`, which is made when there is one to keep.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// The answer to `question`: what was found before, or what `search` finds now. Without a cache, that.
    ///
    /// # Errors
    /// Those of `search`; what it refuses is not kept.
    pub(super) fn recall<T, E>(
        cache: Option<&Self>,
        kind: &str,
        question: &impl Debug,
        search: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E>
    where
        T: Serialize + DeserializeOwned + PartialEq,
    {
        let Some(cache) = cache else { return search() };
        let path = cache.folder.join(format!("{kind}-{}.json", key(question)));
        if let Some(found) = read(&path) {
            return Ok(found);
        }
        let found = search()?;
        // Whoever cannot keep it finds it again next time.
        let _ = cache.keep(&path, &found);
        Ok(found)
    }

    fn keep<T: Serialize + DeserializeOwned + PartialEq>(&self, path: &Path, found: &T) -> io::Result<()> {
        let text = serde_json::to_vec(found)?;
        if serde_json::from_slice::<T>(&text)? != *found || text.len() as u64 > MAX_ANSWER {
            return Ok(());
        }
        fs::create_dir_all(&self.folder)?;
        let mut file = NamedTempFile::new_in(&self.folder)?;
        io::Write::write_all(&mut file, &[digest(&text).as_bytes(), b"\n", &text].concat())?;
        file.persist(path)?;
        self.shrink()
    }

    /// Removes the oldest answers until the rest are few and small enough.
    fn shrink(&self) -> io::Result<()> {
        let mut files: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let metadata = entry.metadata()?;
            if metadata.is_file() && entry.path().extension().is_some_and(|extension| extension == "json") {
                files.push((metadata.modified()?, metadata.len(), entry.path()));
            }
        }
        files.sort_by(|a, b| b.cmp(a));
        let mut bytes = 0;
        for (at, (_, size, path)) in files.into_iter().enumerate() {
            bytes += size;
            if at >= MAX_ANSWERS || bytes > MAX_BYTES {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

/// Of the question and of the program that answers: another build may find something else.
fn key(question: &impl Debug) -> String {
    let program = env::current_exe().and_then(fs::metadata);
    let built = program.and_then(|metadata| Ok((metadata.len(), metadata.modified()?)));
    let built = built.map(|(size, at)| (size, at.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos()));
    digest(format!("{} {:?} {question:?}", env!("CARGO_PKG_VERSION"), built.ok()).as_bytes())
}

fn digest(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// What a file holds, if it is whole.
fn read<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let bytes = regular_file::read(path, MAX_ANSWER + 128).ok()?;
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    let (sum, text) = (&bytes[..end], &bytes[end + 1..]);
    (sum == digest(text).as_bytes()).then(|| serde_json::from_slice(text).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers, and how often they were searched.
    struct Asked(SearchCache, std::cell::Cell<usize>);

    impl Asked {
        fn ask(&self, question: &str, answer: f64) -> Result<Vec<f64>, String> {
            SearchCache::recall(Some(&self.0), "test", &question, || {
                self.1.set(self.1.get() + 1);
                if answer < 0.0 { Err("refused".to_owned()) } else { Ok(vec![answer, 0.1 + 0.2]) }
            })
        }
    }

    #[test]
    fn what_was_found_is_not_searched_again() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("below").join("it");
        let asked = Asked(SearchCache::in_folder(&inner), 0.into());
        let first = asked.ask("a", 1.0 / 3.0);
        assert_eq!(asked.ask("a", 7.0), first);
        assert_eq!(asked.ask("b", 7.0), Ok(vec![7.0, 0.1 + 0.2]));
        assert_eq!(asked.1.get(), 2);
        assert_eq!(asked.ask("c", -1.0), Err("refused".to_owned()));
        assert_eq!(asked.ask("c", 2.0), Ok(vec![2.0, 0.1 + 0.2]));
        // What is no number in JSON is found every time.
        assert!(asked.ask("d", f64::NAN).unwrap()[0].is_nan() && asked.ask("d", 3.0) == Ok(vec![3.0, 0.1 + 0.2]));
        // Damaged, cut short, emptied: found again.
        for damage in [&b"{}"[..], b"", b"0\n[1.0, 2.0]", &[0xff; 100]] {
            for file in fs::read_dir(&inner).unwrap() {
                fs::write(file.unwrap().path(), damage).unwrap();
            }
            assert_eq!(asked.ask("a", 4.0), Ok(vec![4.0, 0.1 + 0.2]));
        }
        // A folder that cannot be is no folder.
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        assert_eq!(Asked(SearchCache::in_folder(file), 0.into()).ask("a", 5.0), Ok(vec![5.0, 0.1 + 0.2]));
    }

    #[test]
    fn the_oldest_go() {
        let folder = tempfile::tempdir().unwrap();
        let cache = SearchCache::in_folder(folder.path());
        for at in 0..MAX_ANSWERS + 5 {
            SearchCache::recall(Some(&cache), "test", &at, || Ok::<_, ()>(at)).unwrap();
        }
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert!(left <= MAX_ANSWERS, "{left} files");
        let last = MAX_ANSWERS + 4;
        assert_eq!(SearchCache::recall(Some(&cache), "test", &last, || Err(())), Ok(last));
    }
}
