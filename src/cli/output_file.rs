//! A file the user named: opened before long work, under its name only when whole.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::Context;
use tempfile::NamedTempFile;

/// A file to be written; dropped unfinished, it leaves no trace.
pub struct OutputFile {
    path: PathBuf,
    partial: NamedTempFile,
}

impl OutputFile {
    /// Checks that `path` can be written and reserves it.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let place = || format!("{}: writing failed", path.display());
        if path.is_dir() {
            anyhow::bail!("{}: found a folder, expected the name of a file", path.display());
        }
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            // Not the private mode of temporary files, but what the user's umask leaves of this one.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let partial = builder.prefix(".lumislice-").suffix(".part").tempfile_in(folder).with_context(place)?;
        Ok(Self { path: path.to_owned(), partial })
    }

    /// Writes the whole file, in place of an older one.
    pub fn finish(mut self, content: &[u8]) -> anyhow::Result<()> {
        let place = || format!("{}: writing failed", self.path.display());
        self.partial.write_all(content).with_context(place)?;
        self.partial.persist(&self.path).map_err(|error| io::Error::from(error)).with_context(place)?;
        Ok(())
    }
}
