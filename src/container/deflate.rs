//! Compression, fast rather than tight: rows of ids are long runs.

use std::io::{self, Write};

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

/// `bytes` as blocks of a deflate stream that is not ended, and that needs nothing of what came before it.
pub(super) fn part(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut compress = Compress::new(Compression::fast(), false);
    let mut out = Vec::with_capacity(bytes.len() / 16 + 1024);
    loop {
        let taken = compress.total_in() as usize;
        let before = out.len();
        let status = compress.compress_vec(&bytes[taken..], &mut out, FlushCompress::Full).map_err(io::Error::other)?;
        // A flush is whole once it leaves room.
        if compress.total_in() as usize == bytes.len() && out.len() < out.capacity() {
            return Ok(out);
        }
        if status == Status::BufError && out.len() == before && out.len() < out.capacity() {
            return Err(io::Error::other("the compressor makes no headway"));
        }
        out.reserve(out.capacity().max(1024));
    }
}
