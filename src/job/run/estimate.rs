//! What a job would take, without writing anything.

use glam::DVec3;
use serde::Serialize;

use super::Durations;
use crate::{
    job::{
        Prepared, PreparedObject, RunError,
        file::{OutputFormat, VolumeValues},
        look::{LOOK_VOXELS, LookError},
        manifest::MaterialRecord,
        plan::TEXEL_BYTES,
        printable::Printable,
    },
    look::Volume,
    machine::{self, Shortage},
    voxel::{BlockShape, Lattice, Slab},
    watch::Watch,
};

/// Where an object stands.
#[derive(Debug, Clone, Serialize)]
pub struct ObjectPlace {
    /// Its mesh as the job writes it.
    pub mesh: String,
    /// The least corner of its bounding box, mm.
    pub position_mm: [f64; 3],
    /// The size of that box, mm.
    pub size_mm: [f64; 3],
}

/// What a job would take.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Size of the lattice, mm.
    pub size_mm: [f64; 3],
    /// Voxels per axis.
    pub dims: [u32; 3],
    /// Voxels in all.
    pub voxels: u64,
    /// Memory the job needs, bytes, roughly.
    pub memory_bytes: u64,
    /// Seconds it will take on this machine, about.
    pub seconds: Durations,
    /// Where its objects stand.
    pub objects: Vec<ObjectPlace>,
    /// Resins with their estimated volume (voxels of the job's own size) and mass.
    pub materials: Vec<MaterialRecord>,
    /// What does not fit the printer.
    pub misfits: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What of it will break, fall off or wash away.
    pub printable: Printable,
}

/// Voxels of the coarse lattice that stands for the job's. At 4 M a 60 mm object is sampled every 0.4 mm, and volumes
/// are within a few percent for layers down to half of that.
const SAMPLES: f64 = 4e6;
/// Least memory of a process with its code and buffers, bytes.
const BASE_MEMORY: u64 = 24 << 20;
/// Bytes per texel while layers are laid by place: whatever the light, and for each channel of it. By the peaks of the
/// sample rabbits, 548 to 609 and 566 to 618 MiB from run to run, 2026-12-01: more on a busy machine.
const LAID_TEXEL_BYTES: u64 = 128;
const LAID_CHANNEL_BYTES: u64 = 3;
/// Bytes per point of the surface that rounds look at.
const POINT_BYTES: u64 = 3000;
/// What the exploration of a gamut leaves behind for each channel, bytes.
const GAMUT_CHANNEL_BYTES: u64 = 40 << 20;
/// What pictures of a job and its look take beside their voxels, and material meshes beside theirs, bytes.
const PICTURES_MEMORY: u64 = 72 << 20;
const MESHES_MEMORY: u64 = 110 << 20;
/// Bytes of a resin's fraction in a slab, and in a row of a slice that is being compressed, with the one it is from.
const FRACTION_BYTES: u64 = 2;
const FRACTION_ROW_BYTES: u64 = 6;
/// What a compressor takes, bytes.
const COMPRESSOR_BYTES: u64 = 512 << 10;
/// Bytes per triangle in the mesh, the hierarchy and the sorted rows.
const TRIANGLE_BYTES: u64 = 480;

impl ObjectPlace {
    fn of(object: &PreparedObject) -> Self {
        let [low, high] = object.bounds;
        Self { mesh: object.mesh.clone(), position_mm: low.to_array(), size_mm: (high - low).to_array() }
    }
}

impl Prepared {
    /// Estimates volumes by slicing a coarse lattice, and memory from the size of a slab.
    ///
    /// # Errors
    /// [`RunError::Stopped`].
    pub fn estimate(&self, watch: &dyn Watch) -> Result<Estimate, RunError> {
        watch.stage("estimate", 0);
        let lattice = &self.lattice;
        let extent = DVec3::from(lattice.dims.map(f64::from)) * lattice.pitch;
        // Never finer than the job itself.
        let pitch = libm::cbrt(extent.element_product() / SAMPLES);
        let coarse = Lattice::covering(extent, lattice.pitch.max(DVec3::splat(pitch)))?;
        let mut counts = [0_u64; 256];
        let mut row = vec![0; coarse.dims[0] as usize];
        let mut volume = Volume::new(coarse).map_err(LookError::from)?;
        let mut count = |slab: &Slab| {
            volume.add(slab);
            for k in slab.slices() {
                for j in 0..coarse.dims[1] {
                    slab.read_row(j, k, &mut row);
                    row.iter().for_each(|&id| counts[usize::from(id)] += 1);
                }
            }
            watch.go_on()
        };
        self.slicer().resampled(coarse).for_each_slab(0..coarse.dims[2], &mut count)?;
        let seconds = self.durations(volume, watch)?;
        let printable = self.printable(watch)?;
        let lost = self.lost_volume(printable.inside_voxels);
        let warnings = self.warnings.iter().cloned().chain(lost).chain(printable.warnings());
        let per_voxel = coarse.voxel_volume() / lattice.voxel_volume();
        let counts = counts.map(|count| (count as f64 * per_voxel).round() as u64);
        Ok(Estimate {
            size_mm: extent.to_array(),
            dims: lattice.dims,
            voxels: lattice.voxels(),
            memory_bytes: self.memory_bytes(),
            seconds,
            objects: self.objects.iter().map(ObjectPlace::of).collect(),
            materials: self.material_records(&counts, lattice.voxel_volume()),
            misfits: self.misfits(),
            warnings: warnings.collect(),
            printable,
        })
    }

    /// Memory that the job needs where it needs most, as `scripts/check-memory` measures it: while layers are laid by
    /// place, while a round looks at the print, or while files are written.
    fn memory_bytes(&self) -> u64 {
        let lattice = &self.lattice;
        let slab_height = u64::from(BlockShape::for_lattice(lattice).voxels()[2]);
        let slab = u64::from(lattice.dims[0]) * u64::from(lattice.dims[1]) * slab_height;
        let triangles: u64 = self.objects.iter().map(|object| object.health.triangles as u64).sum();
        let texels: u64 = self.objects.iter().map(|object| object.asked.texels() as u64).sum();
        let wants = |format| self.job.wants(format);
        let volume = |wanted: bool| if wanted && lattice.voxels() <= LOOK_VOXELS { lattice.voxels() / 2 } else { 0 };
        let channels = self.materials.channels.len() as u64;
        let laying = match self.plans.is_empty() {
            true => 0,
            false => texels * (LAID_TEXEL_BYTES + channels * LAID_CHANNEL_BYTES),
        };
        let points: u64 = self.plans.iter().map(|plan| plan.points.points().len() as u64).sum();
        let mapped = self.job.objects.iter().any(|object| object.gamut_map);
        let gamut = if mapped { channels * GAMUT_CHANNEL_BYTES } else { 0 };
        let laying = laying + points * POINT_BYTES + gamut;
        let looking = texels * TEXEL_BYTES + volume(self.job.rounds() > 0 && !self.plans.is_empty());
        let drawing = wants(OutputFormat::Preview);
        // Trees are dropped before pictures are drawn and material meshes made.
        let trees = self.trees_memory();
        let drawn = if drawing { PICTURES_MEMORY.max(trees) + volume(true) } else { trees };
        let meshed = if wants(OutputFormat::Stl) || wants(OutputFormat::ThreeMf) { MESHES_MEMORY } else { 0 };
        let writing = texels * TEXEL_BYTES + slab / 2 + self.fractions_memory(slab) + drawn.max(meshed);
        BASE_MEMORY + triangles * TRIANGLE_BYTES + laying.max(looking).max(writing)
    }

    /// Memory of the volume fractions in a slab of so many voxels, bytes: of one half, as with the voxels themselves,
    /// for the rest is bricks of one composition; and of every worker a row and what it is compressed with.
    fn fractions_memory(&self, slab: u64) -> u64 {
        if self.job.output.volumes != VolumeValues::Fractions || !self.slicer().draws_by_lot() {
            return 0;
        }
        let resins = self.materials.resins.len() as u64;
        let row = u64::from(self.lattice.dims[0]) * resins * FRACTION_ROW_BYTES;
        let workers = rayon::current_num_threads() as u64;
        slab / 2 * resins * FRACTION_BYTES + workers * (row + COMPRESSOR_BYTES)
    }

    /// Refuses a job that needs more memory than the machine has.
    pub(super) fn refuse_too_large(&self) -> Result<(), RunError> {
        let needed = self.memory_bytes();
        match machine::short_of(needed) {
            Some(Shortage { needs, expected }) => {
                let [x, y, z] = self.lattice.dims;
                Err(self.job.refuse("printer", format!("{x} × {y} × {z} voxels, {needs}"), expected).into())
            }
            None => Ok(()),
        }
    }
}
