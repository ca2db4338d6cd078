//! A `.vti`: all of its arrays, slice by slice side by side, so that a voxel's fractions are held against its id.
//!
//! Memory is a piece of a slice and a decompressor for each array, and the blocks' sizes as the file has them.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
};

use flate2::bufread::ZlibDecoder;

use super::{
    Check,
    fractions::{Totals, misfilled},
    volumes::{Found, OTHER_HEADER, expect, nothing_left},
};
use crate::{
    container::{Content, Counts, vti},
    voxel::WHOLE,
    watch::Watch,
};

/// Voxels of a slice that are looked at together.
const PIECE: usize = 1 << 16;
/// Bytes read at a time.
const BUFFER: usize = 1 << 16;

/// A stretch of a file that is read here and there in turn.
struct Stretch<'a> {
    file: &'a File,
    at: u64,
    end: u64,
}

impl Read for Stretch<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = (buffer.len() as u64).min(self.end - self.at) as usize;
        let mut file = self.file;
        file.seek(SeekFrom::Start(self.at))?;
        let read = file.read(&mut buffer[..length])?;
        self.at += read as u64;
        Ok(read)
    }
}

/// Where the compressed slices of an array are.
struct Blocks {
    at: u64,
    /// Of each, eight bytes.
    sizes: Vec<u8>,
}

type Decoder<'a> = BufReader<ZlibDecoder<BufReader<Stretch<'a>>>>;

impl Blocks {
    /// The slice that is next.
    fn next<'a>(&mut self, file: &'a File, slice: usize) -> io::Result<Decoder<'a>> {
        let (at, size) = (self.at, self.sizes.as_chunks::<8>().0.get(slice));
        let size = size.ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?;
        self.at += u64::from_le_bytes(*size);
        let stretch = BufReader::with_capacity(BUFFER, Stretch { file, at, end: self.at });
        Ok(BufReader::with_capacity(BUFFER, ZlibDecoder::new(stretch)))
    }
}

pub(super) fn read(check: &Check<'_>, file: &File) -> io::Result<Found> {
    let content = check.manifest.content();
    let mut arrays = layout(&content, file)?;
    let mut counts = [0; 256];
    let mut totals = content.fractions.then(|| Totals::new(content.resins.len()));
    let [slices, voxels, _] = vti::block_header(&content, vti::Values::Ids);
    for slice in 0..slices {
        let mut blocks = arrays.iter_mut().map(|array| array.next(file, slice as usize));
        let mut blocks: Vec<Decoder<'_>> = blocks.by_ref().collect::<io::Result<_>>()?;
        read_slice(&content, voxels, &mut blocks, (&mut counts, totals.as_mut()), check.watch)?;
        for mut block in blocks {
            if block.read(&mut [0])? > 0 {
                return Err(io::Error::other(format!("found more voxels than {voxels} in slice {slice}")));
            }
            nothing_left(block.into_inner().into_inner())?;
        }
    }
    Ok(Found { counts, totals })
}

/// Where arrays are, if all around them is as it should be.
fn layout(content: &Content, file: &File) -> io::Result<Vec<Blocks>> {
    let values = vti::arrays(content);
    let mut preamble = vec![0; vti::preamble(content, &vec![0; values.len() - 1]).len()];
    let (start, end) = (preamble.len() as u64, file.metadata()?.len());
    let from = |at: u64| BufReader::new(Stretch { file, at: at.min(end), end });
    from(0).read_exact(&mut preamble)?;
    let (mut arrays, mut offsets, mut at) = (Vec::new(), Vec::new(), start);
    for values in values {
        offsets.push(at - start);
        let header = vti::block_header(content, values);
        let mut reader = from(at);
        expect(&mut reader, header.map(u64::to_le_bytes).as_flattened())?;
        let (mut sizes, length) = (Vec::new(), 8 * header[0]);
        if reader.take(length).read_to_end(&mut sizes)? as u64 != length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        at += 24 + length;
        arrays.push(Blocks { at, sizes });
        for size in arrays.last().map_or(&[][..], |array| array.sizes.as_chunks::<8>().0) {
            let next = at.checked_add(u64::from_le_bytes(*size)).filter(|next| *next <= end);
            at = next.ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?;
        }
    }
    if preamble != vti::preamble(content, &offsets[1..]).as_bytes() {
        return Err(io::Error::other(OTHER_HEADER));
    }
    let mut reader = from(at);
    expect(&mut reader, vti::END.as_bytes())?;
    nothing_left(reader)?;
    Ok(arrays)
}

/// Reads so many voxels of all arrays, the ids first.
fn read_slice(
    content: &Content,
    voxels: u64,
    blocks: &mut [Decoder<'_>],
    (counts, mut totals): (&mut Counts, Option<&mut Totals>),
    watch: &dyn Watch,
) -> io::Result<()> {
    let Some((first, rest)) = blocks.split_first_mut() else { return Ok(()) };
    let fewer = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => io::Error::other(format!("found fewer voxels than {voxels} in a slice")),
        _ => error,
    };
    let mut left = voxels;
    while left > 0 {
        watch.go_on().map_err(io::Error::other)?;
        let count = left.min(PIECE as u64) as usize;
        left -= count as u64;
        let (mut ids, mut numbers, mut filled) = (vec![0; count], vec![0; 4 * count], vec![0; count]);
        first.read_exact(&mut ids).map_err(fewer)?;
        ids.iter().for_each(|id| counts[usize::from(*id)] += 1);
        let Some(totals) = &mut totals else { continue };
        for (resin, block) in rest.iter_mut().enumerate() {
            block.read_exact(&mut numbers).map_err(fewer)?;
            let own = content.resins[resin].id.0;
            for ((filled, number), id) in filled.iter_mut().zip(numbers.as_chunks::<4>().0).zip(&ids) {
                *filled += totals.add(resin, *number, *id == own)?;
            }
        }
        for (filled, id) in filled.iter().zip(&ids) {
            let (expected, word) = if *id == 0 { (0, "0") } else { (u32::from(WHOLE), "1") };
            if *filled != expected {
                return Err(misfilled(*filled, word));
            }
        }
    }
    Ok(())
}
