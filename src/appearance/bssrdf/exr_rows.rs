//! Responses in a multi-layer OpenEXR file: one layer per row of texels, from the top row down in the order of the
//! file, holding that row's windows side by side. A layer is `columns · window columns` wide and `window rows` high;
//! its channels are `Y`, or `R`, `G`, `B`, or any others in alphabetical order; half or float. Millions of small
//! layers, one per texel, are what no program writes or reads.
//!
//! The file is unpacked once into a temporary file, block by block; what is in memory is the rows that are not complete
//! yet, one if the file was written row by row.

use std::{collections::BTreeMap, io::BufReader, path::Path};

use exr::{
    block::{self, reader::ChunksReader},
    error::Error as ExrError,
    meta::{attribute::SampleType, header::Header},
};
use half::f16;

use super::{
    BssrdfError,
    npy::{Element, NpyHeader},
    npz::Scratch,
    responses::Responses,
};
use crate::words::one_line;

/// Unpacks a file; `window` is the columns and rows of a window if they are not the layers' height both.
pub(super) fn unpack(path: &Path, window: Option<[usize; 2]>) -> Result<(Responses, NpyHeader), BssrdfError> {
    let file =
        crate::regular_file::open(path).map_err(|source| BssrdfError::Read { file: path.to_path_buf(), source })?;
    let reader = block::read(BufReader::new(file), true).map_err(|error| exr_fault(path, error))?;
    let headers = reader.headers().to_vec();
    let layout = Layout::of(path, &headers, window)?;
    let chunks = reader
        .filter_chunks(true, |meta, tile, block| !meta.headers[block.layer].deep && tile.is_largest_resolution_level())
        .map_err(|error| exr_fault(path, error))?;
    let mut scratch = Scratch::new()?;
    let row_values = layout.columns * layout.order.len() * layout.window[0] * layout.window[1];
    // Rows in the making, and the samples each still wants.
    let mut open: BTreeMap<usize, (Vec<f32>, usize)> = BTreeMap::new();
    let mut next = 0;
    for block in chunks.sequential_decompressor(true) {
        let block = block.map_err(|error| exr_fault(path, error))?;
        let channels = &headers[block.index.layer].channels;
        for line in block.lines(channels) {
            let (values, wanted) =
                open.entry(line.location.layer).or_insert_with(|| (vec![0.0; row_values], row_values));
            let samples = decode(line.value, channels.list[line.location.channel].sample_type);
            layout.place(line.location.channel, line.location.position.0, line.location.position.1, &samples, values);
            *wanted = wanted.saturating_sub(line.location.sample_count);
        }
        while let Some((values, _)) = open.get(&next).filter(|(_, wanted)| *wanted == 0) {
            scratch.write_values(values)?;
            open.remove(&next);
            next += 1;
        }
    }
    if next != headers.len() {
        return Err(layout_fault(path, &format!("row {next}"), "a layer that ends early".into(), "all of its pixels"));
    }
    let shape = vec![headers.len(), layout.columns, layout.order.len(), layout.window[1], layout.window[0]];
    let header = NpyHeader { element: Element::F32, big_endian: false, shape, start: 0 };
    Ok((scratch.responses(header.clone())?, header))
}

/// Where samples go.
struct Layout {
    columns: usize,
    window: [usize; 2],
    /// Place of each of the file's channels among ours.
    order: Vec<usize>,
}

impl Layout {
    fn of(path: &Path, headers: &[Header], window: Option<[usize; 2]>) -> Result<Self, BssrdfError> {
        let Some(first) = headers.first() else {
            return Err(layout_fault(path, "layers", "none".into(), "one per row of texels"));
        };
        let size = first.layer_size;
        let window = window.unwrap_or([size.1, size.1]);
        if window[1] != size.1 || window[0] == 0 || !size.0.is_multiple_of(window[0]) {
            let found = format!("{} × {} pixels for windows of {} × {}", size.0, size.1, window[0], window[1]);
            return Err(layout_fault(path, "row 0", found, "windows side by side (`window` in the header)"));
        }
        let names = |header: &Header| header.channels.list.iter().map(|c| c.name.to_string()).collect::<Vec<_>>();
        for (row, header) in headers.iter().enumerate() {
            if header.layer_size != size || names(header) != names(first) || header.deep {
                let found = format!("{} × {} pixels", header.layer_size.0, header.layer_size.1);
                return Err(layout_fault(path, &format!("row {row}"), found, "the size and channels of row 0"));
            }
        }
        // OpenEXR sorts channels by name; colour is wanted as red, green, blue.
        let found = names(first);
        let order = match found.iter().map(String::as_str).collect::<Vec<_>>()[..] {
            ["B", "G", "R"] => vec![2, 1, 0],
            _ => (0..found.len()).collect(),
        };
        Ok(Self { columns: size.0 / window[0], window, order })
    }

    /// Puts samples of one line of a layer, from pixel `x` on, into the row's windows.
    fn place(&self, channel: usize, x: usize, y: usize, samples: &[f32], values: &mut [f32]) {
        let [width, height] = self.window;
        let channels = self.order.len();
        for (x, sample) in (x..).zip(samples) {
            let (column, pixel) = (x / width, x % width);
            values[((column * channels + self.order[channel]) * height + y) * width + pixel] = *sample;
        }
    }
}

fn decode(bytes: &[u8], kind: SampleType) -> Vec<f32> {
    match kind {
        SampleType::F16 => bytes.as_chunks::<2>().0.iter().map(|b| f16::from_ne_bytes(*b).to_f32()).collect(),
        SampleType::F32 => bytes.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect(),
        SampleType::U32 => bytes.as_chunks::<4>().0.iter().map(|b| u32::from_ne_bytes(*b) as f32).collect(),
    }
}

fn layout_fault(path: &Path, place: &str, found: String, expected: &str) -> BssrdfError {
    BssrdfError::Entry { file: path.to_path_buf(), place: place.into(), found, expected: expected.into() }
}

pub(super) fn exr_fault(path: &Path, error: ExrError) -> BssrdfError {
    match error {
        ExrError::Io(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            BssrdfError::Read { file: path.to_path_buf(), source }
        }
        other => {
            let found = one_line(other);
            layout_fault(path, "OpenEXR", found, "a whole file that can be read")
        }
    }
}
