//! Response windows on disk, read a row of texels at a time.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::{BssrdfError, npy::NpyHeader};
use crate::colour::LUMINANCE;

/// An array `[row][column][channel][window row][window column]` in a file.
#[derive(Debug)]
pub struct Responses {
    path: PathBuf,
    header: NpyHeader,
    /// Rows, columns, channels as stored, pixels of a window.
    shape: [usize; 4],
    /// Unpacked by us: removed with this.
    scratch: Option<NamedTempFile>,
}

impl Responses {
    /// Takes the array in `path`; `scratch` keeps a temporary file alive.
    pub(super) fn new(path: PathBuf, header: NpyHeader, scratch: Option<NamedTempFile>) -> Self {
        let shape = match *header.shape.as_slice() {
            [rows, columns, window_rows, window_columns] => [rows, columns, 1, window_rows * window_columns],
            [rows, columns, channels, window_rows, window_columns] => {
                [rows, columns, channels, window_rows * window_columns]
            }
            _ => [0; 4], // refused by whoever opens the dataset
        };
        Self { path, header, shape, scratch }
    }

    /// Whether values are read from a working copy.
    pub fn is_scratch(&self) -> bool {
        self.scratch.is_some()
    }

    /// A reader with a file handle and buffers of its own.
    ///
    /// # Errors
    /// [`BssrdfError::Read`] if the file has gone.
    pub fn reader(&self) -> Result<RowReader<'_>, BssrdfError> {
        let file = crate::regular_file::open(&self.path).map_err(|source| self.fault(source))?;
        Ok(RowReader { responses: self, file, bytes: Vec::new(), values: Vec::new() })
    }

    fn fault(&self, source: io::Error) -> BssrdfError {
        BssrdfError::Read { file: self.path.clone(), source }
    }

    /// The file values are read from.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Which of the stored channels a row is wanted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// One as it is stored.
    Stored(usize),
    /// [`LUMINANCE`] of three.
    Luminance,
}

/// Reads rows of windows.
#[derive(Debug)]
pub struct RowReader<'a> {
    responses: &'a Responses,
    file: File,
    bytes: Vec<u8>,
    values: Vec<f32>,
}

/// Texels whose windows are turned at once: as many as a cache line has floats.
const BLOCK: usize = 16;

impl RowReader<'_> {
    /// Reads the windows of one row of texels into `out`, window pixel by window pixel: `out[pixel · columns +
    /// column]`.
    ///
    /// # Errors
    /// [`BssrdfError::Read`].
    pub fn read(&mut self, row: usize, channel: Channel, out: &mut Vec<f32>) -> Result<(), BssrdfError> {
        let [_, columns, channels, pixels] = self.responses.shape;
        let header = &self.responses.header;
        let values = columns * channels * pixels;
        let bytes = values * header.element.bytes();
        self.bytes.resize(bytes, 0);
        self.values.resize(values, 0.0);
        let start = header.start + row as u64 * bytes as u64;
        let read = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.read_exact(&mut self.bytes));
        read.map_err(|source| self.responses.fault(source))?;
        header.decode(&self.bytes, &mut self.values);
        out.resize(columns * pixels, 0.0);
        let windows = &self.values;
        for first in (0..columns).step_by(BLOCK) {
            let block = first..columns.min(first + BLOCK);
            for pixel in 0..pixels {
                let at = |column: usize, channel: usize| windows[(column * channels + channel) * pixels + pixel];
                let texels = out[pixel * columns + block.start..pixel * columns + block.end].iter_mut();
                for (out, column) in texels.zip(block.clone()) {
                    *out = match channel {
                        Channel::Stored(channel) => at(column, channel),
                        Channel::Luminance => (0..3).map(|c| LUMINANCE[c] as f32 * at(column, c)).sum(),
                    };
                }
            }
        }
        Ok(())
    }
}
