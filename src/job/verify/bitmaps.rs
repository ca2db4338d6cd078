//! Bitmaps for Objet printers: of one size, one for each slice and material, which do not overlap and hold the voxels
//! that the manifest counts.

use std::io::Read;

use super::{Check, Finding, VerifyError, files::Sound, image::read_all};
use crate::container::bmp;
use crate::parallel;

/// Longest text that names bitmaps, bytes.
const MAX_TEXT: u64 = 1 << 16;

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, findings: &mut Vec<Finding>) -> Result<(), VerifyError> {
    let text_path = bmp::text_path(&check.manifest.name);
    let listed = check.manifest.files.iter().any(|file| file.path.starts_with("bmp/"));
    if !listed && !check.wants("bmp") || !check.has_lattice() {
        return Ok(());
    }
    let content = check.manifest.content();
    let text = match sound.contains(text_path.as_str()) {
        true => check.open(&text_path).and_then(|file| read_all(file, MAX_TEXT)),
        false => Err("not listed or not sound, expected the text that names the bitmaps".to_owned()),
    };
    // The text says which resin has which number, and then what else must be in it.
    let text = text.and_then(|text| String::from_utf8(text).map_err(|_| "found bytes that are no UTF-8".to_owned()));
    let named = text.and_then(|text| {
        let value =
            |key: String| text.lines().find_map(|line| line.strip_prefix(&key)?.strip_suffix(';').map(str::to_owned));
        let names: Vec<String> = (1..=bmp::MAX_MATERIALS)
            .map_while(|number| value(if number == 1 { "Color = ".to_owned() } else { format!("Resin{number} = ") }))
            .collect();
        let resins: Vec<_> =
            names.iter().filter_map(|name| content.printed().find(|resin| resin.name == *name)).collect();
        match resins.len() == names.len() && bmp::text(&content, &resins) == text {
            true => Ok(resins),
            false => Err("found another text, expected what the manifest says".to_owned()),
        }
    });
    let resins = match named {
        Ok(resins) => resins,
        Err(problem) => {
            findings.push(Finding::new(&text_path, problem));
            return Ok(());
        }
    };
    let slices = check.manifest.lattice.dims[2];
    check.watch.stage("bitmaps", u64::from(slices));
    let counted: Vec<Result<Vec<u64>, Finding>> = parallel::map(slices as usize, |k| {
        check.watch.go_on()?;
        let counted = count(check, sound, k as u32, resins.len());
        check.watch.advance(1);
        Ok(counted)
    })
    .into_iter()
    .collect::<Result<_, VerifyError>>()?;
    let mut totals = check.manifest.counts();
    resins.iter().for_each(|resin| totals[usize::from(resin.id.0)] = 0);
    let mut whole = true;
    for counts in counted {
        match counts {
            Ok(counts) => {
                resins.iter().zip(counts).for_each(|(resin, count)| totals[usize::from(resin.id.0)] += count);
            }
            Err(finding) => {
                findings.push(finding);
                whole = false;
            }
        }
    }
    if whole {
        findings.extend(check.miscounted(&totals).into_iter().map(|problem| Finding::new(bmp::FOLDER, problem)));
    }
    Ok(())
}

/// Voxels of every material of slice `k`.
fn count(check: &Check<'_>, sound: &Sound<'_>, k: u32, materials: usize) -> Result<Vec<u64>, Finding> {
    let lattice = check.manifest.lattice.lattice();
    let [width, height, slices] = lattice.dims;
    let row_bytes = bmp::padded_width(&lattice) as usize / 8;
    let bytes = bmp::HEADER + row_bytes * height as usize;
    let mut taken = vec![0_u8; bytes - bmp::HEADER];
    let mut counts = Vec::new();
    for number in 1..=materials {
        let path = bmp::bitmap_path(number, k, slices);
        let fault = |problem: String| Finding::new(&path, problem);
        if !sound.contains(path.as_str()) {
            return Err(fault("not listed or not sound, expected a bitmap".to_owned()));
        }
        let mut found = Vec::new();
        let file = check.open(&path).map_err(fault)?;
        file.take(bytes as u64 + 1)
            .read_to_end(&mut found)
            .map_err(|error| fault(format!("cannot be read: {error}")))?;
        if found.len() != bytes || found[..bmp::HEADER] != bmp::header(&lattice) {
            return Err(fault(format!(
                "found another header or size, expected a bitmap of {bytes} bytes, 1 bit a pixel"
            )));
        }
        let mut voxels = 0_u64;
        for (row, taken) in found[bmp::HEADER..].chunks(row_bytes).zip(taken.chunks_mut(row_bytes)) {
            for (index, (byte, taken)) in row.iter().zip(taken).enumerate() {
                let beyond = (8 * (index as u32 + 1)).saturating_sub(width).min(8);
                if beyond > 0 && u32::from(*byte) & ((1 << beyond) - 1) != 0 {
                    return Err(fault("found pixels beyond the last voxel, expected padding of 0".to_owned()));
                }
                if byte & *taken != 0 {
                    return Err(fault("found pixels that another material has too, expected none".to_owned()));
                }
                *taken |= byte;
                voxels += u64::from(byte.count_ones());
            }
        }
        counts.push(voxels);
    }
    Ok(counts)
}
