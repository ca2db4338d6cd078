//! Searches that were made before: what a dry run or a gamut has found, a slice run need not find again.
//!
//! **In:** a question, all that the answer depends on, and a way to answer it. **Out:** the answer, from a file if the
//! same program was asked the same. An answer that cannot be kept, or read again to the bit, is found again: a cache
//! never fails.

use std::{
    env,
    fmt::Debug,
    fs,
    io::{self, ErrorKind, Write},
    path::{Path, PathBuf},
    sync::OnceLock,
    time::{Duration, SystemTime},
};

use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};

use crate::{regular_file, words::hex};

/// A folder of answers. Results do not depend on it.
///
/// Answers are those of the program that runs: of another executable, byte for byte, none are taken. A program that
/// loads the library when it runs must not keep answers by it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SearchCache {
    folder: PathBuf,
    /// Answers that are kept, and their bytes together; the oldest go first.
    most: (usize, u64),
}

/// Largest answer that is kept, bytes.
const MAX_ANSWER: u64 = 32 << 20;
/// See [`SearchCache::most`].
const MOST: (usize, u64) = (200, 128 << 20);
/// Files that are being written begin with this; what is older than a day is left of a program that was killed.
const UNFINISHED: &str = "unfinished-";
const DAY: Duration = Duration::from_secs(86_400);

impl SearchCache {
    /// Answers in `folder`, which is made when there is one to keep. Of what else lies there nothing is touched.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), most: MOST }
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
        let place = cache.and_then(|cache| Some((cache, cache.folder.join(name(kind, question)?))));
        let Some((cache, path)) = place else { return search() };
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
        let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(&self.folder)?;
        file.write_all(&[digest(&text).as_bytes(), b"\n", &text].concat())?;
        file.persist(path)?;
        self.shrink()
    }

    /// Removes the oldest answers until the rest are few and small enough, and what was never finished.
    fn shrink(&self) -> io::Result<()> {
        let now = SystemTime::now();
        let mut answers: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let (name, metadata) = (entry.file_name(), entry.metadata()?);
            let (name, written) = (name.to_string_lossy(), metadata.modified()?);
            if !metadata.is_file() {
                continue;
            }
            if name.starts_with(UNFINISHED) && now.duration_since(written).is_ok_and(|age| age > DAY) {
                removed(&entry.path())?;
            } else if is_answer(&name) {
                answers.push((written, metadata.len(), entry.path()));
            }
        }
        answers.sort_by(|a, b| b.cmp(a));
        let mut bytes = 0;
        for (at, (_, size, path)) in answers.into_iter().enumerate() {
            bytes += size;
            if at >= self.most.0 || bytes > self.most.1 {
                removed(&path)?;
            }
        }
        Ok(())
    }
}

/// Removes a file, which another program may have done.
fn removed(path: &Path) -> io::Result<()> {
    fs::remove_file(path).or_else(|error| if error.kind() == ErrorKind::NotFound { Ok(()) } else { Err(error) })
}

/// Name of the answer's file: by the question and by the program that answers, for another may find something else.
/// `None` where the program cannot be read.
fn name(kind: &str, question: &impl Debug) -> Option<String> {
    static PROGRAM: OnceLock<Option<String>> = OnceLock::new();
    let program = PROGRAM.get_or_init(|| Some(digest(&fs::read(env::current_exe().ok()?).ok()?)));
    let program = program.as_ref()?;
    Some(format!("{kind}-{}.json", digest(format!("{program} {question:?}").as_bytes())))
}

/// Whether a file is named like an answer.
fn is_answer(name: &str) -> bool {
    let parts = name.strip_suffix(".json").and_then(|name| name.rsplit_once('-'));
    parts.is_some_and(|(_, key)| key.len() == 64 && key.bytes().all(|byte| byte.is_ascii_hexdigit()))
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
        // Of answers of 70 bytes each the newest three, or two, are kept.
        for most in [(3, u64::MAX), (100, 150)] {
            let folder = tempfile::tempdir().unwrap();
            let cache = SearchCache { most, ..SearchCache::in_folder(folder.path()) };
            let path = |at: u64| folder.path().join(name("test", &at).unwrap());
            let other = folder.path().join("job.json");
            let unfinished = [1, 100_000].map(|age| (folder.path().join(format!("{UNFINISHED}{age}")), age));
            fs::write(&other, b"mine").unwrap();
            let aged = |path: &Path, seconds: u64| {
                let file = fs::File::options().write(true).open(path).unwrap();
                file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
            };
            for (path, age) in &unfinished {
                fs::write(path, b"").unwrap();
                aged(path, *age);
            }
            aged(&other, 1_000_000);
            for at in [2, 0, 3, 1] {
                SearchCache::recall(Some(&cache), "test", &at, || Ok::<_, ()>(10_000 + at)).unwrap();
                aged(&path(at), 10 * (at + 1));
            }
            SearchCache::recall(Some(&cache), "test", &9_u64, || Ok::<_, ()>(9)).unwrap();
            let kept: Vec<bool> = [9, 0, 1, 2, 3].map(|at| path(at).is_file()).to_vec();
            let expected =
                if most.0 == 3 { [true, true, true, false, false] } else { [true, true, false, false, false] };
            assert_eq!(kept, expected, "{most:?}");
            assert!(other.is_file(), "what is no answer is not touched");
            assert_eq!(unfinished.map(|(path, _)| path.is_file()), [true, false]);
        }
    }
}
