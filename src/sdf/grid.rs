//! Distance on the grid: from voxel centre to the centre of the nearest surface voxel, with that voxel's index.
//!
//! What Hašan et al. 2010 (section 7.2) lay their layers by, after Saito and Toriwaki 1994. The squared distance
//! separates into the axes, so three passes of one-dimensional transforms find its minimum exactly:
//!
//! ```text
//!   columns   nearest surface voxel of each column          (SurfaceVoxels)
//!   rows in y lower envelope of parabolas, one per column   Felzenszwalb and Huttenlocher 2012, section 2;
//!   rows in x the same over the result of the second pass   pitches enter as positions in mm
//! ```
//!
//! A **surface voxel** is one the surface passes through. Every surface point lies in such a voxel, and every such
//! voxel holds a surface point, each within half a voxel's diagonal h of the centre. So this distance differs from the
//! exact one by at most h, whatever the surface; at J750 pitch that is 49 µm, more than half of a 78 µm layer. On
//! planes along the axes the error is at most half a pitch, either way; on slanted ones the distance is mostly too
//! short.
//!
//! Fails to be exact only by rounding: two features as near within about 10⁻¹² of the squared reach are a tie.

use std::ops::Range;

use glam::{DVec3, IVec2, IVec3};

/// The feature transform of a box of voxels.
#[derive(Debug, Default)]
pub struct FeatureWindow {
    first: IVec3,
    size: [usize; 3],
    /// Nearest feature; x runs fastest. [`NONE`] where there is none in reach.
    features: Vec<IVec3>,
    envelope: Vec<Parabola>,
    rows: Vec<Feature>,
}

/// Where the features are that a transform may use.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Columns that may hold features: first (x, y), and one past the last.
    pub columns: [IVec2; 2],
    /// Features further away than this, mm, may be left out.
    pub distance: f64,
}

const NONE: IVec3 = IVec3::MAX;

/// The best feature of a row so far: its squared distance within (y, z), mm², and its y and z.
#[derive(Debug, Clone, Copy)]
struct Feature {
    squared: f64,
    y: i32,
    z: i32,
}

/// One parabola of a lower envelope: `height` + (position − x)² from `start` to the start of the next.
#[derive(Debug, Clone, Copy)]
struct Parabola {
    start: f64,
    position: f64,
    height: f64,
    index: i32,
    z: i32,
}

impl FeatureWindow {
    /// Computes the nearest feature of each of the `size` voxels from `first` on. `nearest(x, y, z)` is the slice of
    /// the feature in column (x, y) that is nearest to slice z. Exact wherever the nearest feature is within `reach`.
    pub fn compute(
        &mut self,
        pitch: DVec3,
        first: IVec3,
        size: [usize; 3],
        reach: Reach,
        nearest: impl Fn(i32, i32, i32) -> Option<i32>,
    ) {
        (self.first, self.size) = (first, size);
        self.features.clear();
        self.features.resize(size.iter().product(), NONE);
        let end = first + IVec3::from(size.map(|n| n as i32));
        let margin = |axis: usize| (reach.distance / pitch[axis]).ceil().min(f64::from(i32::MAX / 4)) as i32;
        let side = |axis: usize| -> Range<i32> {
            let (low, high) = (first[axis] - margin(axis), end[axis] + margin(axis));
            low.max(reach.columns[0][axis])..high.min(reach.columns[1][axis])
        };
        let (columns, rows) = (side(0), side(1));
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        // A hair more than the reach, so that a feature exactly there is not lost to rounding.
        let limit = (reach.distance * (1.0 + 1e-9)).powi(2);
        for z in first.z..end.z {
            self.rows.clear();
            self.rows.resize(columns.len() * size[1], Feature { squared: f64::INFINITY, y: 0, z: 0 });
            for x in columns.clone() {
                self.envelope.clear();
                for y in rows.clone() {
                    let Some(feature) = nearest(x, y, z) else { continue };
                    let height = (f64::from(feature - z) * pitch.z).powi(2);
                    if height <= limit {
                        push(&mut self.envelope, f64::from(y - first.y) * pitch.y, height, y, feature);
                    }
                }
                let into = self.rows[(x - columns.start) as usize..].iter_mut().step_by(columns.len());
                walk(&self.envelope, pitch.y, into, |row, squared, best| {
                    *row = Feature { squared, y: best.index, z: best.z };
                });
            }
            let plane = (z - first.z) as usize * size[0] * size[1];
            for (n, row) in self.rows.chunks(columns.len()).enumerate() {
                self.envelope.clear();
                for (x, feature) in columns.clone().zip(row) {
                    if feature.squared <= limit {
                        let position = f64::from(x - first.x) * pitch.x;
                        push(&mut self.envelope, position, feature.squared, x, feature.z);
                    }
                }
                let start = plane + n * size[0];
                walk(&self.envelope, pitch.x, self.features[start..start + size[0]].iter_mut(), |out, _, best| {
                    let feature = row[(best.index - columns.start) as usize];
                    *out = IVec3::new(best.index, feature.y, feature.z);
                });
            }
        }
    }

    /// The feature nearest to voxel `index`, which must lie in the box; `None` if there is none in reach.
    #[inline]
    pub fn feature(&self, index: IVec3) -> Option<IVec3> {
        let local = (index - self.first).as_uvec3();
        let [width, height, _] = self.size;
        let feature = self.features[local.x as usize + width * (local.y as usize + height * local.z as usize)];
        (feature != NONE).then_some(feature)
    }
}

/// Adds a parabola to the right of all others.
#[inline]
fn push(envelope: &mut Vec<Parabola>, position: f64, height: f64, index: i32, z: i32) {
    let mut start = f64::NEG_INFINITY;
    while let Some(last) = envelope.last() {
        let ahead = position - last.position;
        // Where the two are equal; from there on the new one is lower.
        start = 0.5 * ((height - last.height) / ahead + position + last.position);
        if start > last.start {
            break;
        }
        envelope.pop();
        start = f64::NEG_INFINITY;
    }
    envelope.push(Parabola { start, position, height, index, z });
}

/// Hands each of `into`, at positions 0, `pitch`, 2 `pitch`, …, the lowest parabola and its value there.
#[inline]
fn walk<'a, T: 'a>(
    envelope: &[Parabola],
    pitch: f64,
    into: impl Iterator<Item = &'a mut T>,
    mut hand: impl FnMut(&mut T, f64, &Parabola),
) {
    let Some(mut best) = envelope.first() else { return };
    let mut rest = &envelope[1..];
    for (n, out) in into.enumerate() {
        let x = n as f64 * pitch;
        while let Some((next, later)) = rest.split_first().filter(|(next, _)| next.start <= x) {
            (best, rest) = (next, later);
        }
        hand(out, best.height + (best.position - x).powi(2), best);
    }
}
