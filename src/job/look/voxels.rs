//! A job's voxels for light to go through: from its fields, or from the slices of a finished folder; the same ones.
//!
//! Support on the inside is printed, and so are closed hollows, which a printer fills with it. Slices show support as
//! background, so there it is what no path leads to from the outside. Two kinds of support cannot be told by that: what
//! lies open at the sides of a slab whose depth is measured from its top, which is taken for support wherever something
//! lies above, and what is open on any other surface, which is taken for air.

use std::{path::Path, sync::Arc};

use glam::DVec3;

use super::LookError;
use crate::{
    job::{Manifest, Prepared, RunError, file::DepthFrom, manifest::MaterialRecord},
    look::{Scene, Volume},
    optics::{MaterialSet, VolumeCoefficients},
    parallel,
    preview::{SliceColours, read_slice},
    sdf::Surface,
    voxel::{BRICK, Lattice, MaterialId},
    watch::Watch,
};

/// Most voxels of a job that shows its look without being asked: it holds them in memory, at most a byte for each and
/// mostly a tenth.
pub(in crate::job) const LOOK_VOXELS: u64 = 2_000_000_000;

impl Prepared {
    /// The job as it will be printed. Opens a stage of slices.
    ///
    /// # Errors
    /// [`LookError::TooLarge`], [`LookError::Stopped`].
    pub fn volume(&self, watch: &dyn Watch) -> Result<Volume, LookError> {
        let mut volume = Volume::new(self.lattice)?;
        let slices = 0..self.lattice.dims[2];
        watch.stage("voxels", u64::from(slices.end));
        self.slicer().for_each_slab(slices, |slab| {
            volume.add(slab);
            watch.advance(slab.slices().len() as u64);
            watch.go_on()
        })?;
        if let Some(support) = support(&self.materials) {
            volume.fill_enclosed(support);
        }
        Ok(volume)
    }

    /// What is printed of a volume of this job's slabs, with its resins.
    pub(in crate::job) fn scene_of(&self, mut volume: Volume) -> Result<Scene, LookError> {
        if let Some(support) = support(&self.materials) {
            volume.fill_enclosed(support);
        }
        self.lit(volume)
    }

    /// A volume on this job's lattice with its resins, under the surfaces of its meshes.
    pub(super) fn lit(&self, volume: Volume) -> Result<Scene, LookError> {
        self.lit_under(volume, self.slicer().objects().iter().map(|object| Arc::clone(object.surface())).collect())
    }

    /// A volume with this job's resins, under `surfaces`.
    pub(super) fn lit_under(&self, volume: Volume, surfaces: Vec<Arc<Surface>>) -> Result<Scene, LookError> {
        let scene = Scene::new(volume, &coefficients(&self.materials)?)?;
        let indices = self.materials.resins.iter().map(|resin| resin.refractive_index);
        Ok(scene.under(surfaces, &std::iter::once(1.0).chain(indices).collect::<Vec<_>>()))
    }

    /// The job as it will be printed, with its resins.
    ///
    /// # Errors
    /// As [`Self::volume`]; [`LookError::Optics`] for a resin without coefficients.
    pub fn scene(&self, watch: &dyn Watch) -> Result<Scene, LookError> {
        self.lit(self.volume(watch)?)
    }
}

/// The resin that fills hollows.
fn support(materials: &MaterialSet) -> Option<MaterialId> {
    let at = materials.resins.iter().position(|resin| resin.print_as_background)?;
    Some(MaterialId::from_resin(at))
}

/// Coefficients by channel and id.
pub(super) fn coefficients(materials: &MaterialSet) -> Result<Vec<Vec<VolumeCoefficients>>, LookError> {
    let void = VolumeCoefficients::new(0.0, 0.0, 0.0)?;
    let mut channels = vec![vec![void]; materials.channels.len()];
    for resin in &materials.resins {
        for (channel, volume) in channels.iter_mut().zip(resin.needed_volumes()?) {
            channel.push(volume);
        }
    }
    Ok(channels)
}

/// The voxels of the finished job in `folder`, whose lattice must be that of `prepared`. Opens a stage of slices.
pub(super) fn read_volume(
    folder: &Path,
    manifest: &Manifest,
    prepared: &Prepared,
    watch: &dyn Watch,
) -> Result<Volume, LookError> {
    let lattice = manifest.lattice.lattice();
    if lattice != prepared.lattice {
        let words = |lattice: &Lattice| {
            let [x, y, z] = lattice.dims;
            format!("a lattice of {x} × {y} × {z} voxels of {:?} mm", lattice.pitch.to_array())
        };
        return Err(LookError::folder(
            folder,
            words(&lattice),
            format!("that of the job, {}", words(&prepared.lattice)),
        ));
    }
    let known = |material: &MaterialRecord| {
        let at = prepared.materials.resins.iter().position(|resin| resin.name == material.name);
        at.map(|at| MaterialId::from_resin(at).0) == Some(material.id)
    };
    if let Some(other) = manifest.materials.iter().find(|material| !known(material)) {
        let names: Vec<_> = prepared.materials.resins.iter().map(|resin| resin.name.as_str()).collect();
        let expected = format!("the resins of the job: {}", names.join(", "));
        return Err(LookError::folder(folder, format!("resin {} as number {}", other.name, other.id), expected));
    }
    read_slices(folder, manifest, &from_top(prepared), support(&prepared.materials), watch)
}

/// The voxels that the slices in `folder` show. `support` fills what is enclosed, and what lies open below something in
/// the boxes `from_top` (mm), those of objects whose depth is measured from their top. Opens a stage of slices.
pub(super) fn read_slices(
    folder: &Path,
    manifest: &Manifest,
    from_top: &[[DVec3; 2]],
    support: Option<MaterialId>,
    watch: &dyn Watch,
) -> Result<Volume, LookError> {
    let lattice = manifest.lattice.lattice();
    if manifest.slices != [0, lattice.dims[2]] {
        let [first, end] = manifest.slices;
        let expected = format!("all {} of the job", lattice.dims[2]);
        return Err(LookError::folder(folder, format!("slices {first}..{end}"), expected));
    }
    let colours = SliceColours::new(manifest.materials.iter().map(|material| (material.rgba, material.id)));
    let mut volume = Volume::new(lattice)?;
    watch.stage("slices", u64::from(lattice.dims[2]));
    let (width, height) = (lattice.dims[0] as usize, lattice.dims[1] as usize);
    // From above, so that what lies over a column is known.
    let mut covered = vec![false; if from_top.is_empty() { 0 } else { width * height }];
    let starts: Vec<u32> = (0..lattice.dims[2]).step_by(BRICK).collect();
    for start in starts.into_iter().rev() {
        let slices = start..lattice.dims[2].min(start + BRICK as u32);
        let read = |n: usize| read_slice(folder, start + n as u32, &lattice, &colours);
        // Gathered before the first error is looked for, so that it is always the same one.
        let images: Vec<Result<Vec<u8>, _>> = parallel::map(slices.len(), read);
        let mut images = images.into_iter().collect::<Result<Vec<_>, _>>()?;
        if let (Some(support), false) = (support, from_top.is_empty()) {
            for (k, image) in slices.clone().zip(&mut images).rev() {
                for (at, (id, covered)) in image.iter_mut().zip(&mut covered).enumerate() {
                    *covered |= *id != 0;
                    let voxel = [(at % width) as u32, (height - 1 - at / width) as u32, k];
                    if *id == 0 && *covered && from_top.iter().any(|bounds| within(bounds, &lattice, voxel)) {
                        *id = support.0;
                    }
                }
            }
        }
        volume.add_slices(slices.clone(), |j, k, row| {
            let from_top = height - 1 - j as usize;
            row.copy_from_slice(&images[(k - start) as usize][from_top * width..(from_top + 1) * width]);
        });
        watch.advance(u64::from(slices.end - slices.start));
        watch.go_on()?;
    }
    if let Some(support) = support {
        volume.fill_enclosed(support);
    }
    Ok(volume)
}

/// Bounding boxes of the objects whose depth is measured from the top, mm.
fn from_top(prepared: &Prepared) -> Vec<[DVec3; 2]> {
    let objects = prepared.job.objects.iter().zip(&prepared.objects);
    objects.filter(|(asked, _)| asked.depth_from == DepthFrom::Top).map(|(_, object)| object.bounds).collect()
}

fn within([low, high]: &[DVec3; 2], lattice: &Lattice, voxel: [u32; 3]) -> bool {
    let centre = lattice.centre(voxel);
    centre.cmpge(*low).all() && centre.cmple(*high).all()
}

impl From<LookError> for RunError {
    fn from(error: LookError) -> Self {
        match error {
            LookError::Run(error) => error,
            LookError::Slice(error) => error.into(),
            LookError::Optics(error) => error.into(),
            LookError::Output(error) => error.into(),
            LookError::Stopped(stopped) => stopped.into(),
            error => Self::Look(Box::new(error)),
        }
    }
}
