//! What a ray meets first: the face of the cut, or the surface of the object.
//!
//! The surface is where the volume's coverage, trilinear between the cells' centres, is one half. The face is read from
//! the cuts near the lattice's own resolution, so layers stay sharp however coarse the volume is. The quarter with x >
//! focus and y < focus is taken out: the one towards the camera. A ray that comes from the camera enters what is left
//! once, so the quarter ends at one distance.

use glam::{DVec3, Vec3};

use super::{
    sampling::{corners, smoothed, trilinear},
    section::Section,
    volume::Volume,
};

/// Cells along an edge of the bricks that empty space is skipped by, fine and coarse.
const SKIPS: [usize; 2] = [4, 16];
/// Length of a step, cells: a sheet one cell thick is met.
const STEP: f64 = 0.7;
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
    /// Coverage, smoothed for normals.
    smooth: Vec<u16>,
    empty: [Bricks; 2],
}

/// Which bricks of cells hold something, or have such a cell beside them.
#[derive(Debug)]
struct Bricks {
    n: [usize; 3],
    busy: Vec<bool>,
    /// 1 / edge of a brick.
    per_edge: DVec3,
    edge: DVec3,
}

impl Bricks {
    fn new(volume: &Volume, size: usize) -> Self {
        let n = volume.n.map(|n| n.div_ceil(size));
        let mut busy = vec![false; n.iter().product()];
        // Interpolation reaches one cell further.
        let around =
            |cell: usize, axis: usize| cell.saturating_sub(1) / size..=(cell + 1).min(volume.n[axis] - 1) / size;
        for (row, ids) in volume.ids.chunks_exact(volume.n[0]).enumerate() {
            let (y, z) = (row % volume.n[1], row / volume.n[1]);
            for (x, _) in ids.iter().enumerate().filter(|(_, id)| **id != 0) {
                // A cell inside a brick adds nothing to the one before it in its row.
                if x % size != 0 && x % size != size - 1 && ids[x - 1] != 0 {
                    continue;
                }
                for (bz, by) in around(z, 2).flat_map(|bz| around(y, 1).map(move |by| (bz, by))) {
                    around(x, 0).for_each(|bx| busy[bx + n[0] * (by + n[1] * bz)] = true);
                }
            }
        }
        let edge = DVec3::from(volume.edge) * size as f64;
        Self { n, busy, per_edge: edge.recip(), edge }
    }

    /// How far a ray may go from `place` before it leaves the brick; `None` if the brick holds something.
    fn skip(&self, place: DVec3, direction: DVec3, per_direction: DVec3) -> Option<f64> {
        let [x, y, z] = (place * self.per_edge).to_array().map(|v| v.max(0.0) as usize);
        let (x, y, z) = (x.min(self.n[0] - 1), y.min(self.n[1] - 1), z.min(self.n[2] - 1));
        if self.busy[x + self.n[0] * (y + self.n[1] * z)] {
            return None;
        }
        let low = DVec3::new(x as f64, y as f64, z as f64);
        let far = DVec3::select(direction.cmpgt(DVec3::ZERO), low + 1.0, low) * self.edge;
        // Beyond the lattice's end the last brick's far side lies behind; rounding alone does not put it there.
        let way = (far - place) * per_direction;
        let behind = way.cmplt(DVec3::splat(-1e-6 * self.edge.min_element()));
        Some(DVec3::select(behind, DVec3::INFINITY, way).min_element().max(0.0))
    }
}

impl<'a> Scene<'a> {
    /// A scene; positions are mm from the lattice's lower corner.
    pub fn new(volume: &'a Volume, faces: [&'a Section; 2], focus: [f64; 2]) -> Self {
        let extent = DVec3::from(volume.extent());
        let smooth = smoothed(volume.n, |cell| volume.coverage(cell));
        Self {
            volume,
            faces,
            focus,
            smooth,
            per_edge: DVec3::from(volume.edge).recip(),
            extent,
            empty: SKIPS.map(|size| Bricks::new(volume, size)),
        }
    }

    /// Follows the ray from far along `toward` through `point`: what it meets, and how far on the camera's side of
    /// `point`.
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
        let per_direction = direction.recip();
        let mut t = start;
        while t < leave {
            let place = point + direction * t;
            let [fine, coarse] = &self.empty;
            if let Some(skip) = fine.skip(place, direction, per_direction) {
                let skip = coarse.skip(place, direction, per_direction).unwrap_or(skip);
                // A touch further, so that rounding cannot leave it in the brick.
                t += skip + 0.01 * step;
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

    /// Coverage at a position, 0 to 255; nothing is outside of the lattice.
    pub fn coverage(&self, place: DVec3) -> f32 {
        trilinear(self.volume.n, (place * self.per_edge).as_vec3(), |cell| f32::from(self.volume.coverage(cell)))
    }

    /// The cells around a position, with their trilinear weights.
    pub fn corners(&self, place: DVec3, visit: impl FnMut(usize, f32)) {
        corners(self.volume.n, (place * self.per_edge).as_vec3(), visit);
    }

    /// Outward unit normal of the surface near a position: the gradient of the smoothed coverage, whose plain gradient
    /// would show voxels as terraces.
    pub fn normal(&self, place: DVec3) -> DVec3 {
        let at = (place * self.per_edge).as_vec3();
        let smooth = |at| trilinear(self.volume.n, at, |cell| f32::from(self.smooth[cell]));
        let slope = DVec3::from(std::array::from_fn(|axis| {
            let step = Vec3::AXES[axis];
            f64::from(smooth(at - step) - smooth(at + step)) * self.per_edge[axis]
        }));
        slope.try_normalize().unwrap_or(DVec3::Z)
    }
}
