//! A file the user named: opened before long work, under its name only when whole.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::{
    Result,
    failure::{Failure, refuse},
};

/// A file to be written; dropped unfinished, it leaves no trace.
pub struct OutputFile {
    path: PathBuf,
    partial: NamedTempFile,
}

impl OutputFile {
    /// Checks that `path` can be written and reserves it.
    pub fn open(path: &Path) -> Result<Self> {
        let writing = |error| Failure::writing(path.display(), error);
        if path.is_dir() {
            refuse!("{}: found a folder, expected the name of a file", path.display());
        }
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            // Not the private mode of temporary files, but what the user's umask leaves of this one.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let partial = builder.prefix(".lumislice-").suffix(".part").tempfile_in(folder).map_err(writing)?;
        Ok(Self { path: path.to_owned(), partial })
    }

    /// Writes the whole file, in place of an older one.
    pub fn finish(mut self, content: &[u8]) -> Result<()> {
        let writing = |error| Failure::writing(self.path.display(), error);
        self.partial.write_all(content).map_err(writing)?;
        self.partial.persist(&self.path).map_err(|error| writing(error.error))?;
        Ok(())
    }
}
