//! Volumes of ids: their headers are what the manifest says, and the voxels in them are as many.

use std::{
    fs::File,
    io::{self, BufReader, Read},
};

use flate2::bufread::{GzDecoder, ZlibDecoder};

use super::{Check, Finding, VerifyError, files::Sound};
use crate::{
    container::{Counts, nrrd, vti},
    job::file::OutputFormat,
    watch::Watch,
};

/// Bytes decompressed at a time.
const BUFFER: usize = 1 << 20;

pub(super) fn check(
    check: &Check<'_>,
    sound: &Sound<'_>,
    path: &str,
    format: OutputFormat,
) -> Result<Vec<Finding>, VerifyError> {
    if !sound.contains(path) || !check.has_lattice() {
        return Ok(Vec::new());
    }
    let mut counts = [0; 256];
    let counted = check.open(path).and_then(|file| {
        let file = BufReader::with_capacity(BUFFER, file);
        let counted = match format {
            OutputFormat::Vti => count_vti(check, file, &mut counts),
            _ => count_nrrd(check, file, &mut counts),
        };
        counted.map_err(|error| error.to_string())
    });
    check.watch.go_on()?;
    let problems = match counted {
        Ok(()) => check.miscounted(&counts),
        Err(problem) => vec![problem],
    };
    Ok(problems.into_iter().map(|problem| Finding::new(path, problem)).collect())
}

/// Reads text that must be `expected`.
fn expect(file: &mut impl Read, expected: &[u8]) -> io::Result<()> {
    let mut found = vec![0; expected.len()];
    file.read_exact(&mut found)?;
    if found == expected { Ok(()) } else { Err(io::Error::other("found another header than the manifest asks for")) }
}

/// Counts exactly so many ids.
fn count(mut ids: impl Read, voxels: u64, counts: &mut Counts, watch: &dyn Watch) -> io::Result<()> {
    let (mut buffer, mut left) = (vec![0; BUFFER], voxels);
    loop {
        let read = ids.read(&mut buffer)?;
        if read as u64 > left || read == 0 && left > 0 {
            return Err(io::Error::other(format!("found more or fewer voxels than {voxels}")));
        }
        if read == 0 {
            return Ok(());
        }
        watch.go_on().map_err(io::Error::other)?;
        buffer[..read].iter().for_each(|id| counts[usize::from(*id)] += 1);
        left -= read as u64;
    }
}

fn nothing_left(mut file: impl Read) -> io::Result<()> {
    match file.read(&mut [0])? {
        0 => Ok(()),
        _ => Err(io::Error::other("found bytes after the end")),
    }
}

fn count_vti(check: &Check<'_>, mut file: BufReader<File>, counts: &mut Counts) -> io::Result<()> {
    let content = check.manifest.content();
    let [nx, ny, nz] = content.lattice.dims.map(u64::from);
    let mut before = vti::preamble(&content).into_bytes();
    before.extend([nz, nx * ny, 0].iter().flat_map(|number| number.to_le_bytes()));
    expect(&mut file, &before)?;
    let mut sizes = Vec::new();
    (&mut file).take(8 * nz).read_to_end(&mut sizes)?;
    for size in sizes.as_chunks::<8>().0 {
        let mut block = ZlibDecoder::new((&mut file).take(u64::from_le_bytes(*size)));
        count(&mut block, nx * ny, counts, check.watch)?;
        nothing_left(block.into_inner())?;
    }
    expect(&mut file, vti::END.as_bytes())?;
    nothing_left(file)
}

fn count_nrrd(check: &Check<'_>, mut file: BufReader<File>, counts: &mut Counts) -> io::Result<()> {
    let content = check.manifest.content();
    expect(&mut file, nrrd::header(&content).as_bytes())?;
    let mut ids = GzDecoder::new(file);
    count(&mut ids, content.lattice.voxels(), counts, check.watch)?;
    nothing_left(ids.into_inner())
}
