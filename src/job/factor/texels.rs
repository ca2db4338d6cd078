//! Every texel's profile as the energy of each ring, window and tail together.

use std::collections::VecDeque;

use super::TailRecord;
use crate::appearance::{
    ClusterId,
    bssrdf::{Dataset, Factors, Rings, TailKind, TailRings, areas},
};
use crate::parallel;

/// Ring energies `[texel][channel][ring]`; their sum is the albedo.
pub(super) struct Texels {
    pub energies: Vec<f64>,
    channels: usize,
    rings: usize,
}

/// Scales energies down so that they hold no more than `most`.
fn limit(energies: &mut [f64], most: f64) {
    let sum: f64 = energies.iter().sum();
    if sum > most {
        energies.iter_mut().for_each(|energy| *energy *= most.max(0.0) / sum);
    }
}

/// Windows with at least this share of every ring are taken as measured.
const WHOLE: f32 = 0.999;

/// What is known of a texel's light, as shares of what was sent in.
struct Told {
    kind: TailKind,
    within: f64,
    beyond: f64,
    /// What a tail by slope alone would hold.
    continued: f64,
    albedo: Option<f64>,
}

impl Texels {
    pub(super) fn new(texels: usize, channels: usize, rings: usize) -> Self {
        Self { energies: vec![0.0; texels * channels * rings], channels, rings }
    }

    /// Fills in one channel, its tails fitted to `albedo` where that is known.
    pub(super) fn fill(
        &mut self,
        channel: usize,
        factors: &Factors,
        rings: &Rings,
        tail_rings: &TailRings,
        albedo: impl Fn(usize) -> Option<f64> + Sync,
    ) -> TailRecord {
        let (areas, stride) = (areas(&rings.edges_mm), self.channels * self.rings);
        let (start, end) = (channel * self.rings, (channel + 1) * self.rings);
        let tell = |texel: usize, row: &mut [f64]| {
            let profile: Vec<f64> = factors.profile(texel).collect();
            let (window, beyond) = row[start..end].split_at_mut(rings.len());
            for ((energy, p), area) in window.iter_mut().zip(&profile).zip(&areas) {
                *energy = p * area;
            }
            // What the texel sends out around it: its neighbours have their part in it, so it is not the energy of
            // its profile.
            let whole = (0..rings.len()).all(|ring| factors.availability.at(ring, texel) > WHOLE);
            let within = if whole { factors.energy[texel] } else { window.iter().sum() };
            let albedo = albedo(texel);
            let (mut tail, kind) = tail_rings.tail(&profile, albedo.map(|albedo| albedo - within));
            let mut continued = tail_rings.tail(&profile, None).0;
            // A slope taken from noise may promise more light than there is.
            limit(&mut continued, 1.0 - within);
            if kind == TailKind::Continued {
                tail.copy_from_slice(&continued);
            }
            beyond.copy_from_slice(&tail);
            let continued = continued.iter().sum();
            Told { kind, within, beyond: tail.iter().sum(), continued, albedo }
        };
        let told: Vec<Told> = parallel::map_rows(&mut self.energies, stride, tell);
        let count = |kind: TailKind| told.iter().filter(|told| told.kind == kind).count();
        let mean = |of: &dyn Fn(&Told) -> f64| told.iter().map(of).sum::<f64>() / told.len() as f64;
        let error = |of: &dyn Fn(&Told) -> f64| {
            let squares = told.iter().filter_map(|told| Some((of(told) - told.albedo?).powi(2)));
            let (sum, count) = squares.fold((0.0, 0_usize), |(sum, count), square| (sum + square, count + 1));
            (count > 0).then(|| (sum / count as f64).sqrt())
        };
        TailRecord {
            from_mm: tail_rings.edges_mm[0],
            fitted: count(TailKind::Fitted),
            stretched: count(TailKind::Stretched),
            continued: count(TailKind::Continued),
            none: count(TailKind::None),
            mean_energy_in_window: mean(&|told| told.within),
            mean_energy_in_tail: mean(&|told| told.beyond),
            mean_energy_continued: mean(&|told| told.continued),
            albedo_rms_error_without: error(&|told| told.within),
            albedo_rms_error_continued: error(&|told| told.within + told.continued),
            albedo_rms_error_with: error(&|told| told.within + told.beyond),
        }
    }

    fn row(&self, texel: usize) -> std::ops::Range<usize> {
        let stride = self.channels * self.rings;
        texel * stride..(texel + 1) * stride
    }

    /// Gives texels that were not measured the profile of the nearest one that was, by steps to neighbours; how many
    /// there are.
    pub(super) fn adopt_missing(&mut self, dataset: &Dataset) -> usize {
        let (width, texels) = (dataset.width, dataset.texels());
        let mut done: Vec<bool> = (0..texels).map(|texel| dataset.is_present(texel)).collect();
        let missing = done.iter().filter(|done| !**done).count();
        let mut queue: VecDeque<usize> = (0..texels).filter(|texel| done[*texel]).collect();
        while let Some(texel) = queue.pop_front().filter(|_| missing > 0) {
            let x = texel % width;
            let neighbours = [
                (x > 0).then(|| texel - 1),
                (x + 1 < width).then_some(texel + 1),
                texel.checked_sub(width),
                Some(texel + width).filter(|below| *below < texels),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if !std::mem::replace(&mut done[neighbour], true) {
                    let (from, to) = (self.row(texel), self.row(neighbour).start);
                    self.energies.copy_within(from, to);
                    queue.push_back(neighbour);
                }
            }
        }
        missing
    }

    /// Mean energies of each cluster, `[channel][ring]`.
    pub(super) fn means(&self, labels: &[ClusterId], clusters: usize) -> Vec<Vec<f64>> {
        let stride = self.channels * self.rings;
        let mut sums = vec![vec![0.0; stride]; clusters];
        let mut counts = vec![0.0; clusters];
        for (row, &label) in self.energies.chunks(stride).zip(labels) {
            counts[label.index()] += 1.0;
            sums[label.index()].iter_mut().zip(row).for_each(|(sum, energy)| *sum += energy);
        }
        for (sum, count) in sums.iter_mut().zip(counts) {
            sum.iter_mut().for_each(|sum| *sum /= f64::max(count, 1.0));
        }
        sums
    }

    /// Profiles per mm².
    pub(super) fn per_mm2(&self, areas: &[f64]) -> Vec<f32> {
        self.energies.chunks(self.rings).flat_map(|row| row.iter().zip(areas).map(|(e, a)| (e / a) as f32)).collect()
    }

    /// Albedo of a texel, per channel.
    pub(super) fn albedo(&self, texel: usize) -> impl Iterator<Item = f64> + '_ {
        self.energies[self.row(texel)].chunks(self.rings).map(|row| row.iter().sum())
    }
}
