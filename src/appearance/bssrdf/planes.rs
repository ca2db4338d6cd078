//! A number per ring and texel.

use crate::parallel;

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
        let row = |[a, b]: [&[f32]; 2]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let of = |n: usize| [self, other].map(|planes| &planes.data[n * self.width..][..self.width]);
        let rows: Vec<f64> = parallel::map(self.data.len() / self.width, |n| row(of(n)));
        rows.iter().sum()
    }

    /// self ← self + factor · other.
    pub fn add(&mut self, factor: f32, other: &Self) {
        self.combine(other, |a, b| a + factor * b);
    }

    /// self ← other + factor · self.
    pub fn scale_and_add(&mut self, factor: f32, other: &Self) {
        self.combine(other, |a, b| b + factor * a);
    }

    /// self ← `of` self and other, value by value.
    pub fn combine(&mut self, other: &Self, of: impl Fn(f32, f32) -> f32 + Sync) {
        let width = self.width;
        parallel::rows(&mut self.data, width, |n, row| {
            row.iter_mut().zip(&other.data[n * width..]).for_each(|(a, b)| *a = of(*a, *b));
        });
    }

    /// Every value through `f`.
    pub fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        let mut out = self.clone();
        parallel::rows(&mut out.data, self.width, |_, row| row.iter_mut().for_each(|value| *value = f(*value)));
        out
    }

    /// Replaces every texel's values by their sum over the rings.
    pub fn tie(&mut self) {
        let (texels, rings) = (self.width * self.height, self.rings());
        let sums = parallel::map(texels, |texel| (0..rings).map(|ring| self.at(ring, texel)).sum::<f32>());
        parallel::rows(&mut self.data, texels, |_, plane| plane.copy_from_slice(&sums));
    }
}
