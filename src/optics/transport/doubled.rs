//! A stack by doubling every layer: slower than [`super::modal`], but exact without absorption too.

use faer::{Mat, Row, linalg::solvers::Solve};

use super::{
    Transport, VolumeCoefficients,
    directions::{AIR, Directions},
    flux,
    interface::reflectances,
    scattering::Scattering,
    slab::{Slab, factorise, plus_identity},
    source,
};

/// A stack over its directions.
pub(super) struct Doubled {
    pub(super) directions: Directions,
    pub(super) layers: Vec<(Scattering, f64)>,
    base: Option<Scattering>,
    light: super::Light,
}

/// A stack seen from within the medium above it.
struct Below {
    reflection: Mat<f64>,
    /// Flux that leaves at the bottom for one unit from each direction.
    through: Row<f64>,
    /// Refractive index of its uppermost medium.
    index: f64,
}

impl Doubled {
    /// Of the model's light and core with these layers in place of its own.
    pub(super) fn new(model: &Transport<'_>, layers: &[(VolumeCoefficients, f64)]) -> Self {
        let volumes = layers.iter().map(|(volume, _)| volume).chain(&model.stack.core);
        let indices = volumes.map(|volume| volume.refractive_index);
        Self::over(model, layers, Directions::new(indices, model.options))
    }

    /// The same over given directions, which must know the indices.
    pub(super) fn over(model: &Transport<'_>, layers: &[(VolumeCoefficients, f64)], directions: Directions) -> Self {
        let scattering = |volume: &VolumeCoefficients| Scattering::new(volume, &directions);
        let layers = layers.iter().map(|(volume, mm)| (scattering(volume), *mm)).collect();
        Self { layers, base: model.stack.core.as_ref().map(scattering), light: model.light, directions }
    }

    /// R̂ without the glint, and T̂.
    pub(super) fn spectra(&self, k: f64) -> (f64, f64) {
        let n = self.directions.len();
        let bottom = match &self.base {
            Some(base) => Below {
                reflection: Slab::half_space(&base.generator(k), base.extinction),
                through: Row::zeros(n),
                index: base.index,
            },
            None => Below { reflection: Mat::zeros(n, n), through: flux(&self.directions), index: AIR },
        };
        let stack = self.layers.iter().rev().fold(bottom, |below, (resin, mm)| {
            below.beyond(resin.index, &self.directions, true).under(&Slab::new(&resin.generator(k), *mm))
        });
        let stack = stack.beyond(AIR, &self.directions, false);
        let source = source(self.light, &self.directions);
        (flux(&self.directions) * (&stack.reflection * &source), &stack.through * &source)
    }
}

impl Below {
    /// Seen from a medium of refractive index `above`, with or without what the boundary reflects at once.
    fn beyond(self, above: f64, directions: &Directions, mirror: bool) -> Self {
        let Some(f) = reflectances(directions, above, self.index) else { return self };
        let n = f.len();
        let between = Mat::from_fn(n, n, |i, j| -f[i] * self.reflection[(i, j)]);
        let down = factorise(&plus_identity(between, 1.0));
        let down = down.solve(Mat::from_fn(n, n, |i, j| if i == j { 1.0 - f[i] } else { 0.0 }));
        let up = &self.reflection * &down;
        let own = |i: usize, j: usize| if mirror && i == j { f[i] } else { 0.0 };
        Self {
            reflection: Mat::from_fn(n, n, |i, j| (1.0 - f[i]) * up[(i, j)] + own(i, j)),
            through: &self.through * &down,
            index: above,
        }
    }

    /// Lays a slab of the uppermost medium on top: equations 3 and 4 with matrices.
    fn under(&self, slab: &Slab) -> Self {
        // What goes down between the two: (I − R_slab R_below)⁻¹ T_slab.
        let between = plus_identity(faer::Scale(-1.0) * (&slab.reflection * &self.reflection), 1.0);
        let down = factorise(&between).solve(&slab.transmission);
        Self {
            reflection: &slab.reflection + &slab.transmission * (&self.reflection * &down),
            through: &self.through * &down,
            index: self.index,
        }
    }
}
