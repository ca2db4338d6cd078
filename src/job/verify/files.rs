//! Every listed file is there, of its size and digest; no other file is.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

use super::{Check, Finding, Verification, VerifyError};
use crate::{
    output::{FileEntry, MANIFEST, TIMINGS, is_plain},
    parallel, regular_file,
    words::hex,
};

/// Bytes read at a time.
const BUFFER: usize = 1 << 16;
/// Folders deeper than this are not looked into; lumislice makes two levels.
const MAX_FOLDERS: usize = 16;

/// Listed files that exist inside the folder, whatever is in them.
pub(super) type Sound<'a> = BTreeSet<&'a str>;

pub(super) fn check<'a>(check: &Check<'a>, result: &mut Verification) -> Result<Sound<'a>, VerifyError> {
    let files = &check.manifest.files;
    check.watch.stage("digests", files.len() as u64);
    let mut listed = BTreeSet::new();
    let mut sound = Sound::new();
    let mut unique: Vec<&FileEntry> = Vec::with_capacity(files.len());
    for file in files {
        if !is_plain(&file.path) || file.path.contains('\\') {
            result.findings.push(Finding::new(&file.path, "found a path that leaves the folder, expected one inside"));
        } else if !listed.insert(file.path.as_str()) {
            result.findings.push(Finding::new(&file.path, "listed twice, expected once"));
        } else {
            unique.push(file);
        }
    }
    let outcomes: Vec<(bool, Option<Finding>)> = parallel::map_all(&unique, |file| {
        check.watch.go_on()?;
        let outcome = match check.open(&file.path) {
            Err(problem) => (false, Some(problem)),
            Ok(opened) => (true, compare(file, opened)),
        };
        check.watch.advance(1);
        Ok((outcome.0, outcome.1.map(|problem| Finding::new(&file.path, problem))))
    })
    .into_iter()
    .collect::<Result<_, VerifyError>>()?;
    for (file, (usable, finding)) in unique.into_iter().zip(outcomes) {
        result.findings.extend(finding);
        if usable {
            sound.insert(&file.path);
        }
    }
    for extra in extras(&check.root, &listed) {
        result.findings.push(Finding::new(&extra, "found a file that the manifest does not list, expected none"));
    }
    Ok(sound)
}

impl Check<'_> {
    /// Opens a listed file, which must be a regular one inside the folder; otherwise says what is there.
    pub(super) fn open(&self, relative: &str) -> Result<File, String> {
        let path = self.root.join(relative);
        let unreadable = |error: io::Error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => "missing".to_owned(),
            _ => format!("cannot be read: {error}"),
        };
        let metadata = fs::symlink_metadata(&path).map_err(unreadable)?;
        if !metadata.is_file() {
            let found = if metadata.is_dir() {
                "a folder"
            } else if metadata.is_symlink() {
                "a symbolic link"
            } else {
                "something else"
            };
            return Err(format!("found {found}, expected a file"));
        }
        // A folder on the way may be a link to elsewhere.
        let resolved = path.canonicalize().map_err(unreadable)?;
        if !resolved.starts_with(&self.root) {
            return Err("found behind a symbolic link out of the folder, expected inside".to_owned());
        }
        regular_file::open(&resolved).map_err(unreadable)
    }
}

/// What differs between a file and its entry.
fn compare(entry: &FileEntry, mut file: File) -> Option<String> {
    let (mut hasher, mut buffer, mut bytes) = (Sha256::new(), vec![0; BUFFER], 0_u64);
    loop {
        let read = match file.read(&mut buffer) {
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Some(format!("cannot be read: {error}")),
        };
        if read == 0 {
            break;
        }
        bytes += read as u64;
        if bytes > entry.bytes {
            return Some(format!("found more than {0} bytes, expected {0}", entry.bytes));
        }
        hasher.update(&buffer[..read]);
    }
    if bytes != entry.bytes {
        return Some(format!("found {bytes} bytes, expected {}", entry.bytes));
    }
    let digest = hex(&hasher.finalize());
    (digest != entry.sha256).then(|| format!("found SHA-256 {digest}, expected {}", entry.sha256))
}

/// Files under `root` that are not `listed`, sorted, with forward slashes. Links are not followed.
fn extras(root: &Path, listed: &BTreeSet<&str>) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders: Vec<(PathBuf, String, usize)> = vec![(root.to_path_buf(), String::new(), 0)];
    while let Some((folder, prefix, level)) = folders.pop() {
        let Ok(entries) = fs::read_dir(&folder) else {
            found.push(prefix);
            continue;
        };
        for entry in entries.flatten() {
            let relative = format!("{prefix}{}", entry.file_name().to_string_lossy());
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            if is_folder && level < MAX_FOLDERS {
                folders.push((entry.path(), relative + "/", level + 1));
            } else if !listed.contains(relative.as_str()) && relative != MANIFEST && relative != TIMINGS {
                found.push(relative);
            }
        }
    }
    found.sort();
    found
}
