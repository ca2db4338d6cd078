//! What kind of file a picture is in, by its first bytes; names lie.

use std::io::Read;
use std::path::Path;

use crate::measure::MeasureError;

/// Kinds that are read.
pub(super) enum Container {
    Png,
    Tiff,
    Exr,
    #[cfg(feature = "raw")]
    Raw,
}

const EXPECTED: &str = "a 16-bit PNG or TIFF, an EXR, or a camera's raw file";
/// Raw files that begin as TIFF does are told by their names.
const RAW_TIFF: [&str; 6] = ["dng", "cr2", "nef", "arw", "pef", "srw"];

impl Container {
    pub(super) fn of(path: &Path) -> Result<Self, MeasureError> {
        let read = |source| MeasureError::Read { file: path.to_path_buf(), source };
        let mut start = [0; 12];
        let mut file = crate::regular_file::open(path).map_err(read)?;
        let mut length = 0;
        while length < start.len() {
            match file.read(&mut start[length..]).map_err(read)? {
                0 => break,
                read => length += read,
            }
        }
        let start = &start[..length];
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let raw_name = extension.as_deref().is_some_and(|extension| RAW_TIFF.contains(&extension));
        match start {
            [] => Err(MeasureError::frame(path, "an empty file", EXPECTED)),
            [0x89, b'P', b'N', b'G', ..] => Ok(Self::Png),
            [0x76, 0x2f, 0x31, 0x01, ..] => Ok(Self::Exr),
            [0xff, 0xd8, ..] => {
                let reason = "a JPEG, whose 8 bits are compressed with loss and curved by the camera's taste";
                Err(MeasureError::frame(path, reason, EXPECTED))
            }
            [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] if !raw_name => Ok(Self::Tiff),
            [b'I', b'I', ..] | [b'M', b'M', ..] | [_, _, _, _, b'f', b't', b'y', b'p', b'c', b'r', b'x', ..] => {
                Self::raw(path)
            }
            _ => Err(MeasureError::frame(path, "a file of another kind", EXPECTED)),
        }
    }

    #[cfg(feature = "raw")]
    fn raw(_: &Path) -> Result<Self, MeasureError> {
        Ok(Self::Raw)
    }

    #[cfg(not(feature = "raw"))]
    fn raw(path: &Path) -> Result<Self, MeasureError> {
        let expected = "a program built with `--features raw`, or the file developed without a curve to a 16-bit TIFF";
        Err(MeasureError::frame(path, "a camera's raw file", expected))
    }
}
