//! GrabCAD's container: the parts it must have, its description, and every slice in it.

use std::{
    fs::File,
    io::{BufReader, Cursor, Read},
    path::Path,
};

use sha2::{Digest, Sha256};
use zip::ZipArchive;

use super::{Check, Finding, VerifyError, files::Sound};
use crate::{
    container::{Counts, gcvf},
    job::run::slice_path,
    parallel,
    preview::{SliceColours, decode_slice},
    words::hex,
};

/// Slices read before they are decoded together.
const BATCH: usize = 32;
/// Longest part that is read, bytes.
const MAX_PART: u64 = 1 << 30;

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, path: &str) -> Result<Vec<Finding>, VerifyError> {
    if !sound.contains(path) || !check.has_lattice() {
        return Ok(Vec::new());
    }
    let archive = check.open(path).and_then(|file| {
        ZipArchive::new(BufReader::new(file)).map_err(|error| format!("cannot be read as a zip: {error}"))
    });
    let problems = match archive {
        Err(problem) => vec![problem],
        Ok(mut archive) => Parts { check, archive: &mut archive }.problems()?,
    };
    Ok(problems.into_iter().map(|problem| Finding::new(path, problem)).collect())
}

struct Parts<'a, 'b> {
    check: &'a Check<'b>,
    archive: &'a mut ZipArchive<BufReader<File>>,
}

impl Parts<'_, '_> {
    fn problems(mut self) -> Result<Vec<String>, VerifyError> {
        let manifest = self.check.manifest;
        let content = manifest.content();
        let mut problems = Vec::new();
        let slices = content.lattice.dims[2];
        let parts = [gcvf::CONFIG, gcvf::MESH, gcvf::BOX, gcvf::HEIGHTS];
        let expected = slices as usize + parts.len();
        if self.archive.len() != expected {
            problems.push(format!("found {} parts, expected {expected}", self.archive.len()));
        }
        let counts = manifest.counts();
        let Some(resolution) = gcvf::Resolution::of(&content.lattice) else {
            problems.push("found a pitch that the format does not hold, expected whole dots per inch".to_owned());
            return Ok(problems);
        };
        let config = gcvf::config(&content, resolution, &counts);
        match self.part(gcvf::CONFIG) {
            Ok(found) if found == config.as_bytes() => {}
            Ok(_) => {
                problems.push(format!("{}: found another text, expected what the manifest says", gcvf::CONFIG));
            }
            Err(problem) => problems.push(problem),
        }
        problems.extend(self.solid().err());
        let heights = match self.slices(&mut problems)? {
            Some(heights) => heights,
            None => return Ok(problems),
        };
        problems.extend(self.heights(&heights).err());
        Ok(problems)
    }

    fn part(&mut self, name: &str) -> Result<Vec<u8>, String> {
        let part = self.archive.by_name(name).map_err(|error| format!("{name}: cannot be read: {error}"))?;
        let mut bytes = Vec::new();
        part.take(MAX_PART + 1).read_to_end(&mut bytes).map_err(|error| format!("{name}: cannot be read: {error}"))?;
        if bytes.len() as u64 > MAX_PART { Err(format!("{name}: found more than {MAX_PART} bytes")) } else { Ok(bytes) }
    }

    /// The surface and its box: numbers within the lattice.
    fn solid(&mut self) -> Result<(), String> {
        let number = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
        let mesh = self.part(gcvf::MESH)?;
        let corners = self.part(gcvf::BOX)?;
        let lattice = self.check.manifest.lattice.lattice();
        let within = |axis: usize, value: f64| {
            let far = f64::from(lattice.dims[axis]) * lattice.pitch[axis];
            (-1e-4..=far * (1.0 + 1e-6) + 1e-4).contains(&(value - lattice.origin[axis]))
        };
        let numbers: Vec<f64> = corners.as_chunks::<4>().0.iter().map(number).collect();
        let sound = corners.len() == 24
            && (0..3).all(|axis| {
                numbers[axis] < numbers[axis + 3] && within(axis, numbers[axis]) && within(axis, numbers[axis + 3])
            });
        if !sound {
            return Err(format!("{}: found {numbers:?}, expected two corners within the lattice", gcvf::BOX));
        }
        let triangles = mesh.get(80..84).and_then(|count| count.try_into().ok()).map_or(0, u32::from_le_bytes);
        if triangles == 0 || mesh.len() as u64 != 84 + 50 * u64::from(triangles) {
            return Err(format!("{}: found {} bytes, expected a binary STL file", gcvf::MESH, mesh.len()));
        }
        for triangle in mesh[84..].chunks(50) {
            let corners = triangle[12..48].as_chunks::<4>().0;
            if !corners.iter().enumerate().all(|(n, bytes)| within(n % 3, number(bytes))) {
                return Err(format!("{}: found a triangle beyond the lattice, expected it inside", gcvf::MESH));
            }
        }
        Ok(())
    }

    /// Reads all slices and counts their voxels; one more than the highest printed slice of every column, row 0 on top.
    fn slices(&mut self, problems: &mut Vec<String>) -> Result<Option<Vec<u32>>, VerifyError> {
        let manifest = self.check.manifest;
        let lattice = manifest.lattice.lattice();
        let listed: std::collections::HashMap<&str, &str> =
            manifest.files.iter().map(|file| (file.path.as_str(), file.sha256.as_str())).collect();
        let colours = SliceColours::new(manifest.materials.iter().map(|material| (material.rgba, material.id)));
        let mut heights = vec![0_u32; lattice.dims[0] as usize * lattice.dims[1] as usize];
        let mut counts: Counts = [0; 256];
        let all: Vec<u32> = (0..lattice.dims[2]).collect();
        self.check.watch.stage("slices of containers", all.len() as u64);
        for batch in all.chunks(BATCH) {
            let parts: Vec<_> = batch.iter().map(|&k| self.part(&gcvf::slice_name(k))).collect();
            let read = |(k, part): (&u32, &Result<Vec<u8>, String>)| {
                let (name, png) = (gcvf::slice_name(*k), part.as_ref().map_err(String::clone)?);
                let twin = slice_path(*k);
                if let Some(sha256) = listed.get(twin.as_str())
                    && *sha256 != hex(&Sha256::digest(png))
                {
                    return Err(format!("{name}: found another image, expected that of {twin}"));
                }
                decode_slice(Path::new(&name), Cursor::new(png), &lattice, &colours).map_err(|error| error.to_string())
            };
            let decoded: Vec<Result<Vec<u8>, String>> = parallel::map(batch.len(), |n| read((&batch[n], &parts[n])));
            self.check.watch.go_on()?;
            for (k, ids) in batch.iter().zip(decoded) {
                let ids = match ids {
                    Ok(ids) => ids,
                    Err(problem) => {
                        problems.push(problem);
                        return Ok(None);
                    }
                };
                for (id, height) in ids.into_iter().zip(&mut heights) {
                    counts[usize::from(id)] += 1;
                    if id != 0 {
                        *height = k + 1;
                    }
                }
            }
            self.check.watch.advance(batch.len() as u64);
        }
        problems.extend(self.check.miscounted(&counts));
        Ok(Some(heights))
    }

    fn heights(&mut self, expected: &[u32]) -> Result<(), String> {
        let name = gcvf::HEIGHTS;
        let bytes = self.part(name)?;
        let undecodable = |error: png::DecodingError| format!("{name}: cannot be decoded: {error}");
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().map_err(undecodable)?;
        let info = reader.info();
        let [width, height, _] = self.check.manifest.lattice.dims;
        let kind = (info.width, info.height, info.color_type, info.bit_depth);
        if kind != (width, height, png::ColorType::Grayscale, png::BitDepth::Sixteen) {
            return Err(format!("{name}: found {kind:?}, expected {width} × {height} pixels of 16-bit grey"));
        }
        for (row, expected) in expected.chunks(width as usize).enumerate() {
            let found = reader.next_row().map_err(undecodable)?.ok_or_else(|| format!("{name}: found too few rows"))?;
            let found = found.data().as_chunks::<2>().0.iter().map(|grey| u32::from(u16::from_be_bytes(*grey)));
            if !found.eq(expected.iter().map(|height| (*height).min(u32::from(u16::MAX)))) {
                return Err(format!("{name}: row {row} differs from the slices"));
            }
        }
        Ok(())
    }
}
