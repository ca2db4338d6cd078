//! The normal equations of the factorisation without a matrix, and conjugate gradients on them.
//!
//! A measurement ties two unknowns of one ring together, ½(qᵢ + qₒ); so a ring's normal matrix is a sum over the ring's
//! window pixels of shifted copies of the image, weighted by what the model says the weights are. Nothing per pair is
//! stored. Rings are coupled by the prior alone: small second differences along r, very small first ones, so that what
//! lies under the noise floor goes on as what lies above it. The system is well conditioned (a ring's average over its
//! neighbours is at least −0.4), and Jacobi's preconditioner takes care of the weights.

use super::{
    kernel::{self, Variance},
    passes::{Model, inside, moved},
    planes::Planes,
    rings::Rings,
};
use crate::parallel;

/// Precision of the differences along r that are expected to vanish, against ones of measurements: 1/σ² of ln P.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Of second differences of ln(P/g) from ring to ring.
    pub second: f32,
    /// Of first ones.
    pub first: f32,
    /// Of ln(P/g) itself.
    pub value: f32,
}

/// The system at one model.
pub struct Operator<'a> {
    pub rings: &'a Rings,
    pub model: &'a Model<'a>,
    pub variance: Variance,
    /// Share of each texel's window that was measured, by ring.
    pub availability: &'a Planes,
    /// Weight of what is seen beyond the patch.
    pub outside: &'a Planes,
    pub prior: Prior,
    /// ln(P/g) is one number per texel, the same for all rings.
    pub tied: bool,
}

impl Operator<'_> {
    /// out ← A p.
    pub fn apply(&self, p: &Planes, out: &mut Planes) {
        let Planes { width, height, .. } = *p;
        let rows = self.rows(|y| self.coupled(y, p));
        parallel::rows(&mut out.data, width, |index, out| {
            let (ring, y) = (index / height, index % height);
            out.copy_from_slice(&rows[y][ring * width..(ring + 1) * width]);
            for ((out, outside), p) in out.iter_mut().zip(self.outside.row(ring, y)).zip(p.row(ring, y)) {
                *out += outside * p;
            }
            if !self.tied {
                self.smooth(ring, y, p, out);
            }
        });
        if self.tied {
            out.tie();
            out.add(self.prior.value, p);
        }
    }

    fn rows(&self, row: impl Fn(usize) -> Vec<f32> + Sync + Send) -> Vec<Vec<f32>> {
        parallel::map(self.model.roots.height, row)
    }

    /// The measurements' part of a row, ring after ring.
    fn coupled(&self, y: usize, p: &Planes) -> Vec<f32> {
        let width = p.width;
        let mut out = vec![0.0; self.rings.len() * width];
        let (mut here, mut sum) = (vec![0.0; width], vec![0.0; width]);
        for (distance, node) in self.model.nodes.iter().enumerate() {
            node.blend(|ring| p.row(ring, y), &mut here);
            self.couple(distance, y, &here, |row| node.ends().map(|ring| p.row(ring, row)), node.share, &mut sum);
            for (ring, part) in node.parts() {
                let out = &mut out[ring * width..(ring + 1) * width];
                out.iter_mut().zip(&sum).for_each(|(out, sum)| *out += part * sum);
            }
        }
        out
    }

    /// The measurements' part of a row of the diagonal.
    fn diagonal(&self, y: usize) -> Vec<f32> {
        let width = self.model.roots.width;
        let mut out = vec![0.0; self.rings.len() * width];
        let (ones, zeros, mut sum) = (vec![1.0; width], vec![0.0; width], vec![0.0; width]);
        for (distance, node) in self.model.nodes.iter().enumerate() {
            self.couple(distance, y, &ones, |_| [&zeros, &zeros], 0.0, &mut sum);
            for (ring, part) in node.parts() {
                let out = &mut out[ring * width..(ring + 1) * width];
                out.iter_mut().zip(&sum).for_each(|(out, sum)| *out += part * part * sum);
            }
        }
        out
    }

    /// out ← what the measurements at one distance make of a row; p at that distance is `here`, and on the way from one
    /// of two rows to the other where they are seen.
    fn couple<'p>(
        &self,
        distance: usize,
        y: usize,
        here: &[f32],
        seen: impl Fn(usize) -> [&'p [f32]; 2],
        share: f32,
        out: &mut [f32],
    ) {
        let (roots, availability) = (self.model.roots, self.availability);
        let (width, height) = (roots.width, roots.height);
        out.fill(0.0);
        for offset in self.rings.at(distance) {
            let Some(row) = y.checked_add_signed(offset.dy).filter(|row| *row < height) else { continue };
            let from = inside(width, offset.dx);
            if from.is_empty() {
                continue;
            }
            let to = moved(&from, offset.dx);
            let [low, high] = seen(row);
            kernel::couple(
                &roots.row(distance, y)[from.clone()],
                &roots.row(distance, row)[to.clone()],
                self.model.global[distance],
                self.variance,
                [&availability.row(offset.ring, y)[from.clone()], &availability.row(offset.ring, row)[to.clone()]],
                &here[from.clone()],
                [&low[to.clone()], &high[to]],
                share,
                &mut out[from],
            );
        }
    }

    /// Adds the prior's part of a row.
    fn smooth(&self, ring: usize, y: usize, p: &Planes, out: &mut [f32]) {
        let last = p.rings() - 1;
        let row = |ring: usize| p.row(ring, y);
        let mut add = |factor: f32, ring: usize| {
            out.iter_mut().zip(row(ring)).for_each(|(out, p)| *out += factor * p);
        };
        add(self.prior.value, ring);
        for (low, high) in [(ring.wrapping_sub(1), ring), (ring, ring + 1)] {
            if low < last && high <= last {
                let sign = if ring == high { 1.0 } else { -1.0 };
                add(sign * self.prior.first, high);
                add(-sign * self.prior.first, low);
            }
        }
        for middle in ring.saturating_sub(1)..=ring + 1 {
            if (1..last).contains(&middle) {
                let factor = self.prior.second * if middle == ring { -2.0 } else { 1.0 };
                add(factor, middle - 1);
                add(-2.0 * factor, middle);
                add(factor, middle + 1);
            }
        }
    }

    /// The prior's part of A p.
    pub fn prior_of(&self, p: &Planes) -> Planes {
        let mut out = p.map(|_| 0.0);
        parallel::rows(&mut out.data, p.width, |index, out| {
            self.smooth(index / p.height, index % p.height, p, out);
        });
        out
    }

    /// 1/diagonal.
    fn inverse_diagonal(&self) -> Planes {
        let (width, height) = (self.model.roots.width, self.model.roots.height);
        let rows = self.rows(|y| self.diagonal(y));
        let mut sums = self.outside.clone();
        parallel::rows(&mut sums.data, width, |index, sums| {
            let (ring, y) = (index / height, index % height);
            sums.iter_mut().zip(&rows[y][ring * width..]).for_each(|(sum, part)| *sum += part);
        });
        if self.tied {
            sums.tie();
        }
        let prior = if self.tied { 0.0 } else { 6.0 * self.prior.second + 2.0 * self.prior.first };
        sums.map(|sum| 1.0 / (sum + prior + self.prior.value))
    }

    /// Solves A x = b to `tolerance` of b, in at most `most` steps; returns x and the steps taken.
    pub fn solve(&self, b: &Planes, tolerance: f64, most: usize) -> (Planes, usize) {
        let inverse = self.inverse_diagonal();
        let precondition = |r: &Planes| {
            let mut z = r.clone();
            z.combine(&inverse, |z, inverse| z * inverse);
            z
        };
        let mut x = b.map(|_| 0.0);
        let mut r = b.clone();
        let mut z = precondition(&r);
        let mut p = z.clone();
        let mut image = b.map(|_| 0.0);
        let mut rho = r.dot(&z);
        let goal = tolerance * tolerance * rho;
        for step in 0..most {
            if !(rho > goal) {
                return (x, step);
            }
            self.apply(&p, &mut image);
            let alpha = rho / p.dot(&image);
            x.add(alpha as f32, &p);
            r.add(-alpha as f32, &image);
            z = precondition(&r);
            let next = r.dot(&z);
            p.scale_and_add((next / rho) as f32, &z);
            rho = next;
        }
        (x, most)
    }
}
