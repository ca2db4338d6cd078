//! Volumes: their headers are what the manifest says, the ids in them are as many voxels, and fractions fill as many.

use std::{
    fs::File,
    io::{self, BufReader, Read},
};

use flate2::bufread::{GzDecoder, ZlibDecoder};

use super::{Check, Finding, VerifyError, files::Sound};
use crate::{
    container::{Counts, nrrd, vti},
    voxel::WHOLE,
    watch::Watch,
};

/// Bytes decompressed at a time.
const BUFFER: usize = 1 << 20;
const OTHER_HEADER: &str = "found another header than the manifest asks for";

/// What a file of a volume is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Vti,
    Nrrd(nrrd::Values),
}

/// What was found in a volume.
struct Found {
    counts: Counts,
    /// Voxels that fractions fill, in units of 1 / [`WHOLE`]; `None` where there are none.
    filled: Option<u64>,
}

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, path: &str, kind: Kind) -> Result<Vec<Finding>, VerifyError> {
    if !sound.contains(path) || !check.has_lattice() {
        return Ok(Vec::new());
    }
    let read = check.open(path).and_then(|file| {
        let file = BufReader::with_capacity(BUFFER, file);
        let read = match kind {
            Kind::Vti => read_vti(check, file),
            Kind::Nrrd(values) => read_nrrd(check, file, values),
        };
        read.map_err(|error| error.to_string())
    });
    check.watch.go_on()?;
    let problems = match read {
        Ok(Found { counts, filled }) => {
            let miscounted =
                if kind == Kind::Nrrd(nrrd::Values::Fractions) { Vec::new() } else { check.miscounted(&counts) };
            miscounted.into_iter().chain(filled.and_then(|filled| misfilled(check, filled))).collect()
        }
        Err(problem) => vec![problem],
    };
    Ok(problems.into_iter().map(|problem| Finding::new(path, problem)).collect())
}

/// What is said where fractions fill other voxels than the manifest has, support among them.
fn misfilled(check: &Check<'_>, filled: u64) -> Option<String> {
    let expected: u64 = check.manifest.materials.iter().map(|material| material.voxels).sum();
    (filled != expected.saturating_mul(WHOLE.into())).then(|| {
        let filled = filled as f64 / f64::from(WHOLE);
        format!("found fractions that fill {filled} voxels, the manifest has {expected}")
    })
}

/// Reads text that must be `expected`.
fn expect(file: &mut impl Read, expected: &[u8]) -> io::Result<()> {
    let mut found = vec![0; expected.len()];
    file.read_exact(&mut found)?;
    if found == expected { Ok(()) } else { Err(io::Error::other(OTHER_HEADER)) }
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

/// Sums up exactly so many fractions, in units of 1 / [`WHOLE`]. Those of a voxel lie side by side, `together` of
/// them; where that is more than one they must fill it or leave it empty.
fn sum(mut fractions: impl Read, voxels: u64, together: usize, watch: &dyn Watch) -> io::Result<u64> {
    let (mut voxel, mut total) = (vec![0; 4 * together], 0);
    for n in 0..voxels {
        if n % (1 << 20) == 0 {
            watch.go_on().map_err(io::Error::other)?;
        }
        fractions.read_exact(&mut voxel).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => io::Error::other(format!("found fewer voxels than {voxels}")),
            _ => error,
        })?;
        let mut filled = 0;
        for number in voxel.as_chunks::<4>().0 {
            let units = f32::from_le_bytes(*number) * f32::from(WHOLE);
            if !(0.0..=f32::from(WHOLE)).contains(&units) {
                let found = units / f32::from(WHOLE);
                return Err(io::Error::other(format!("found the fraction {found}, expected one from 0 to 1")));
            }
            filled += units.round() as u64;
        }
        if together > 1 && filled != 0 && filled != u64::from(WHOLE) {
            let found = filled as f64 / f64::from(WHOLE);
            return Err(io::Error::other(format!("found fractions of a voxel that sum to {found}, expected 1 or 0")));
        }
        total += filled;
    }
    match fractions.read(&mut [0])? {
        0 => Ok(total),
        _ => Err(io::Error::other(format!("found more voxels than {voxels}"))),
    }
}

fn read_vti(check: &Check<'_>, mut file: BufReader<File>) -> io::Result<Found> {
    let content = check.manifest.content();
    let arrays = vti::arrays(&content);
    let (mut offsets, mut end) = (Vec::new(), 0);
    let mut preamble = vec![0; vti::preamble(&content, &vec![0; arrays.len() - 1]).len()];
    file.read_exact(&mut preamble)?;
    let (mut counts, mut filled) = ([0; 256], None);
    for values in arrays {
        if values != vti::Values::Ids {
            offsets.push(end);
        }
        let header = vti::block_header(&content, values);
        let [blocks, bytes, _] = header;
        expect(&mut file, header.map(u64::to_le_bytes).as_flattened())?;
        let mut sizes = Vec::new();
        (&mut file).take(8 * blocks).read_to_end(&mut sizes)?;
        end += 24 + sizes.len() as u64;
        for size in sizes.as_chunks::<8>().0 {
            let size = u64::from_le_bytes(*size);
            let mut block = BufReader::with_capacity(BUFFER, ZlibDecoder::new((&mut file).take(size)));
            match values {
                vti::Values::Ids => count(&mut block, bytes, &mut counts, check.watch)?,
                vti::Values::Fraction(_) => {
                    *filled.get_or_insert(0) += sum(&mut block, bytes / values.bytes(), 1, check.watch)?;
                }
            }
            nothing_left(block.into_inner().into_inner())?;
            end += size;
        }
    }
    if preamble != vti::preamble(&content, &offsets).as_bytes() {
        return Err(io::Error::other(OTHER_HEADER));
    }
    expect(&mut file, vti::END.as_bytes())?;
    nothing_left(file)?;
    Ok(Found { counts, filled })
}

fn read_nrrd(check: &Check<'_>, mut file: BufReader<File>, values: nrrd::Values) -> io::Result<Found> {
    let content = check.manifest.content();
    expect(&mut file, nrrd::header(&content, values).as_bytes())?;
    let (mut counts, mut filled) = ([0; 256], None);
    let mut numbers = BufReader::with_capacity(BUFFER, GzDecoder::new(file));
    let voxels = content.lattice.voxels();
    match values {
        nrrd::Values::Ids => count(&mut numbers, voxels, &mut counts, check.watch)?,
        nrrd::Values::Fractions => filled = Some(sum(&mut numbers, voxels, content.resins.len(), check.watch)?),
    }
    nothing_left(numbers.into_inner().into_inner())?;
    Ok(Found { counts, filled })
}
