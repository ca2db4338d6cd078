//! Where light enters, and the texels that entering and leaving light is counted in.

use rand_xoshiro::Xoshiro256PlusPlus;

use crate::optics::{
    Light, OpticsError,
    monte_carlo::photon::{Direction, azimuth, uniform},
};

/// Rectangles side by side on the top: texel (i, j) fills `origin_mm` + [i, i + 1) × [j, j + 1) · `pitch_mm`; values
/// for them are stored with i fastest, row 0 at the smallest y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelGrid {
    /// Corner of texel (0, 0), mm, in the frame of the voxel grid.
    pub origin_mm: [f64; 2],
    /// Size of a texel, mm.
    pub pitch_mm: [f64; 2],
    /// Texels along x and y.
    pub dims: [usize; 2],
}

impl TexelGrid {
    /// Number of texels.
    pub fn len(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    /// Whether there is no texel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Area of a texel, mm².
    pub fn texel_mm2(&self) -> f64 {
        self.pitch_mm[0] * self.pitch_mm[1]
    }

    /// Column and row that a point falls into, which may lie outside of the grid.
    pub(super) fn cell(&self, at: [f64; 2]) -> [i64; 2] {
        std::array::from_fn(|axis| ((at[axis] - self.origin_mm[axis]) / self.pitch_mm[axis]).floor() as i64)
    }

    /// Index of the texel that a point falls into.
    pub(super) fn index(&self, at: [f64; 2]) -> Option<usize> {
        let [i, j] = self.cell(at);
        let inside = i >= 0 && j >= 0 && (i as usize) < self.dims[0] && (j as usize) < self.dims[1];
        inside.then(|| i as usize + self.dims[0] * j as usize)
    }

    pub(super) fn rectangle(&self, i: usize, j: usize) -> [[f64; 2]; 2] {
        let low = [i, j].map(|n| n as f64);
        let corner =
            |step: f64| std::array::from_fn(|axis| self.origin_mm[axis] + (low[axis] + step) * self.pitch_mm[axis]);
        [corner(0.0), corner(1.0)]
    }

    pub(super) fn check(&self) -> Result<(), OpticsError> {
        let positive = self.pitch_mm.iter().all(|pitch| *pitch > 0.0 && pitch.is_finite());
        if self.is_empty() || !positive || !self.origin_mm.iter().all(|at| at.is_finite()) {
            let found = format!("{:?} of {:?} mm from {:?} mm", self.dims, self.pitch_mm, self.origin_mm);
            return Err(OpticsError::parameter("texels", found, "at least one, of a finite size above 0".into()));
        }
        Ok(())
    }
}

/// The part of the top that is lit.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// Irradiance 1 per mm² between two corners; a rectangle without area is a point or a line of flux 1.
    Rectangle {
        /// Corner of smallest x and y, mm.
        min_mm: [f64; 2],
        /// Corner of largest x and y, mm.
        max_mm: [f64; 2],
    },
    /// An irradiance for every texel.
    Image {
        /// The texels.
        texels: TexelGrid,
        /// Irradiance, finite and ≥ 0, not 0 everywhere; as [`TexelGrid`] orders it.
        irradiance: Vec<f32>,
    },
}

/// A pattern ready to be drawn from.
pub(super) struct Source {
    direction: Light,
    pattern: Drawn,
    /// Light that enters, in units of irradiance · mm².
    pub flux: f64,
}

enum Drawn {
    Rectangle([[f64; 2]; 2]),
    /// Running sum of the irradiance.
    Image(TexelGrid, Vec<f64>),
}

impl Source {
    pub fn new(pattern: &Pattern, direction: Light, size: [f64; 3]) -> Result<Self, OpticsError> {
        let within = |[low, high]: [[f64; 2]; 2]| {
            (0..2).all(|axis| 0.0 <= low[axis] && low[axis] <= high[axis] && high[axis] <= size[axis] * (1.0 + 1e-9))
        };
        let refuse = |low: [f64; 2], high: [f64; 2]| {
            let [x, y, _] = size;
            OpticsError::parameter("lit area", format!("{low:?} to {high:?} mm"), format!("within 0 to {x} and {y} mm"))
        };
        match pattern {
            &Pattern::Rectangle { min_mm, max_mm } => {
                if !within([min_mm, max_mm]) {
                    return Err(refuse(min_mm, max_mm));
                }
                let area = (max_mm[0] - min_mm[0]) * (max_mm[1] - min_mm[1]);
                let flux = if area > 0.0 { area } else { 1.0 };
                Ok(Self { direction, pattern: Drawn::Rectangle([min_mm, max_mm]), flux })
            }
            Pattern::Image { texels, irradiance } => {
                texels.check()?;
                let high = texels.rectangle(texels.dims[0] - 1, texels.dims[1] - 1)[1];
                if !within([texels.origin_mm, high]) {
                    return Err(refuse(texels.origin_mm, high));
                }
                if irradiance.len() != texels.len() {
                    let expected = format!("one for each of {} texels", texels.len());
                    return Err(OpticsError::parameter("irradiance", format!("{} values", irradiance.len()), expected));
                }
                if let Some(bad) = irradiance.iter().find(|value| !(**value >= 0.0 && value.is_finite())) {
                    return Err(OpticsError::parameter("irradiance", bad, "finite values, 0 or more".into()));
                }
                let sum = |total: &mut f64, value: &f32| {
                    *total += f64::from(*value);
                    Some(*total)
                };
                let running: Vec<f64> = irradiance.iter().scan(0.0, sum).collect();
                let total = running.last().copied().unwrap_or(0.0);
                if !(total > 0.0) {
                    return Err(OpticsError::parameter("irradiance", "0 everywhere", "some light".into()));
                }
                let flux = total * texels.texel_mm2();
                Ok(Self { direction, pattern: Drawn::Image(*texels, running), flux })
            }
        }
    }

    /// A photon's entry. `share` in [0, 1) chooses the texel of an image: photons spread evenly over [0, 1) share out
    /// as the irradiance is.
    #[inline]
    pub fn draw(&self, share: f64, rng: &mut Xoshiro256PlusPlus) -> ([f64; 2], Direction) {
        let [low, high] = match &self.pattern {
            Drawn::Rectangle(corners) => *corners,
            Drawn::Image(texels, running) => {
                let total = running[running.len() - 1];
                let index = running.partition_point(|sum| *sum <= share * total).min(running.len() - 1);
                texels.rectangle(index % texels.dims[0], index / texels.dims[0])
            }
        };
        let at = std::array::from_fn(|axis| low[axis] + (high[axis] - low[axis]) * uniform(rng));
        (at, entering(self.direction, rng))
    }
}

/// A direction of entering light, down into the volume.
#[inline]
pub(super) fn entering(light: Light, rng: &mut Xoshiro256PlusPlus) -> Direction {
    match light {
        Light::Normal => Direction { x: 0.0, y: 0.0, z: 1.0 },
        Light::Diffuse => {
            let cosine_squared = 1.0 - uniform(rng); // in (0, 1]
            let sine = (1.0 - cosine_squared).sqrt();
            let (cos_phi, sin_phi) = azimuth(rng);
            Direction { x: sine * cos_phi, y: sine * sin_phi, z: cosine_squared.sqrt() }
        }
    }
}
