//! How long a job will take on this machine, about: a few of its slabs are sliced and a few photons sent, and what that
//! took is multiplied.

use std::time::Instant;

use serde::Serialize;

use crate::{
    job::{
        Prepared, RunError,
        file::OutputFormat,
        look::{LOOK_VOXELS, LookError},
        rounds::walks_of_a_round,
    },
    look::Volume,
    voxel::BlockShape,
    watch::Watch,
};

/// Seconds of a job on this machine, about; rounds that end early are not foreseen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Durations {
    /// What reading and searching took just now; where the search is kept in a cache the job need not do it again.
    pub preparing: f64,
    /// Rounds of correction.
    pub rounds: f64,
    /// Slices and containers; meshes are not counted.
    pub slices: f64,
    /// Pictures and the numbers of the look; 0 where none are asked for, or resins have no coefficients.
    pub look: f64,
}

impl Durations {
    /// All that is left to do after a dry run; `cached`: whether what was searched is kept.
    pub fn ahead(&self, cached: bool) -> f64 {
        let preparing = if cached { 0.0 } else { self.preparing };
        preparing + self.rounds + self.slices + self.look
    }
}

/// Slabs that are sliced to tell the time of all.
const SLABS: u32 = 6;
/// Seconds of a job's slices for each of slicing alone: images and files; and as much again for each container.
const WRITING: f64 = 1.4;
const CONTAINER: f64 = 0.3;
/// Seconds of a round for each of its voxels and light: new layers; and of the first one beside that, which lays down
/// what points see.
const LAYING: f64 = 1.2;
const FIRST: f64 = 0.4;
/// The look after the last round, as a share of a round.
const LAST: f64 = 0.25;
/// Walks that the pictures and spots of a job come to.
const LOOK_WALKS: f64 = 1.6e6;

impl Prepared {
    /// Slices some of it and sends some light through `coarse`, its voxels on a coarser lattice.
    pub(super) fn durations(&self, coarse: Volume, watch: &dyn Watch) -> Result<Durations, RunError> {
        let slicing = self.seconds_of_slicing(watch)?;
        let walk = match self.seconds_of_a_walk(coarse, watch) {
            Err(LookError::Stopped(stopped)) => return Err(stopped.into()),
            // What cannot be looked at takes no time.
            other => other.ok().flatten().unwrap_or(0.0),
        };
        let fits = self.lattice.voxels() <= LOOK_VOXELS;
        let points: usize = self.plans.iter().map(|plan| plan.points.points().len()).sum();
        let rounds =
            if self.looked_at_voxels() <= LOOK_VOXELS && points > 0 { f64::from(self.job.rounds()) } else { 0.0 };
        let light = (points as u64 * walks_of_a_round(points, self.materials.channels.len())) as f64 * walk;
        let rounds = match rounds {
            0.0 => 0.0,
            rounds => LAYING * (rounds + FIRST) * (slicing + light) + slicing + LAST * light,
        };
        let containers =
            [OutputFormat::Gcvf, OutputFormat::Bmp, OutputFormat::Vti, OutputFormat::Nrrd, OutputFormat::Vdb];
        let containers = containers.into_iter().filter(|format| self.job.wants(*format)).count();
        let looks = fits && self.job.wants(OutputFormat::Preview);
        Ok(Durations {
            preparing: self.took.whole.as_secs_f64(),
            rounds,
            slices: slicing * (WRITING + CONTAINER * containers as f64),
            look: if looks { LOOK_WALKS * walk } else { 0.0 },
        })
    }

    /// Seconds of slicing all of it, by some slabs from foot to top.
    fn seconds_of_slicing(&self, watch: &dyn Watch) -> Result<f64, RunError> {
        let height = BlockShape::for_lattice(&self.lattice).voxels()[2];
        let slices = self.lattice.dims[2];
        let all = slices.div_ceil(height);
        let slabs = SLABS.min(all);
        let began = Instant::now();
        let mut done = 0;
        for slab in 0..slabs {
            let first = height * ((2 * slab + 1) * all / (2 * slabs));
            let range = first..(first + height).min(slices);
            done += range.end - range.start;
            self.slicer().for_each_slab(range, |_| watch.go_on())?;
        }
        Ok(began.elapsed().as_secs_f64() * f64::from(slices) / f64::from(done.max(1)))
    }
}
