//! Compression, fast rather than tight: rows of ids are long runs.

use std::{
    cell::RefCell,
    io::{self, Write},
};

use flate2::{Compress, Compression, FlushCompress, Status, write::ZlibEncoder};

/// What a gzip stream begins with: deflate, no name, no date, no system.
pub(super) const GZIP_HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff];

/// A last block of nothing, which ends a stream of [`part`]s.
pub(super) const END_OF_STREAM: [u8; 2] = [3, 0];

/// A whole zlib stream of `bytes`.
pub(super) fn zlib(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len() / 16 + 64), Compression::fast());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// The same of bytes that `rows` hands on bit by bit.
pub(super) fn zlib_of_rows(
    rows: impl FnOnce(&mut dyn FnMut(&[u8]) -> io::Result<()>) -> io::Result<()>,
) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    rows(&mut |row| encoder.write_all(row))?;
    encoder.finish()
}

thread_local! {
    /// What [`zlib_of_few`] works with. Making it takes longer than to compress a kilobyte: it has tables of 300 kB.
    static FEW: RefCell<Compress> = RefCell::new(Compress::new(Compression::fast(), true));
}

/// The same as [`zlib`] where there are many streams of a few kilobytes.
pub(super) fn zlib_of_few(bytes: &[u8]) -> io::Result<Vec<u8>> {
    FEW.with_borrow_mut(|compress| {
        compress.reset();
        // Bytes that cannot be compressed are stored, in a block each 16 kB or so, with 5 bytes each.
        let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 512 + 64);
        match compress.compress_vec(bytes, &mut out, FlushCompress::Finish) {
            Ok(Status::StreamEnd) => Ok(out),
            Ok(_) => zlib(bytes),
            Err(error) => Err(io::Error::other(error)),
        }
    })
}

/// Blocks of a deflate stream that is not ended, and that needs nothing of what came before it.
pub(super) struct Part {
    compress: Compress,
    out: Vec<u8>,
}

impl Part {
    /// One of nothing.
    pub fn new() -> Self {
        Self { compress: Compress::new(Compression::fast(), false), out: Vec::with_capacity(1 << 12) }
    }

    /// Takes in more.
    pub fn push(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.feed(bytes, FlushCompress::None)
    }

    /// All that was taken in, ended on a whole byte.
    pub fn finish(mut self) -> io::Result<Vec<u8>> {
        self.feed(&[], FlushCompress::Full)?;
        Ok(self.out)
    }

    fn feed(&mut self, bytes: &[u8], flush: FlushCompress) -> io::Result<()> {
        let Self { compress, out } = self;
        let first = compress.total_in();
        loop {
            let taken = (compress.total_in() - first) as usize;
            let before = out.len();
            let status = compress.compress_vec(&bytes[taken..], out, flush).map_err(io::Error::other)?;
            // A flush is whole once it leaves room.
            if (compress.total_in() - first) as usize == bytes.len() && out.len() < out.capacity() {
                return Ok(());
            }
            if status == Status::BufError && out.len() == before && out.len() < out.capacity() {
                return Err(io::Error::other("the compressor makes no headway"));
            }
            out.reserve(out.capacity().max(1024));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn streams_are_the_same_whatever_was_compressed_before() {
        let scattered = |length: usize, seed: u64| -> Vec<u8> {
            let next = |state: &u64| Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
            std::iter::successors(Some(seed), next).map(|state| (state >> 56) as u8).take(length).collect()
        };
        for length in [0, 1, 2, 7, 511, 512, 1024, 2048, 100_000] {
            for plain in [vec![3; length], scattered(length, length as u64), (0..length).map(|n| n as u8).collect()] {
                let packed = zlib_of_few(&plain).unwrap();
                let mut back = Vec::new();
                flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut back).unwrap();
                assert!(back == plain, "{length}");
                let fresh = std::thread::spawn(move || zlib_of_few(&plain).unwrap()).join().unwrap();
                assert!(fresh == packed, "{length}");
            }
        }
    }

    #[test]
    fn parts_join_to_one_stream_however_they_were_taken_in() {
        let plain: Vec<u8> = (0..300_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8 & 0x1f).collect();
        for at_once in [1000, 4096, 300_000] {
            let mut stream = Vec::new();
            for half in plain.chunks(150_000) {
                let mut part = Part::new();
                half.chunks(at_once).for_each(|bytes| part.push(bytes).unwrap());
                stream.extend(part.finish().unwrap());
            }
            stream.extend(END_OF_STREAM);
            let mut back = Vec::new();
            flate2::read::DeflateDecoder::new(&stream[..]).read_to_end(&mut back).unwrap();
            assert!(back == plain, "{at_once}");
            let rows = |take: &mut dyn FnMut(&[u8]) -> io::Result<()>| plain.chunks(at_once).try_for_each(take);
            let mut back = Vec::new();
            flate2::read::ZlibDecoder::new(&zlib_of_rows(rows).unwrap()[..]).read_to_end(&mut back).unwrap();
            assert!(back == plain, "{at_once}");
        }
    }
}
