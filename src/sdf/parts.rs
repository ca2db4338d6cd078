//! The convex cull once more, for the parts of a brick: which of its candidates can be nearest there.
//!
//! What [`super::cull`](mod@super::cull) does for boxes in double precision, here in single precision for eight parts
//! at once, by the kernel's own distances. A candidate is dropped where a rival is nearer by more than all rounding
//! together, so that the kernel would not have chosen it: what it finds is the same bits as without this, with less
//! than half the comparisons.

use multiversion::multiversion;

use super::{
    cull::DepthRange,
    kernel::{BrickOffsets, Prepared, greater},
};
use crate::voxel::BRICK;

/// Parts of a brick along y and z; along x there is one, so that its voxels are whole vectors.
const ACROSS: [usize; 2] = [4, 2];
const PARTS: usize = ACROSS[0] * ACROSS[1];
/// Rows of a part.
const PART_ROWS: usize = BRICK / ACROSS[0];
/// Voxels of a part in one slice, consecutive in the brick.
pub const PART_COLUMNS: usize = BRICK * PART_ROWS;
/// Slices of a part.
pub const PART_SLICES: usize = BRICK / ACROSS[1];

/// A distance below this share of a part's radius has no direction to rely on. Above it, rounding of the nearest point
/// turns the tangent plane by less than 2 / [`FLAT`] times the kernel's error at the part's corners.
const FLAT: f32 = 0.125;

/// What rounding can do to the comparison of a rival with a tangent plane, in units of the kernel's error: 2 / [`FLAT`]
/// by the plane's direction, and one for each of the distance at the centre, the rival's at the corner, and both that
/// the kernel compares.
const SLACK: f32 = 2.0 / FLAT + 4.0;

/// An eighth of a brick: 8 × 2 × 4 voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part(usize);

impl Part {
    /// Number of parts of a brick.
    pub const COUNT: usize = PARTS;

    /// All parts of a brick.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..PARTS).map(Self)
    }

    /// Its number.
    pub fn index(self) -> usize {
        self.0
    }

    /// Its first voxel in the brick.
    pub(super) fn first(self) -> usize {
        let [y, z] = [self.0 % ACROSS[0], self.0 / ACROSS[0]];
        BRICK * (y * PART_ROWS + BRICK * z * PART_SLICES)
    }

    /// Its voxels in the brick, those of one slice after the other.
    pub fn rows(self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let first = self.first();
        (0..PART_SLICES).map(move |slice| first + slice * BRICK * BRICK).map(|start| start..start + PART_COLUMNS)
    }

    /// Of a bit per voxel of the brick the bytes that are the part's.
    pub fn bytes(self) -> impl Iterator<Item = usize> {
        let first = self.first() / BRICK;
        (0..PART_SLICES).flat_map(move |slice| (0..PART_ROWS).map(move |row| first + row + BRICK * slice))
    }
}

/// Candidates of one brick, ready for the kernel and for the parts' culls. Buffers are kept.
#[derive(Debug, Clone, Default)]
pub(super) struct Parts {
    pub(super) prepared: Vec<Prepared>,
    /// Positions of what the last cull left, ascending.
    pub(super) kept: Vec<u32>,
    planes: Vec<Planes>,
    /// Of every part the candidate nearest to the centre.
    rivals: [u32; PARTS],
    frame: Frame,
}

/// Where the parts are, relative to the brick's centre, mm.
#[derive(Debug, Clone, Copy, Default)]
struct Frame {
    centre: [[f32; PARTS]; 3],
    half: [f32; 3],
}

/// Candidates whose planes are side by side.
const LANES: usize = 16;

/// Tangent planes of the distances to some candidates, at the centre of every part.
#[derive(Debug, Clone, Copy)]
struct Planes {
    value: [[f32; LANES]; PARTS],
    /// What each rises by from the centre to the faces, per axis.
    rise: [[[f32; LANES]; 3]; PARTS],
}

impl Planes {
    /// Further away than anything.
    const NONE: Self = Self { value: [[f32::INFINITY; LANES]; PARTS], rise: [[[0.0; LANES]; 3]; PARTS] };
}

/// Signs of x, y and z of a part's corners.
const CORNERS: [[f32; 8]; 3] = [
    [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0],
    [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
];

impl Parts {
    /// Prepares the culls of all parts for what is in `prepared`; `error` is the kernel's.
    pub(super) fn lay_planes(&mut self, offsets: &BrickOffsets, error: f32) {
        let ends = Part::all().map(|part| {
            let last = part.first() + (PART_SLICES - 1) * BRICK * BRICK + PART_COLUMNS - 1;
            [offsets.of(part.first()), offsets.of(last)]
        });
        for (part, [low, high]) in ends.enumerate() {
            let centre = (low + high) * 0.5;
            for axis in 0..3 {
                self.frame.centre[axis][part] = centre[axis];
                self.frame.half[axis] = (high[axis] - low[axis]) * 0.5;
            }
        }
        self.planes.clear();
        self.planes.resize(self.prepared.len().div_ceil(LANES), Planes::NONE);
        self.rivals = lay(&self.prepared, &self.frame, error, &mut self.planes);
    }

    /// Replaces `kept` by the candidates that can be nearest somewhere in `part`, and bounds the distance over it.
    pub(super) fn cull(&mut self, part: Part, error: f32) -> DepthRange {
        let slack = SLACK * error;
        self.kept.resize(self.planes.len() * LANES, 0);
        let rival = &self.prepared[self.rivals[part.0] as usize];
        let (count, [min, max]) = cull(rival, &self.planes, &self.frame, part.0, slack, &mut self.kept);
        self.kept.truncate(count);
        DepthRange { min: f64::from(min - slack).max(0.0), max: f64::from(max + slack) }
    }
}

/// Writes the tangent planes at all parts' centres; the candidate nearest to each.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn lay(prepared: &[Prepared], frame: &Frame, error: f32, out: &mut [Planes]) -> [u32; PARTS] {
    let [hx, hy, hz] = frame.half;
    let radius = (hx * hx + hy * hy + hz * hz).sqrt();
    let least = greater(FLAT * radius, error);
    let (mut nearest, mut rivals) = ([f32::INFINITY; PARTS], [0; PARTS]);
    for (index, triangle) in prepared.iter().enumerate() {
        let (mut value, mut rise) = ([0.0; PARTS], [[0.0; PARTS]; 3]);
        for part in 0..PARTS {
            let at = [frame.centre[0][part], frame.centre[1][part], frame.centre[2][part]];
            let ([rx, ry, rz], squared) = triangle.seen_from_foot(at);
            let distance = squared.sqrt();
            let steep = distance > least;
            let scale = if steep { 1.0 / distance } else { 0.0 };
            // Another point of the triangle that is as near within twice the error may pass for the nearest. The true
            // one lies at a right angle to it or more, so the direction is off by at most √(2 · 2 error / distance).
            let turned = distance - radius * (4.0 * error / distance).sqrt();
            // Distances change by no more than the way.
            value[part] = if steep { turned } else { distance - radius };
            rise[0][part] = rx * scale * hx;
            rise[1][part] = ry * scale * hy;
            rise[2][part] = rz * scale * hz;
            let nearer = distance < nearest[part];
            nearest[part] = if nearer { distance } else { nearest[part] };
            rivals[part] = if nearer { index as u32 } else { rivals[part] };
        }
        let (planes, lane) = (&mut out[index / LANES], index % LANES);
        for part in 0..PARTS {
            planes.value[part][lane] = value[part];
            for (to, from) in planes.rise[part].iter_mut().zip(&rise) {
                to[lane] = from[part];
            }
        }
    }
    rivals
}

/// Writes the candidates that `rival` does not beat everywhere in a part by more than `slack` to `kept`. Returns how
/// many, and least and greatest distance.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn cull(
    rival: &Prepared,
    planes: &[Planes],
    frame: &Frame,
    part: usize,
    slack: f32,
    kept: &mut [u32],
) -> (usize, [f32; 2]) {
    let mut ceiling = [0.0; 8];
    for (corner, ceiling) in ceiling.iter_mut().enumerate() {
        let at = |axis: usize| frame.centre[axis][part] + CORNERS[axis][corner] * frame.half[axis];
        *ceiling = rival.seen_from_foot([at(0), at(1), at(2)]).1.sqrt();
    }
    let highest = ceiling.iter().fold(0.0, |a, b| greater(a, *b));
    let (mut count, mut lowest) = (0, [f32::INFINITY; LANES]);
    for (block, planes) in planes.iter().enumerate() {
        let (value, [rx, ry, rz]) = (&planes.value[part], &planes.rise[part]);
        // How far the rival is behind the plane where it is furthest.
        let mut behind = [f32::NEG_INFINITY; LANES];
        for corner in 0..8 {
            let [x, y, z] = [CORNERS[0][corner], CORNERS[1][corner], CORNERS[2][corner]];
            for lane in 0..LANES {
                let plane = value[lane] + x * rx[lane] + y * ry[lane] + z * rz[lane];
                behind[lane] = greater(ceiling[corner] - plane, behind[lane]);
            }
        }
        for lane in 0..LANES {
            let low = value[lane] - (rx[lane].abs() + ry[lane].abs() + rz[lane].abs());
            let stays = behind[lane] >= -slack;
            lowest[lane] = if stays && low < lowest[lane] { low } else { lowest[lane] };
        }
        for (lane, behind) in behind.iter().enumerate() {
            kept[count] = (block * LANES + lane) as u32;
            count += usize::from(*behind >= -slack);
        }
    }
    (count, [lowest.iter().fold(f32::INFINITY, |a, b| a.min(*b)), highest])
}
