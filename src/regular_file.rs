//! Files that users name: opened if they are regular files, and never longer than the caller is ready for.
//!
//! Opening a pipe waits for its other end, and a device may have no end at all.

use std::{
    fs::File,
    io::{self, Error, ErrorKind, Read},
    path::Path,
};

/// Longest text that is read, bytes: materials, profiles, tables, records.
pub(crate) const MAX_TEXT: u64 = 64 << 20;

/// Opens a regular file.
///
/// # Errors
/// What the disk says; a folder, a pipe, a device.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    if found.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder, expected a file"));
    }
    if !found.is_file() {
        return Err(Error::other("it is not a regular file"));
    }
    File::open(path)
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
/// As [`read`], and bytes that are not UTF-8.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path, MAX_TEXT)?).map_err(|error| {
        let place = error.utf8_error().valid_up_to();
        Error::new(ErrorKind::InvalidData, format!("bytes that are not UTF-8 at offset {place}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_or_too_long_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "white").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"white");
        assert_eq!(read(&path, 4).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_text(&path).unwrap(), "white");
        std::fs::write(&path, b"wh\xff").unwrap();
        assert!(read_text(&path).unwrap_err().to_string().ends_with("offset 2"));
        assert_eq!(open(folder.path()).unwrap_err().kind(), ErrorKind::IsADirectory);
        assert_eq!(open(&folder.path().join("b")).unwrap_err().kind(), ErrorKind::NotFound);
        #[cfg(unix)]
        assert_eq!(open(Path::new("/dev/zero")).unwrap_err().to_string(), "it is not a regular file");
    }
}
