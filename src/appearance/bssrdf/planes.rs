//! A number per ring and texel.

use rayon::prelude::*;

/// Values `[ring][row][column]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// All values.
    pub data: Vec<f32>,
}

impl Planes {
    /// One value everywhere.
    pub fn new(rings: usize, width: usize, height: usize, value: f32) -> Self {
        Self { width, height, data: vec![value; rings * width * height] }
    }

    /// One row of one ring.
    pub fn row(&self, ring: usize, row: usize) -> &[f32] {
        let start = (ring * self.height + row) * self.width;
        &self.data[start..start + self.width]
    }

    /// The same, to write to.
    pub fn row_mut(&mut self, ring: usize, row: usize) -> &mut [f32] {
        let start = (ring * self.height + row) * self.width;
        &mut self.data[start..start + self.width]
    }

    /// Value of a texel.
    pub fn at(&self, ring: usize, texel: usize) -> f32 {
        self.data[ring * self.width * self.height + texel]
    }

    /// Number of rings.
    pub fn rings(&self) -> usize {
        self.data.len() / (self.width * self.height)
    }

    /// Σ of products, in an order that does not depend on threads.
    pub fn dot(&self, other: &Self) -> f64 {
        let row = |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let rows: Vec<f64> = self.data.par_chunks(self.width).zip(other.data.par_chunks(self.width)).map(row).collect();
        rows.iter().sum()
    }

    /// self ← self + factor · other.
    pub fn add(&mut self, factor: f32, other: &Self) {
        let rows = self.data.par_chunks_mut(self.width).zip(other.data.par_chunks(self.width));
        rows.for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b));
    }

    /// self ← other + factor · self.
    pub fn scale_and_add(&mut self, factor: f32, other: &Self) {
        let rows = self.data.par_chunks_mut(self.width).zip(other.data.par_chunks(self.width));
        rows.for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a = b + factor * *a));
    }

    /// Every value through `f`.
    pub fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        Self { data: self.data.par_iter().map(|value| f(*value)).collect(), ..*self }
    }

    /// Replaces every texel's values by their sum over the rings.
    pub fn tie(&mut self) {
        let (texels, rings) = (self.width * self.height, self.rings());
        let sums: Vec<f32> =
            (0..texels).into_par_iter().map(|texel| (0..rings).map(|ring| self.at(ring, texel)).sum()).collect();
        self.data.par_chunks_mut(texels).for_each(|plane| plane.copy_from_slice(&sums));
    }
}
