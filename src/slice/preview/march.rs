//! What a ray meets first: the face of the cut, or the surface of the object.
//!
//! The surface is where the volume's coverage, trilinear between the cells' centres, is one half. The face is read from the
//! cuts near the lattice's own resolution, so layers stay sharp however coarse the volume is. The quarter with x > focus and
//! y < focus is taken out: the one towards the camera. A ray that comes from the camera enters what is left once, so
//! the quarter ends at one distance.

use glam::DVec3;

use super::{section::Section, volume::Volume};

/// Cells along an edge of the bricks that empty space is skipped by.
const SKIP: usize = 8;
/// Length of a step, cells.
const STEP: f64 = 0.5;
/// Coverage at the surface.
const SURFACE: f32 = 127.5;

/// The camera, far away: parallel rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// Unit vectors of the image in the lattice's frame.
    pub right: DVec3,
    /// Upwards in the image.
    pub up: DVec3,
    /// From the object to the camera.
    pub toward: DVec3,
}

impl View {
    /// The camera stands at this azimuth (counter-clockwise from +x) and elevation, radians.
    pub fn new(azimuth: f64, elevation: f64) -> Self {
        let toward = DVec3::new(
            libm::cos(elevation) * libm::cos(azimuth),
            libm::cos(elevation) * libm::sin(azimuth),
            libm::sin(elevation),
        );
        let right = DVec3::Z.cross(toward).normalize();
        Self { right, up: toward.cross(right), toward }
    }
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Hit {
    /// A cut face, perpendicular to this axis, made of this id.
    Face { axis: usize, id: u8 },
    /// The surface of the object.
    Surface,
}

/// A volume with a quarter taken out.
#[derive(Debug)]
pub(super) struct Scene<'a> {
    pub volume: &'a Volume,
    /// The faces: perpendicular to x and to y.
    pub faces: [&'a Section; 2],
    /// Where the faces are, mm.
    pub focus: [f64; 2],
    /// 1 / edge of a cell.
    per_edge: DVec3,
    extent: DVec3,
    /// Whether a brick of cells, or one beside it, holds anything.
    busy: Vec<bool>,
    bricks: [usize; 3],
}

impl<'a> Scene<'a> {
    /// A scene; positions are mm from the lattice's lower corner.
    pub fn new(volume: &'a Volume, faces: [&'a Section; 2], focus: [f64; 2]) -> Self {
        let bricks = volume.n.map(|n| n.div_ceil(SKIP));
        let mut busy = vec![false; bricks.iter().product()];
        let at = |[x, y, z]: [usize; 3]| x + bricks[0] * (y + bricks[1] * z);
        let [nx, ny, _] = volume.n;
        for (row, ids) in volume.ids.chunks_exact(nx).enumerate() {
            let (y, z) = (row % ny, row / ny);
            for (brick, cells) in ids.chunks(SKIP).enumerate() {
                if cells.iter().any(|&id| id != 0) {
                    // Interpolation reaches one cell further.
                    let range = |cell: usize, n: usize| cell.saturating_sub(1) / SKIP..=(cell + 1).min(n - 1) / SKIP;
                    for bz in range(z, volume.n[2]) {
                        for by in range(y, ny) {
                            for bx in brick.saturating_sub(1)..=(brick + 1).min(bricks[0] - 1) {
                                busy[at([bx, by, bz])] = true;
                            }
                        }
                    }
                }
            }
        }
        let extent = DVec3::from(volume.extent());
        Self { volume, faces, focus, per_edge: DVec3::from(volume.edge).recip(), extent, busy, bricks }
    }

    /// Follows the ray from far along `toward` through `point`: what it meets, and how far on the camera's side of `point`.
    pub fn hit(&self, point: DVec3, view: &View) -> Option<(f64, Hit)> {
        let direction = -view.toward;
        // The box, grown by the cell that interpolation reaches beyond it.
        let grow = DVec3::from(self.volume.edge);
        let (a, b) = ((-grow - point) / direction, (self.extent + grow - point) / direction);
        let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
        if enter >= leave {
            return None;
        }
        // Inside the quarter until it crosses one of the two planes.
        let crossing = [0, 1].map(|axis| (self.focus[axis] - point[axis]) / direction[axis]);
        let axis = usize::from(crossing[1] < crossing[0]);
        let mut start = enter;
        if crossing[axis] > enter {
            if crossing[axis] >= leave {
                return None;
            }
            start = crossing[axis];
            let place = point + direction * start;
            let id = self.faces[axis].at(place[1 - axis], place.z);
            if id != 0 {
                return Some((-start, Hit::Face { axis, id }));
            }
        }
        let surface = self.march(point, direction, start, leave)?;
        Some((-surface, Hit::Surface))
    }

    fn march(&self, point: DVec3, direction: DVec3, start: f64, leave: f64) -> Option<f64> {
        let cell = self.volume.edge.into_iter().fold(f64::INFINITY, f64::min);
        let step = STEP * cell;
        let mut t = start;
        while t < leave {
            let place = point + direction * t;
            if let Some(skip) = self.skip(place, direction) {
                t += skip.max(step);
                continue;
            }
            if self.coverage(place) >= SURFACE {
                let (mut outside, mut inside) = ((t - step).max(start), t);
                for _ in 0..6 {
                    let middle = 0.5 * (outside + inside);
                    if self.coverage(point + direction * middle) >= SURFACE {
                        inside = middle;
                    } else {
                        outside = middle;
                    }
                }
                return Some(inside);
            }
            t += step;
        }
        None
    }

    /// How far the ray may go from `place` before it can meet anything; `None` if it may at once.
    fn skip(&self, place: DVec3, direction: DVec3) -> Option<f64> {
        let brick = place * self.per_edge / SKIP as f64;
        let index: [usize; 3] =
            std::array::from_fn(|axis| (brick[axis].floor().max(0.0) as usize).min(self.bricks[axis] - 1));
        if self.busy[index[0] + self.bricks[0] * (index[1] + self.bricks[1] * index[2])] {
            return None;
        }
        let mut way = f64::INFINITY;
        for axis in 0..3 {
            let edge = index[axis] + usize::from(direction[axis] > 0.0);
            let plane = edge as f64 * SKIP as f64 * self.volume.edge[axis];
            let distance = (plane - place[axis]) / direction[axis];
            if distance >= 0.0 {
                way = way.min(distance);
            }
        }
        Some(way)
    }

    /// Coverage at a position, 0 to 255; nothing is outside of the lattice.
    pub fn coverage(&self, place: DVec3) -> f32 {
        let mut sum = 0.0;
        self.corners(place, |cell, weight| sum += weight * f32::from(self.volume.coverage(cell)));
        sum
    }

    /// The cells around a position, with their trilinear weights.
    pub fn corners(&self, place: DVec3, mut visit: impl FnMut(usize, f32)) {
        let cell = place * self.per_edge - 0.5;
        let low = cell.floor();
        let part = (cell - low).as_vec3();
        let low = low.as_i64vec3();
        let n = self.volume.n;
        for corner in 0..8_usize {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
            let mut weight = 1.0;
            let mut index = [0; 3];
            let mut within = true;
            for axis in 0..3 {
                let at = low[axis] + offset[axis] as i64;
                within &= (0..n[axis] as i64).contains(&at);
                index[axis] = at as usize;
                weight *= if offset[axis] == 1 { part[axis] } else { 1.0 - part[axis] };
            }
            if within {
                visit(self.volume.index(index), weight);
            }
        }
    }

    /// Outward unit normal of the surface near a position.
    ///
    /// The gradient over a shell of 26 directions around it: differences between neighbouring cells would show the few
    /// levels of coverage as terraces.
    pub fn normal(&self, place: DVec3) -> DVec3 {
        const REACH: f64 = 2.5;
        let reach = REACH * self.volume.edge.into_iter().fold(f64::INFINITY, f64::min);
        let mut slope = DVec3::ZERO;
        for n in (0..27).filter(|&n| n != 13) {
            let direction = DVec3::from([n % 3, n / 3 % 3, n / 9].map(|v| f64::from(v) - 1.0)).normalize();
            slope -= direction * f64::from(self.coverage(place + direction * reach));
        }
        slope.try_normalize().unwrap_or(DVec3::Z)
    }
}
