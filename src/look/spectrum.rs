//! R̂ of a volume that repeats, straight from its photons.
//!
//! A photon that leaves a distance r from where it entered, with weight w, is a sample w J₀(k r) of the Hankel
//! transform of the mean response, without bias and without rings or windows. Distances are counted in steps of
//! [`STEP_MM`].

use std::ops::Range;

use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Pattern, Photons, Sides, VoxelScene, light::Source, top};
use crate::{
    optics::{
        FrequencyGrid, OpticsError,
        monte_carlo::{in_batches, photon::uniform},
    },
    parallel,
    watch::Watch,
};

/// Steps that distances are counted in, mm: at 20 rad/mm a hundredth of a turn of J₀.
const STEP_MM: f64 = 0.002;
/// Steps; what leaves further away counts as if it left at 20 mm.
const STEPS: usize = 10_000;

/// Mean R̂ over all entries.
#[derive(Debug, Clone, PartialEq)]
pub struct ExitSpectrum {
    /// R̂ at each frequency; the first is the albedo.
    pub reflection: Vec<f64>,
    /// One standard deviation of each.
    pub standard_error: Vec<f64>,
}

impl VoxelScene {
    /// R̂ of light that enters anywhere on the top, each place alike.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for what is out of range, among it sides that are not periodic;
    /// [`OpticsError::Stopped`].
    pub fn spectrum(
        &self,
        grid: &FrequencyGrid,
        photons: Photons,
        watch: &dyn Watch,
    ) -> Result<ExitSpectrum, OpticsError> {
        if self.sides != Sides::Periodic {
            return Err(OpticsError::parameter("sides", format!("{:?}", self.sides), "periodic ones".into()));
        }
        let walk = self.checked_walk(photons)?;
        let [x, y, _] = self.size_mm;
        let everywhere = Pattern::Rectangle { min_mm: [0.0; 2], max_mm: [x, y] };
        let source = Source::new(&everywhere, photons.light, self.size_mm)?;
        let mut counts = vec![[0.0; 2]; STEPS];
        let trace = |batch: Range<u64>, mut rng: Xoshiro256PlusPlus| {
            let leave = batch.filter_map(|photon| {
                let share = (photon as f64 + uniform(&mut rng)) / photons.count as f64;
                let (from, direction) = source.draw(share, &mut rng);
                let (to, turns, weight) = top(walk.trace(from, direction, &mut rng))?;
                let [dx, dy] = [0, 1].map(|axis| to[axis] + turns[axis] - from[axis]);
                let step = (dx * dx + dy * dy).sqrt() / STEP_MM;
                Some(((step as usize).min(STEPS - 1) as u32, weight))
            });
            leave.collect::<Vec<_>>()
        };
        in_batches(photons.count, photons.seed, watch, trace, |batch| {
            for (step, weight) in batch {
                let [sum, squares] = &mut counts[step as usize];
                *sum += weight;
                *squares += weight * weight;
            }
        })?;
        let n = photons.count as f64;
        let moments = parallel::map_all(grid.as_slice(), |k| {
            let sums = counts.iter().enumerate().fold([0.0; 2], |[sum, squares], (step, count)| {
                let wave = libm::j0(k * (step as f64 + 0.5) * STEP_MM);
                [sum + count[0] * wave, squares + count[1] * wave * wave]
            });
            let mean = sums[0] / n;
            (mean, ((sums[1] / n - mean * mean).max(0.0) / (n - 1.0)).sqrt())
        });
        let (reflection, standard_error) = moments.into_iter().unzip();
        Ok(ExitSpectrum { reflection, standard_error })
    }
}
