//! Files that users name: opened if they are regular files, and never longer than the caller is ready for.
//!
//! Opening a pipe waits for its other end, and a device may have no end at all. What lies under a name may be changed
//! between a look at it and its opening, so what was opened is looked at once more, and no pipe is waited for.

use std::{
    fs::{File, Metadata},
    io::{self, Error, ErrorKind, Read},
    path::Path,
};

use crate::encoding;

/// Longest text that is read, bytes: materials, profiles, tables, records.
pub(crate) const MAX_TEXT: u64 = 64 << 20;

/// Opens a regular file.
///
/// # Errors
/// What the disk says; a folder, a pipe, a device.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    // Some devices do something when they are opened.
    check(&std::fs::metadata(path)?)?;
    open_at_once(path)
}

/// Refuses what is no regular file.
fn check(found: &Metadata) -> io::Result<()> {
    if found.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder, expected a file"));
    }
    if !found.is_file() {
        return Err(Error::other("it is not a regular file"));
    }
    Ok(())
}

/// Opens whatever lies there now, waiting for nothing, and keeps it if it is a regular file.
#[cfg(unix)]
fn open_at_once(path: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NOCTTY | OFlags::NONBLOCK;
    let file = loop {
        match open(path, flags, Mode::empty()) {
            Err(rustix::io::Errno::INTR) => {}
            found => break File::from(found?),
        }
    };
    check(&file.metadata()?)?;
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(file)
}

/// Opens whatever lies there now, and keeps it if it is a regular file.
#[cfg(not(unix))]
fn open_at_once(path: &Path) -> io::Result<File> {
    let file = File::open(path)?;
    check(&file.metadata()?)?;
    Ok(file)
}

/// The whole of a regular file.
///
/// # Errors
/// As [`open`], and a file of more than `most` bytes.
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    if length <= most {
        file.take(most + 1).read_to_end(&mut bytes)?;
    }
    let length = length.max(bytes.len() as u64);
    match length <= most {
        true => Ok(bytes),
        false => Err(Error::new(ErrorKind::FileTooLarge, format!("found {length} bytes, expected at most {most}"))),
    }
}

/// The text of a regular file, at most [`MAX_TEXT`] bytes.
///
/// # Errors
/// As [`read`], and bytes that are neither UTF-8 nor UTF-16.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    let bytes = read(path, MAX_TEXT)?;
    encoding::text(&bytes).map_err(|found| Error::new(ErrorKind::InvalidData, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a look at the name did not see, because it was put there later.
    #[cfg(unix)]
    #[test]
    fn a_pipe_that_takes_a_file_s_place_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let (pipe, file) = (folder.path().join("pipe"), folder.path().join("file"));
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).unwrap();
        let (told, tells) = std::sync::mpsc::channel();
        std::thread::spawn(move || told.send(open_at_once(&pipe).map(drop)));
        let found = tells.recv_timeout(std::time::Duration::from_secs(20)).expect("it waits for the pipe's other end");
        assert_eq!(found.unwrap_err().to_string(), "it is not a regular file");
        assert_eq!(open_at_once(folder.path()).unwrap_err().kind(), ErrorKind::IsADirectory);
        std::fs::write(&file, "white").unwrap();
        let flags = rustix::fs::fcntl_getfl(open_at_once(&file).unwrap()).unwrap();
        assert!(!flags.contains(rustix::fs::OFlags::NONBLOCK));
    }

    #[test]
    fn what_is_no_file_or_too_long_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "white").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"white");
        assert_eq!(read(&path, 4).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_text(&path).unwrap(), "white");
        std::fs::write(&path, b"w\0h\0\xe9\0").unwrap();
        assert_eq!(read_text(&path).unwrap(), "whé");
        std::fs::write(&path, b"wh\xff").unwrap();
        assert!(read_text(&path).unwrap_err().to_string().ends_with("offset 2"));
        assert_eq!(open(folder.path()).unwrap_err().kind(), ErrorKind::IsADirectory);
        assert_eq!(open(&folder.path().join("b")).unwrap_err().kind(), ErrorKind::NotFound);
        #[cfg(unix)]
        assert_eq!(open(Path::new("/dev/zero")).unwrap_err().to_string(), "it is not a regular file");
    }
}
