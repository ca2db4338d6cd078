//! A finished job as a volume to trace light through, and its stackings.

use std::path::{Path, PathBuf};

use super::CompareError;
use crate::job::run::slice_path;
use crate::{
    job::{Manifest, finished::read_manifest},
    look::VoxelGrid,
    optics::{ChannelId, MaterialFile, Stack, VolumeCoefficients},
    parallel,
    voxel::MaterialId,
};

/// A printed slab.
pub(super) struct Printed {
    /// The folder, as the user named it.
    pub folder: PathBuf,
    pub manifest: Manifest,
    /// The voxels inside the slab, seen from above.
    pub grid: VoxelGrid,
}

/// Most voxels that are held in memory.
const MAX_VOXELS: u64 = 1 << 32;

impl Printed {
    /// Reads the folder of a job with one slab of `size_mm` seen from above.
    pub fn read(folder: &Path, size_mm: [f64; 2]) -> Result<Self, CompareError> {
        let manifest = read_manifest(folder)?.map_err(|finding| CompareError::Folder {
            folder: folder.to_owned(),
            found: finding.to_string(),
            expected: "the manifest of a finished job",
        })?;
        let fault = |found: String, expected| CompareError::Folder { folder: folder.to_owned(), found, expected };
        let [object] = manifest.objects.as_slice() else {
            return Err(fault(format!("{} objects", manifest.objects.len()), "a job with one object, a slab"));
        };
        let [low, high] = object.bounds_mm;
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let (found, expected) = (high[axis] - low[axis], size_mm[axis]);
            if (found / expected - 1.0).abs() > SIZE_TOLERANCE {
                let found = format!("an object of {found:.3} mm along {name} with a map of {expected:.3} mm");
                return Err(fault(found, "a slab that the map covers from edge to edge, or any shape with its job"));
            }
        }
        if manifest.slices != [0, manifest.lattice.dims[2]] {
            let found = format!("slices {} to {}", manifest.slices[0], manifest.slices[1]);
            return Err(fault(found, "all slices of the job"));
        }
        let lattice = manifest.lattice;
        // Voxels whose centres are inside the slab; it is as large as they are, half a voxel more or less.
        let inside = |axis: usize| {
            let centre = |n: u32| lattice.origin_mm[axis] + (f64::from(n) + 0.5) * lattice.pitch_mm[axis];
            (0..lattice.dims[axis]).filter(|&n| low[axis] <= centre(n) && centre(n) < high[axis]).collect::<Vec<_>>()
        };
        let [columns, rows, slices] = [0, 1, 2].map(inside);
        let dims = [columns.len(), rows.len(), slices.len()];
        if dims.contains(&0) || dims.iter().map(|&n| n as u64).product::<u64>() > MAX_VOXELS {
            return Err(fault(format!("{dims:?} voxels in the slab"), "at least one and at most 4e9"));
        }
        let colours = Colours::new(&manifest);
        let read = |&k: &u32| -> Result<Vec<u8>, CompareError> {
            let path = folder.join(slice_path(k));
            let fault = |found: String| CompareError::Slice { path: path.clone(), found };
            let image = image::open(&path).map_err(|error| fault(error.to_string()))?.into_rgba8();
            if [image.width(), image.height()] != [lattice.dims[0], lattice.dims[1]] {
                return Err(fault(format!("{} × {} pixels", image.width(), image.height())));
            }
            let mut ids = Vec::with_capacity(dims[0] * dims[1]);
            for &j in &rows {
                for &i in &columns {
                    let rgba = image.get_pixel(i, lattice.dims[1] - 1 - j).0; // row 0 is the largest y
                    ids.push(colours.id(rgba).ok_or_else(|| fault(format!("a pixel {rgba:?} of no resin")))?);
                }
            }
            Ok(ids)
        };
        // Seen from above: layer 0 is the highest.
        let layers = parallel::map_all(&slices, read).into_iter().rev().collect::<Result<Vec<_>, _>>()?;
        let pitch = [size_mm[0] / dims[0] as f64, size_mm[1] / dims[1] as f64, lattice.pitch_mm[2]];
        let grid = VoxelGrid::new(dims, pitch, layers.concat())?;
        Ok(Self { folder: folder.to_owned(), manifest, grid })
    }

    /// Coefficients by material id in channel `channel`.
    pub fn media(&self, file: &MaterialFile, channel: ChannelId) -> Result<Vec<VolumeCoefficients>, CompareError> {
        let mut media = vec![VolumeCoefficients::new(0.0, 0.0, 0.0)?];
        for material in &self.manifest.materials {
            media.push(volume(file, &material.name)?[channel.0]);
        }
        Ok(media)
    }

    /// The stackings.
    pub fn stacks(&self) -> Result<Vec<Stack<String>>, CompareError> {
        let report = self.manifest.stackings.first().ok_or_else(|| {
            let (folder, found) = (self.folder.clone(), "no stackings".to_owned());
            CompareError::Folder { folder, found, expected: "those of one object" }
        })?;
        Ok(report.stacks().collect())
    }

    /// By how much the job scaled its target: albedo asked for over the map's own, by the first stacking that has both.
    pub fn scale(&self, albedo: &[f64]) -> f64 {
        let entries = self.manifest.stackings.first().map(|report| report.stackings.as_slice()).unwrap_or_default();
        let asked = entries.iter().zip(albedo).filter(|(entry, albedo)| entry.share > 0.0 && **albedo > 0.0);
        let ratios = asked.filter_map(|(entry, albedo)| Some(entry.target_albedo.as_ref()?.first()? / albedo));
        let mut ratios: Vec<f64> = ratios.collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
    }
}

/// A slab's sides may differ from the map's by this share: files of meshes are printed with few digits.
const SIZE_TOLERANCE: f64 = 0.01;

/// Coefficients of a resin per channel.
pub(super) fn volume<'a>(file: &'a MaterialFile, resin: &str) -> Result<&'a [VolumeCoefficients], CompareError> {
    file.volume(resin).ok_or_else(|| CompareError::NoCoefficients { set: file.name().into(), resin: resin.into() })
}

/// Ids by the colours of slices. What is transparent inside the slab is the resin that prints as background.
struct Colours {
    known: Vec<([u8; 4], u8)>,
}

impl Colours {
    fn new(manifest: &Manifest) -> Self {
        let background = manifest.materials.iter().position(|material| material.rgba[3] == 0);
        let void = background.map_or(0, |index| MaterialId::from_resin(index).0);
        let solids = manifest.materials.iter().enumerate().filter(|(_, material)| material.rgba[3] != 0);
        let known = solids.map(|(index, material)| (material.rgba, MaterialId::from_resin(index).0));
        Self { known: known.chain([([0; 4], void)]).collect() }
    }

    fn id(&self, rgba: [u8; 4]) -> Option<u8> {
        self.known.iter().find(|(known, _)| *known == rgba).map(|(_, id)| *id)
    }
}
