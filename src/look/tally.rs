//! What is counted: an image of the top, or a window around a lit texel.

use super::light::TexelGrid;
use super::walk::End;
use crate::optics::{Estimate, monte_carlo::photon::Moments};

/// Light leaving the top, texel by texel.
#[derive(Debug, Clone, PartialEq)]
pub struct ExitImage {
    /// The texels.
    pub texels: TexelGrid,
    /// Radiosity of each texel in units of the irradiance, as [`TexelGrid`] orders them.
    pub radiosity: Vec<f64>,
    /// One standard deviation of each.
    pub standard_error: Vec<f64>,
    /// Share of the light that leaves by the top, in whatever texel or beside all.
    pub reflection: Estimate,
    /// Share that leaves by the bottom.
    pub transmission: Estimate,
    /// Share lost through open sides.
    pub lost: Estimate,
}

/// Where the light of one texel leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Share of the texel's light that leaves by each texel of the window, the smallest y first and x fastest; divided
    /// by the area of a texel it is R(x_i, x_o) per mm².
    pub share: Vec<f32>,
    /// One standard deviation of each.
    pub standard_error: Vec<f32>,
    /// Share that leaves by the top, within the window or not: the albedo.
    pub reflection: Estimate,
}

/// The ends of a batch of walks. Much smaller than an image, so that a batch is cheap to keep and to add.
#[derive(Default)]
pub(super) struct Counted {
    /// Texel and weight of each photon that left by a texel.
    exits: Vec<(u32, f32)>,
    top: Moments,
    bottom: Moments,
    side: Moments,
}

impl Counted {
    pub fn score(&mut self, texels: &TexelGrid, end: End) {
        match end {
            End::Top { at, weight, .. } => {
                self.top.score(weight);
                if let Some(texel) = texels.index(at) {
                    self.exits.push((texel as u32, weight as f32));
                }
            }
            End::Bottom { weight } => self.bottom.score(weight),
            End::Side { weight } => self.side.score(weight),
            End::Absorbed => {}
        }
    }
}

/// Sums over batches.
pub(super) struct ImageTally {
    texels: TexelGrid,
    exits: Vec<Moments>,
    top: Moments,
    bottom: Moments,
    side: Moments,
}

impl ImageTally {
    pub fn new(texels: TexelGrid) -> Self {
        let none = Moments::default();
        Self { texels, exits: vec![none; texels.len()], top: none, bottom: none, side: none }
    }

    pub fn add(&mut self, batch: &Counted) {
        batch.exits.iter().for_each(|&(texel, weight)| self.exits[texel as usize].score(f64::from(weight)));
        self.top.add(&batch.top);
        self.bottom.add(&batch.bottom);
        self.side.add(&batch.side);
    }

    pub fn image(&self, photons: u64, flux: f64) -> ExitImage {
        let per_mm2 = flux / self.texels.texel_mm2();
        let estimates = self.exits.iter().map(|moments| moments.estimate(photons));
        let (radiosity, standard_error) =
            estimates.map(|estimate| (estimate.mean * per_mm2, estimate.standard_error * per_mm2)).unzip();
        ExitImage {
            texels: self.texels,
            radiosity,
            standard_error,
            reflection: self.top.estimate(photons),
            transmission: self.bottom.estimate(photons),
            lost: self.side.estimate(photons),
        }
    }
}

/// The sums of a lit texel.
pub(super) struct Window {
    /// Column and row of the window's first texel.
    first: [i64; 2],
    width: [usize; 2],
    sums: Vec<Moments>,
    top: Moments,
}

impl Window {
    pub fn new(lit: [i64; 2], reach: [usize; 2]) -> Self {
        let width = reach.map(|reach| 2 * reach + 1);
        let first = std::array::from_fn(|axis| lit[axis] - reach[axis] as i64);
        Self { first, width, sums: vec![Moments::default(); width[0] * width[1]], top: Moments::default() }
    }

    pub fn score(&mut self, texels: &TexelGrid, end: End) {
        let Some((at, turns, weight)) = super::top(end) else { return };
        self.top.score(weight);
        let cell = texels.cell([at[0] + turns[0], at[1] + turns[1]]);
        let [i, j] = std::array::from_fn(|axis| (cell[axis] - self.first[axis]) as usize); // huge where negative
        if i < self.width[0] && j < self.width[1] {
            self.sums[i + self.width[0] * j].score(weight);
        }
    }

    pub fn finish(&self, photons: u64) -> Response {
        let estimates = self.sums.iter().map(|moments| moments.estimate(photons));
        let (share, standard_error) =
            estimates.map(|estimate| (estimate.mean as f32, estimate.standard_error as f32)).unzip();
        Response { share, standard_error, reflection: self.top.estimate(photons) }
    }
}
