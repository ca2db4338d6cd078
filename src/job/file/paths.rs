//! Input paths, relative to the job file, and the job's own name.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::error::JobError;
use super::read::{Result, Value};
use crate::regular_file;
use crate::words::{MAX_FILE_NAME, excerpt, is_device_name, path_line};

/// A file or folder that the job reads. It was there when the job was loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputPath {
    /// As the job writes it, with the job's separators.
    pub written: String,
    /// Resolved against the job file's folder; what to open.
    pub path: PathBuf,
}

impl AsRef<Path> for InputPath {
    fn as_ref(&self) -> &Path {
        &self.path
    }
}

impl InputPath {
    /// The path as a manifest may show it: as written, or only the file's name where the job writes an absolute path
    /// (the same job must give the same manifest on another machine).
    pub fn shown(&self) -> String {
        let written = Path::new(&self.written);
        match written.file_name() {
            Some(name) if written.has_root() => name.to_string_lossy().into_owned(),
            _ => self.written.clone(),
        }
    }

    /// The path, as a manifest may show it, of a file that this one names: relative to where this one is shown, or only
    /// its name where it lies elsewhere.
    pub fn beside(&self, companion: &Path) -> String {
        let shown = self.shown();
        let folder = Path::new(&shown).parent().unwrap_or(Path::new(""));
        let relative = self.path.parent().and_then(|parent| companion.strip_prefix(parent).ok());
        match (relative, companion.file_name()) {
            (Some(relative), _) if !relative.has_root() => folder.join(relative).to_string_lossy().into_owned(),
            (_, name) => name.unwrap_or_default().to_string_lossy().into_owned(),
        }
    }
}

/// What an input path must lead to.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    File,
    Folder,
}

impl Value<'_> {
    /// The path of a file that can be opened; `expected` says what it should be, as "a mesh file".
    pub fn file(&self, expected: &'static str) -> Result<InputPath> {
        self.input(expected, Kind::File)
    }

    /// The path of a folder.
    pub fn folder(&self, expected: &'static str) -> Result<InputPath> {
        self.input(expected, Kind::Folder)
    }

    fn input(&self, expected: &'static str, kind: Kind) -> Result<InputPath> {
        let written = self.text(&format!("the path of {expected}"))?;
        if written.trim().is_empty() {
            return Err(self.refuse(format!("the path of {expected}")));
        }
        let path = self.base().join(written);
        match problem(&path, kind) {
            None => Ok(InputPath { written: written.to_owned(), path }),
            Some(problem) => Err(JobError::Input {
                place: self.place(),
                key: self.key().to_owned(),
                found: excerpt(written).into(),
                problem,
                expected,
                looked_at: path_line(&path).into(),
            }),
        }
    }
}

/// Why `path` cannot be read as a `kind`.
fn problem(path: &Path, kind: Kind) -> Option<String> {
    let words = |error: std::io::Error| match error.kind() {
        ErrorKind::NotFound => "which does not exist".to_owned(),
        ErrorKind::PermissionDenied => "which may not be read".to_owned(),
        _ => format!("which cannot be opened ({})", excerpt(&error.to_string())),
    };
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(error) => return Some(words(error)),
    };
    match kind {
        Kind::File if found.is_dir() => Some("which is a folder".to_owned()),
        // Opening a pipe would wait for its other end.
        Kind::File if !found.is_file() => Some("which is not a regular file".to_owned()),
        Kind::File => regular_file::open(path).err().map(words),
        Kind::Folder if !found.is_dir() => Some("which is not a folder".to_owned()),
        Kind::Folder => fs::read_dir(path).err().map(words),
    }
}

/// Longest job name, characters.
const MAX_NAME: usize = 60;

/// The job's name: its file's stem, made fit to be part of a file name on every system. Never empty, never `.` or
/// `..`, without separators and control characters.
pub(super) fn job_name(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut bytes = 0;
    let fits = |c: &char| {
        bytes += c.len_utf8();
        bytes <= MAX_FILE_NAME
    };
    let safe: String = stem
        .chars()
        .take(MAX_NAME)
        .take_while(fits)
        .map(|c| if c.is_control() || r#"/\:*?"<>|"#.contains(c) { '_' } else { c })
        .collect();
    let safe = safe.trim_matches(|c: char| c == '.' || c.is_whitespace());
    match safe {
        "" => "job".to_owned(),
        // Before the first dot: what follows it does not count.
        device if is_device_name(device) => {
            let (stem, rest) = device.split_at(device.find('.').unwrap_or(device.len()));
            format!("{stem}_{rest}")
        }
        safe => safe.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_fit_for_files() {
        for (path, name) in [
            ("dir/rabbit.toml", "rabbit"),
            ("rabbit", "rabbit"),
            ("..", "job"),
            ("", "job"),
            ("/", "job"),
            ("...toml", "job"),
            (" .toml", "job"),
            ("a\\b:c\n.toml", "a_b_c_"),
            ("v1.2.toml", "v1.2"),
            ("häschen.toml", "häschen"),
            ("con.toml", "con_"),
            ("Lpt1.x.toml", "Lpt1_.x"),
            ("console.toml", "console"),
        ] {
            assert_eq!(job_name(Path::new(path)), name, "{path:?}");
        }
        assert_eq!(job_name(Path::new(&"x".repeat(300))).len(), MAX_NAME);
        assert_eq!(job_name(Path::new(&"\u{1f407}".repeat(60))).len(), MAX_FILE_NAME);
    }

    #[test]
    fn an_absolute_path_shows_only_its_file() {
        let shown = |written: &str| InputPath { written: written.into(), path: written.into() }.shown();
        assert_eq!(shown("../meshes/a.glb"), "../meshes/a.glb");
        assert_eq!(shown("/home/anna/a.glb"), "a.glb");
        let mesh = |written: &str, path: &str| InputPath { written: written.into(), path: path.into() };
        let beside = |mesh: InputPath, companion: &str| mesh.beside(Path::new(companion));
        assert_eq!(beside(mesh("../m/a.obj", "/job/../m/a.obj"), "/job/../m/t/a.png"), "../m/t/a.png");
        assert_eq!(beside(mesh("/home/anna/a.obj", "/home/anna/a.obj"), "/home/anna/a.mtl"), "a.mtl");
        assert_eq!(beside(mesh("a.obj", "a.obj"), "/home/anna/a.png"), "a.png");
    }
}
