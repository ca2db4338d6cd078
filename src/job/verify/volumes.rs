//! Volumes: their headers are what the manifest says, the ids in them are as many voxels, and so are fractions.

use std::{
    fs::File,
    io::{self, BufReader, Read},
};

use flate2::bufread::GzDecoder;

use super::{
    Check, Finding, VerifyError,
    files::Sound,
    fractions::{Totals, misfilled},
    vti,
};
use crate::{
    container::{Counts, nrrd},
    voxel::WHOLE,
    watch::Watch,
};

/// Bytes decompressed at a time.
const BUFFER: usize = 1 << 20;
pub(super) const OTHER_HEADER: &str = "found another header than the manifest asks for";

/// What a file of a volume is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Vti,
    Nrrd(nrrd::Values),
}

/// What was found in a volume.
pub(super) struct Found {
    pub(super) counts: Counts,
    /// What fractions come to; `None` where there are none.
    pub(super) totals: Option<Totals>,
}

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, path: &str, kind: Kind) -> Result<Vec<Finding>, VerifyError> {
    if !sound.contains(path) || !check.has_lattice() {
        return Ok(Vec::new());
    }
    let read = check.open(path).and_then(|file| {
        let read = match kind {
            Kind::Vti => vti::read(check, &file),
            Kind::Nrrd(values) => read_nrrd(check, BufReader::with_capacity(BUFFER, file), values),
        };
        read.map_err(|error| error.to_string())
    });
    check.watch.go_on()?;
    let problems = match read {
        Ok(Found { counts, totals }) => {
            let miscounted =
                if kind == Kind::Nrrd(nrrd::Values::Fractions) { Vec::new() } else { check.miscounted(&counts) };
            let misfilled = totals.map_or_else(Vec::new, |totals| totals.problems(check.manifest));
            [miscounted, misfilled].concat()
        }
        Err(problem) => vec![problem],
    };
    Ok(problems.into_iter().map(|problem| Finding::new(path, problem)).collect())
}

/// Reads text that must be `expected`.
pub(super) fn expect(file: &mut impl Read, expected: &[u8]) -> io::Result<()> {
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

pub(super) fn nothing_left(mut file: impl Read) -> io::Result<()> {
    match file.read(&mut [0])? {
        0 => Ok(()),
        _ => Err(io::Error::other("found bytes after the end")),
    }
}

/// Reads the fractions of exactly so many voxels, those of a voxel side by side: they must fill it or leave it empty.
fn sum(mut fractions: impl Read, voxels: u64, resins: usize, watch: &dyn Watch) -> io::Result<Totals> {
    let (mut voxel, mut totals) = (vec![0; 4 * resins], Totals::new(resins));
    for n in 0..voxels {
        if n % (1 << 20) == 0 {
            watch.go_on().map_err(io::Error::other)?;
        }
        fractions.read_exact(&mut voxel).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => io::Error::other(format!("found fewer voxels than {voxels}")),
            _ => error,
        })?;
        let mut filled = 0;
        for (resin, number) in voxel.as_chunks::<4>().0.iter().enumerate() {
            filled += totals.add(resin, *number, false)?;
        }
        if filled != 0 && filled != u32::from(WHOLE) {
            return Err(misfilled(filled, "1 or 0"));
        }
    }
    match fractions.read(&mut [0])? {
        0 => Ok(totals),
        _ => Err(io::Error::other(format!("found more voxels than {voxels}"))),
    }
}

fn read_nrrd(check: &Check<'_>, mut file: BufReader<File>, values: nrrd::Values) -> io::Result<Found> {
    let content = check.manifest.content();
    expect(&mut file, nrrd::header(&content, values).as_bytes())?;
    let (mut counts, mut totals) = ([0; 256], None);
    let mut numbers = BufReader::with_capacity(BUFFER, GzDecoder::new(file));
    let voxels = content.lattice.voxels();
    match values {
        nrrd::Values::Ids => count(&mut numbers, voxels, &mut counts, check.watch)?,
        nrrd::Values::Fractions => totals = Some(sum(&mut numbers, voxels, content.resins.len(), check.watch)?),
    }
    nothing_left(numbers.into_inner().into_inner())?;
    Ok(Found { counts, totals })
}
