//! The images of the layers: names, numbering, and the voxels of every resin, slices and masks held against each other.

use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
};

use super::{
    Check, Finding, Verification, VerifyError,
    files::Sound,
    image::{Image, Kind},
    miscount,
    records::MAX_MATERIALS,
};
use crate::job::manifest::MaterialRecord;
use crate::parallel;

/// Runs of missing or surplus numbers that are told; the rest is counted.
const MAX_GAPS: usize = 20;
/// Marks a pixel of the background; resins are numbered from 1.
const BACKGROUND: u16 = 0;
/// Marks a pixel whose colour is no resin's.
const STRAY: u16 = u16::MAX;

/// The images of one layer.
#[derive(Debug, Default)]
struct LayerFiles<'a> {
    slice: Option<&'a str>,
    /// With the index of the resin.
    masks: Vec<(usize, &'a str)>,
}

/// What the images of one layer hold.
struct LayerCount {
    findings: Vec<Finding>,
    /// Pixels per resin in the slice, the background last; `None` if there is no sound slice.
    slice: Option<Vec<u64>>,
    /// Voxels per resin in the masks; `None` where there is no sound mask.
    masks: Vec<Option<u64>>,
}

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>, result: &mut Verification) -> Result<(), VerifyError> {
    let layers = sort(check, result);
    number(check, &layers, result);
    // Images cannot be held against a lattice or resins that cannot be; `records` has said so.
    if !check.has_lattice() || check.manifest.materials.len() > MAX_MATERIALS {
        return Ok(());
    }
    check.watch.stage("layers", layers.len() as u64);
    let layers: Vec<_> = layers.into_values().collect();
    let counts: Vec<LayerCount> = parallel::map_all(&layers, |files| {
        check.watch.go_on()?;
        let count = count_layer(check, sound, files);
        check.watch.advance(1);
        Ok(count)
    })
    .into_iter()
    .collect::<Result<_, VerifyError>>()?;
    sum(check, &counts, result);
    result.slices = counts.iter().filter(|count| count.slice.is_some()).count() as u64;
    result.findings.extend(counts.into_iter().flat_map(|count| count.findings));
    Ok(())
}

/// The number in `slice_12.png`, written without signs and leading zeros.
fn slice_number(name: &str) -> Option<u32> {
    let digits = name.strip_prefix("slice_")?.strip_suffix(".png")?;
    digits.parse().ok().filter(|number: &u32| number.to_string() == digits)
}

fn printed(material: &MaterialRecord) -> bool {
    material.rgba != [0; 4]
}

/// Every listed image by its layer; strange names are findings.
fn sort<'a>(check: &Check<'a>, result: &mut Verification) -> BTreeMap<u32, LayerFiles<'a>> {
    let mut layers: BTreeMap<u32, LayerFiles<'a>> = BTreeMap::new();
    for file in &check.manifest.files {
        let path = file.path.as_str();
        if let Some(name) = path.strip_prefix("slices/") {
            match slice_number(name) {
                Some(k) => layers.entry(k).or_default().slice = Some(path),
                None => result.findings.push(Finding::new(path, "found a strange name, expected slices/slice_N.png")),
            }
        } else if let Some((name, file)) = path.strip_prefix("masks/").and_then(|rest| rest.split_once('/')) {
            let resin = check.manifest.materials.iter().position(|material| material.name == name && printed(material));
            match (resin, slice_number(file)) {
                (Some(resin), Some(k)) => layers.entry(k).or_default().masks.push((resin, path)),
                (None, _) => {
                    result.findings.push(Finding::new(path, "found a mask of no printed resin, expected none"))
                }
                (_, None) => {
                    result.findings.push(Finding::new(path, "found a strange name, expected masks/RESIN/slice_N.png"));
                }
            }
        }
    }
    layers
}

/// Checks that every kind of image is numbered without gaps over the slices that were written.
fn number(check: &Check<'_>, layers: &BTreeMap<u32, LayerFiles<'_>>, result: &mut Verification) {
    let [first, end] = check.manifest.slices;
    let mut missing = |folder: &str, asked: bool, numbers: BTreeSet<u32>| {
        if asked || !numbers.is_empty() {
            result.findings.extend(gaps(folder, &numbers, first..end));
        }
    };
    let slices = layers.iter().filter(|(_, files)| files.slice.is_some()).map(|(k, _)| *k);
    missing("slices", check.wants("png"), slices.collect());
    for (resin, material) in check.manifest.materials.iter().enumerate().filter(|(_, material)| printed(material)) {
        let has = |files: &LayerFiles<'_>| files.masks.iter().any(|(of, _)| *of == resin);
        let masks = layers.iter().filter(|(_, files)| has(files)).map(|(k, _)| *k);
        missing(&format!("masks/{}", material.name), check.wants("masks"), masks.collect());
    }
}

/// What `numbers` lack of `range`, and have beside it.
pub(super) fn gaps(folder: &str, numbers: &BTreeSet<u32>, range: Range<u32>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut next = range.start;
    let mut missing: Vec<Range<u32>> = Vec::new();
    for &number in numbers.range(range.start..range.end.max(range.start)) {
        if number > next {
            missing.push(next..number);
        }
        next = number + 1;
    }
    if next < range.end {
        missing.push(next..range.end);
    }
    let name = |range: &Range<u32>| match range.len() {
        1 => format!("slice_{}.png", range.start),
        _ => format!("slice_{}.png to slice_{}.png", range.start, range.end - 1),
    };
    let expected = format!("expected one for each of the slices {}..{}", range.start, range.end);
    for gap in missing.iter().take(MAX_GAPS) {
        findings.push(Finding::new(folder, format!("{} not listed, {expected}", name(gap))));
    }
    if missing.len() > MAX_GAPS {
        findings.push(Finding::new(folder, format!("{} more gaps, {expected}", missing.len() - MAX_GAPS)));
    }
    for number in numbers.iter().filter(|number| !range.contains(*number)).take(MAX_GAPS) {
        findings.push(Finding::new(folder, format!("slice_{number}.png listed, {expected}")));
    }
    findings
}

fn count_layer(check: &Check<'_>, sound: &Sound<'_>, files: &LayerFiles<'_>) -> LayerCount {
    let materials = &check.manifest.materials;
    let mut count = LayerCount { findings: Vec::new(), slice: None, masks: vec![None; materials.len()] };
    let open = |path: &str, kind: Kind| {
        if !sound.contains(path) {
            return None; // `files` has said why
        }
        Some(check.open(path).and_then(|file| Image::open(file, kind, &check.manifest.lattice)))
    };
    let mut slice = None;
    if let Some(path) = files.slice {
        match open(path, Kind::Slice) {
            Some(Ok(image)) => slice = Some(SliceRows::new(path, image, check.manifest.lattice.dims[0], materials)),
            Some(Err(problem)) => count.findings.push(Finding::new(path, problem)),
            None => {}
        }
    }
    let mut masks = Vec::new();
    for &(resin, path) in &files.masks {
        match open(path, Kind::Mask) {
            Some(Ok(image)) => masks.push(MaskRows { path, resin, image, voxels: 0, odd: 0, failed: false }),
            Some(Err(problem)) => count.findings.push(Finding::new(path, problem)),
            None => {}
        }
    }
    walk(check, &mut slice, &mut masks, &mut count.findings);
    for mask in masks.into_iter().filter(|mask| !mask.failed) {
        if mask.odd > 0 {
            let other = if slice.is_some() { "differs from the slice" } else { "overlaps with another mask" };
            count.findings.push(Finding::new(mask.path, format!("{other} in {} voxels", mask.odd)));
        }
        match mask.image.finish() {
            Ok(()) => count.masks[mask.resin] = Some(mask.voxels),
            Err(problem) => count.findings.push(Finding::new(mask.path, problem)),
        }
    }
    if let Some(slice) = slice.filter(|slice| !slice.failed) {
        if let Some((colour, x, row)) = slice.first_stray {
            let problem = format!(
                "found {} pixels of no resin's colour, the first {colour:?} at column {x} of row {row}, expected the \
                 manifest's colours",
                slice.stray
            );
            count.findings.push(Finding::new(slice.path, problem));
        }
        match slice.image.finish() {
            Ok(()) => count.slice = Some(slice.pixels),
            Err(problem) => count.findings.push(Finding::new(slice.path, problem)),
        }
    }
    count
}

/// Reads the rows of all images of a layer side by side.
fn walk(check: &Check<'_>, slice: &mut Option<SliceRows<'_>>, masks: &mut [MaskRows<'_>], findings: &mut Vec<Finding>) {
    let [width, height, _] = check.manifest.lattice.dims;
    let bytes = (width as usize).div_ceil(8);
    // Bits beyond the last voxel mean nothing.
    let last = if width % 8 == 0 { 0xff } else { !(0xff_u8 >> (width % 8)) };
    let mut taken = vec![0_u8; bytes];
    for row in 0..height {
        let with_slice = slice.as_ref().is_some_and(|slice| !slice.failed);
        if let Some(slice) = slice.as_mut().filter(|slice| !slice.failed) {
            slice.take_row(row, !masks.is_empty(), findings);
        }
        taken.fill(0);
        for mask in masks.iter_mut().filter(|mask| !mask.failed) {
            let bits = match mask.image.next_row() {
                Ok(bits) => bits,
                Err(problem) => {
                    findings.push(Finding::new(mask.path, problem));
                    mask.failed = true;
                    continue;
                }
            };
            let ids = slice.as_ref().filter(|_| with_slice).map(|slice| slice.ids.as_slice());
            for (index, (&byte, taken)) in bits.iter().zip(&mut taken).enumerate() {
                let byte = if index + 1 == bytes { byte & last } else { byte };
                mask.voxels += u64::from(byte.count_ones());
                let odd = match ids {
                    Some(ids) => byte ^ packed(ids, index, mask.resin as u16 + 1),
                    None => byte & *taken,
                };
                mask.odd += u64::from(odd.count_ones());
                *taken |= byte;
            }
        }
    }
}

/// Eight ids from the `index`-th eight on as bits, set where they are `id`.
fn packed(ids: &[u16], index: usize, id: u16) -> u8 {
    let eight = &ids[index * 8..(index * 8 + 8).min(ids.len())];
    eight.iter().enumerate().fold(0, |byte, (bit, &other)| byte | (u8::from(other == id) << (7 - bit)))
}

/// A slice being read.
struct SliceRows<'a> {
    path: &'a str,
    image: Image,
    materials: &'a [MaterialRecord],
    /// Id of every pixel of the row, where masks ask for it.
    ids: Vec<u16>,
    /// Per resin, the background last.
    pixels: Vec<u64>,
    stray: u64,
    first_stray: Option<([u8; 4], usize, u32)>,
    failed: bool,
}

impl<'a> SliceRows<'a> {
    fn new(path: &'a str, image: Image, width: u32, materials: &'a [MaterialRecord]) -> Self {
        let (ids, pixels) = (vec![BACKGROUND; width as usize], vec![0; materials.len() + 1]);
        Self { path, image, materials, ids, pixels, stray: 0, first_stray: None, failed: false }
    }

    fn take_row(&mut self, row: u32, keep_ids: bool, findings: &mut Vec<Finding>) {
        let pixels = match self.image.next_row() {
            Ok(pixels) => pixels,
            Err(problem) => {
                findings.push(Finding::new(self.path, problem));
                self.failed = true;
                return;
            }
        };
        let mut x = 0;
        let (pixels, _) = pixels.as_chunks::<4>();
        for run in pixels.chunk_by(|a, b| a == b) {
            let colour = run[0];
            let id = if colour == [0; 4] {
                self.pixels[self.materials.len()] += run.len() as u64;
                BACKGROUND
            } else if let Some(resin) = self.materials.iter().position(|material| material.rgba == colour) {
                self.pixels[resin] += run.len() as u64;
                resin as u16 + 1
            } else {
                self.stray += run.len() as u64;
                self.first_stray.get_or_insert((colour, x, row));
                STRAY
            };
            if keep_ids {
                self.ids[x..x + run.len()].fill(id);
            }
            x += run.len();
        }
    }
}

/// A mask being read.
struct MaskRows<'a> {
    path: &'a str,
    resin: usize,
    image: Image,
    voxels: u64,
    /// Voxels that the slice has otherwise; without a slice, those of two masks at once.
    odd: u64,
    failed: bool,
}

/// Holds the voxels of all layers against the manifest's.
fn sum(check: &Check<'_>, counts: &[LayerCount], result: &mut Verification) {
    let [first, end] = check.manifest.slices;
    let layers = u64::from(end.saturating_sub(first));
    if layers == 0 || counts.len() as u64 != layers {
        return; // what is missing has been said, and sums would only say it again
    }
    let materials = &check.manifest.materials;
    let whole = counts.iter().all(|count| count.slice.is_some());
    let pixels =
        |index: usize| counts.iter().filter_map(|count| count.slice.as_ref()).map(|slice| slice[index]).sum::<u64>();
    for (resin, material) in materials.iter().enumerate().filter(|(_, material)| printed(material)) {
        let masks: Option<u64> = counts.iter().map(|count| count.masks[resin]).sum();
        let found = if whole { Some(("slices", pixels(resin))) } else { masks.map(|voxels| ("masks", voxels)) };
        let Some((folder, voxels)) = found else { continue };
        result.voxels += voxels;
        result.findings.extend(miscount(material, voxels).map(|problem| Finding::new(folder, problem)));
    }
    if whole {
        let (holes, background) = (materials.iter().filter(|material| !printed(material)), pixels(materials.len()));
        let needed = holes.fold(0_u64, |sum, material| sum.saturating_add(material.voxels));
        if needed > background {
            let problem =
                format!("found {background} voxels of background, the manifest has {needed} of resins printed as such");
            result.findings.push(Finding::new("slices", problem));
        }
    }
}
