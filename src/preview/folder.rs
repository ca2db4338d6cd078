//! Pictures of a finished folder, from its slices.

use std::{
    io::{BufRead, BufReader, Seek},
    ops::Range,
    path::Path,
};

use super::{
    PreviewBuilder, PreviewError, PreviewFile, PreviewMaterial, Voxels,
    enclosed::{mark_enclosed, open_hollows},
};
use crate::{
    look, parallel,
    voxel::{Lattice, MaterialId},
    watch::Watch,
};

/// Pixels worth decoding: about ten seconds of one core. Larger jobs are read more sparsely.
const PIXELS: f64 = 1.5e9;
/// Least and most slices that are read, whatever their size.
const SLICES: [f64; 2] = [96.0, 800.0];
/// Bytes of slices held at once.
const BATCH_BYTES: usize = 64 << 20;

/// Draws the pictures of `slices`, those of a finished job, from `OUT/slices/slice_K.png`.
///
/// Of a large job at most 800 of the slices are read, evenly spread. Slices show the support as background; it is found
/// again as what the object encloses. Of two materials with the same colour the first gets all.
///
/// # Errors
/// A slice that is missing, damaged, not as large as the lattice, or that holds a colour no material has;
/// [`PreviewError::Stopped`].
pub fn from_folder(
    out: &Path,
    lattice: &Lattice,
    materials: &[PreviewMaterial],
    slices: Range<u32>,
    watch: &dyn Watch,
) -> Result<Vec<PreviewFile>, PreviewError> {
    let [width, height, depth] = lattice.dims;
    let area = f64::from(width) * f64::from(height);
    let most = (PIXELS / area.max(1.0)).clamp(SLICES[0], SLICES[1]) as u32;
    // Of every `step` slices the middle one.
    let step = depth.div_ceil(most).max(1);
    let snap = |k: u32| (k / step * step + step / 2).min(depth.saturating_sub(1));
    let mut builder = PreviewBuilder::planned(lattice, materials, None, snap);
    let mut needed = builder.slices_needed();
    needed.retain(|k| slices.contains(k));
    let colours = SliceColours::new(materials.iter().map(|material| (material.rgba, material.id.0)));
    let batch = (BATCH_BYTES / (area as usize).max(1)).clamp(1, 64);
    // Where all slices can be read, the voxels themselves are kept.
    let all = slices == (0..depth) && f64::from(depth) * area <= PIXELS;
    let mut voxels = if all { look::Volume::new(*lattice).ok() } else { None };
    let (needed, batch) = if voxels.is_some() {
        ((0..depth).collect(), batch.next_multiple_of(look::Volume::LAYER as usize))
    } else {
        (needed, batch)
    };
    for slices in needed.chunks(batch) {
        // Gathered before the first error is looked for, so that it is always the same one.
        let images: Vec<Result<Image, _>> = parallel::map_all(slices, |&k| read(out, k, lattice, &colours));
        let images = images.into_iter().collect::<Result<Vec<_>, _>>()?;
        watch.go_on()?;
        for image in &images {
            builder.observe_slices(image, image.k..image.k + 1);
        }
        if let Some(voxels) = &mut voxels {
            for layer in images.chunks(look::Volume::LAYER as usize) {
                let first = layer[0].k;
                // What each slice encloses by itself is told anew from the whole volume.
                let rows = |j, k: u32, row: &mut [u8]| {
                    layer[(k - first) as usize].row(j, k, row);
                    row.iter_mut().filter(|id| Some(**id) == colours.support).for_each(|id| *id = 0);
                };
                voxels.add_slices(first..first + layer.len() as u32, rows);
            }
        }
    }
    if let Some(support) = colours.support {
        open_hollows(&mut builder, support);
        voxels.iter_mut().for_each(|voxels| voxels.fill_enclosed(MaterialId(support)));
    }
    builder.finish(voxels.as_ref())
}

/// One slice, row 0 = largest j.
struct Image {
    k: u32,
    width: usize,
    ids: Vec<u8>,
}

impl Voxels for Image {
    fn row(&self, j: u32, _: u32, row: &mut [u8]) {
        let from_top = self.ids.len() / self.width - 1 - j as usize;
        row.copy_from_slice(&self.ids[from_top * self.width..(from_top + 1) * self.width]);
    }

    fn voxel(&self, [i, j, _]: [u32; 3]) -> u8 {
        let from_top = self.ids.len() / self.width - 1 - j as usize;
        self.ids[from_top * self.width + i as usize]
    }
}

/// Ids by colour.
pub(crate) struct SliceColours {
    known: Vec<([u8; 4], u8)>,
    /// The first material that is printed as background.
    support: Option<u8>,
}

impl SliceColours {
    /// Colours and ids of all materials; what is transparent prints as background.
    pub(crate) fn new(materials: impl Iterator<Item = ([u8; 4], u8)>) -> Self {
        let (voids, solids): (Vec<_>, Vec<_>) = materials.partition(|(rgba, _)| rgba[3] == 0);
        let known = std::iter::once(([0; 4], 0)).chain(solids);
        Self { known: known.collect(), support: voids.first().map(|(_, id)| *id) }
    }
}

fn read(out: &Path, k: u32, lattice: &Lattice, colours: &SliceColours) -> Result<Image, PreviewError> {
    let mut ids = read_slice(out, k, lattice, colours)?;
    let width = lattice.dims[0] as usize;
    if let Some(support) = colours.support {
        mark_enclosed(&mut ids, width, support);
    }
    Ok(Image { k, width, ids })
}

/// The ids of slice `k` of the folder `out`, row 0 = largest j; background is 0, support too.
///
/// # Errors
/// As [`from_folder`].
pub(crate) fn read_slice(
    out: &Path,
    k: u32,
    lattice: &Lattice,
    colours: &SliceColours,
) -> Result<Vec<u8>, PreviewError> {
    let path = out.join("slices").join(format!("slice_{k}.png"));
    let file = crate::regular_file::open(&path).map_err(|source| PreviewError::Read { path: path.clone(), source })?;
    decode_slice(&path, BufReader::new(file), lattice, colours)
}

/// The ids of the slice that `png` is an image of, row 0 = largest j; `path` names it in errors.
///
/// # Errors
/// As [`read_slice`].
pub(crate) fn decode_slice(
    path: &Path,
    png: impl BufRead + Seek,
    lattice: &Lattice,
    colours: &SliceColours,
) -> Result<Vec<u8>, PreviewError> {
    let decode = |reason: String| PreviewError::Decode { path: path.to_owned(), reason };
    let mut reader = png::Decoder::new(png).read_info().map_err(|error| decode(error.to_string()))?;
    let info = reader.info();
    let found = [info.width, info.height];
    let expected = [lattice.dims[0], lattice.dims[1]];
    if found != expected {
        return Err(PreviewError::Size { path: path.to_owned(), found, expected });
    }
    let kind = (info.color_type, info.bit_depth);
    if kind != (png::ColorType::Rgba, png::BitDepth::Eight) {
        return Err(decode(format!("{:?} with {} bits a channel, not RGBA with 8", kind.0, kind.1 as u8)));
    }
    let width = expected[0] as usize;
    let mut ids = Vec::with_capacity(width * expected[1] as usize);
    let mut row = 0;
    let mut last = ([0; 4], 0);
    while let Some(pixels) = reader.next_row().map_err(|error| decode(error.to_string()))? {
        for (column, pixel) in pixels.data().as_chunks::<4>().0.iter().enumerate() {
            if *pixel != last.0 {
                let Some(known) = colours.known.iter().find(|(rgba, _)| rgba == pixel) else {
                    return Err(PreviewError::Colour { path: path.to_owned(), column, row, found: *pixel });
                };
                last = *known;
            }
            ids.push(last.1);
        }
        row += 1;
    }
    if ids.len() != width * expected[1] as usize {
        return Err(decode(format!("{row} rows")));
    }
    Ok(ids)
}
