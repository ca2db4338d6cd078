//! One cell of the lattice: the polygons between the materials of its eight corners.
//!
//! Marching cubes (Lorensen and Cline 1987) for any number of materials, without a table: every face of the cell is cut
//! into segments that depend on the face alone, so that the two cells beside it agree (no cracks), and the segments are
//! joined to loops and filled.
//!
//! ```text
//!   A───•───B      A───•───B      A───•───B      A───•───B
//!   │   │   │      │  ╱    │      │   │   │      │   │   │
//!   │   │   │      •       •      │   F───•      •───F───•
//!   │   │   │      │     ╱ │      │   │   │      │   │   │
//!   A───•───B      B───•───A      A───•───C      C───•───D
//!   Segment        Corners        Star           Star
//! ```
//!
//! * A face with two materials on its diagonals can be cut two ways. The one with the shorter segments is taken, which
//!   depends on the vertices alone and not on which material asks: both sides of a boundary are cut alike, and close.
//! * A face where three or four materials meet gets a vertex F of its own, the cell around it one in its middle, to
//!   which every segment is joined. Then the materials fill the cell without gap or overlap.
//! * In cells of two materials a loop is filled by a fan. If it runs twice over one face, a diagonal of the fan could
//!   lie in that face, where the neighbour may have the same one; it is filled around its centre instead.
//! * A loop that an edge or a corner of the surface passes is filled around a vertex on it ([`CellOutput::peak`]), as
//!   in Kobbelt, Botsch, Schwanecke and Seidel 2001.
//!
//! So every directed edge of every material's mesh has its reverse exactly once. Not guaranteed: that two sheets of one
//! cell do not pierce each other (the "interior test" of Chernyaev 1995 is not made), and a vertex may be shared by two
//! fans.

use glam::Vec3;

/// How a face is cut; corners and edges are counted in turn, edge i from corner i to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FacePattern {
    /// Not at all.
    Whole,
    /// Once, from one edge to another.
    Segment(usize, usize),
    /// Corners 0 and 2 are cut off.
    EvenCorners,
    /// Corners 1 and 3 are cut off.
    OddCorners,
    /// Corners 0 and 2, or corners 1 and 3.
    Ambiguous,
    /// From every crossed edge to a vertex in the middle.
    Star,
}

/// How the face with these labels in turn is cut.
pub fn face_pattern(labels: [u8; 4]) -> FacePattern {
    let crossed = |side: usize| labels[side] != labels[(side + 1) % 4];
    let mut sides = (0..4).filter(|&side| crossed(side));
    match (sides.next(), sides.next(), sides.next(), sides.next()) {
        (None, ..) => FacePattern::Whole,
        (Some(a), Some(b), None, _) => FacePattern::Segment(a, b),
        (_, _, _, None) => FacePattern::Star,
        _ => match (labels[0] == labels[2], labels[1] == labels[3]) {
            (true, true) => FacePattern::Ambiguous,
            (true, false) => FacePattern::OddCorners,
            (false, true) => FacePattern::EvenCorners,
            (false, false) => FacePattern::Star,
        },
    }
}

/// Points of a cell: its 12 edges (4·axis + offsets along the next two axes), then its 6 faces (2·axis + side).
pub const POINTS: usize = 18;

/// Corner at which an edge starts.
pub const EDGE_START: [usize; 12] = {
    let mut starts = [0; 12];
    let mut edge = 0;
    while edge < 12 {
        let (axis, offsets) = (edge / 4, edge % 4);
        starts[edge] = (offsets & 1) << ((axis + 1) % 3) | (offsets >> 1) << ((axis + 2) % 3);
        edge += 1;
    }
    starts
};

/// Corners of every face in turn, counter-clockwise seen from outside the cell.
const FACE_CORNERS: [[usize; 4]; 6] = {
    let mut faces = [[0; 4]; 6];
    let mut face = 0;
    while face < 6 {
        let (axis, side) = (face / 2, face % 2);
        let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let base = side << axis;
        faces[face] = if side == 1 { [base, base | b, base | b | c, base | c] } else { [0, c, b | c, b] };
        face += 1;
    }
    faces
};

/// The edge between every corner of a face and the next.
const FACE_EDGES: [[usize; 4]; 6] = {
    let mut edges = [[0; 4]; 6];
    let mut n = 0;
    while n < 24 {
        let (face, side) = (n / 4, n % 4);
        let (p, q) = (FACE_CORNERS[face][side], FACE_CORNERS[face][(side + 1) % 4]);
        let (start, axis) = (p & q, (p ^ q).trailing_zeros() as usize);
        edges[face][side] = 4 * axis + (start >> ((axis + 1) % 3) & 1) + 2 * (start >> ((axis + 2) % 3) & 1);
        n += 1;
    }
    edges
};

/// A piece of a boundary on a face, seen from outside the cell.
#[derive(Debug, Clone, Copy, Default)]
struct Segment {
    from: u8,
    to: u8,
    /// Material on its left.
    left: u8,
    /// Material on its right.
    right: u8,
    face: u8,
}

/// Where the polygons of a cell go.
pub trait CellOutput {
    /// Adds a vertex and returns its number.
    fn vertex(&mut self, position: Vec3) -> u32;
    /// A triangle whose normal (by the right hand) points from material `behind` to material `front`.
    fn triangle(&mut self, behind: u8, front: u8, corners: [u32; 3]);
    /// The vertex that a loop of these points is to be filled around, where an edge or a corner of the surface lies
    /// within it.
    fn peak(&mut self, _points: &[u8]) -> Option<u32> {
        None
    }
}

/// The segments of one cell.
#[derive(Debug, Default)]
struct Segments {
    list: [Segment; 24],
    len: usize,
}

impl Segments {
    fn push(&mut self, from: usize, to: usize, left: u8, right: u8, face: usize) {
        self.list[self.len] = Segment { from: from as u8, to: to as u8, left, right, face: face as u8 };
        self.len += 1;
    }

    /// Cuts the faces of a cell with these corner labels.
    fn cut(labels: &[u8; 8], position: &impl Fn(usize) -> Vec3) -> Self {
        let mut segments = Self::default();
        for (face, (corners, edges)) in FACE_CORNERS.iter().zip(&FACE_EDGES).enumerate() {
            let around = corners.map(|corner| labels[corner]);
            // The corners after edge `a` up to edge `b` are on the right of the way from a to b.
            let mut between =
                |a: usize, b: usize| segments.push(edges[a], edges[b], around[a], around[(a + 1) % 4], face);
            let even = match face_pattern(around) {
                FacePattern::Whole => continue,
                FacePattern::Segment(a, b) => {
                    between(a, b);
                    continue;
                }
                FacePattern::Star => {
                    for side in (0..4).filter(|&side| around[side] != around[(side + 1) % 4]) {
                        segments.push(edges[side], 12 + face, around[side], around[(side + 1) % 4], face);
                    }
                    continue;
                }
                FacePattern::EvenCorners => true,
                FacePattern::OddCorners => false,
                FacePattern::Ambiguous => even_is_shorter(edges.map(position), around),
            };
            for corner in if even { [0, 2] } else { [1, 3] } {
                between((corner + 3) % 4, corner);
            }
        }
        segments
    }

    fn iter(&self) -> std::slice::Iter<'_, Segment> {
        self.list[..self.len].iter()
    }
}

/// Whether cutting off corners 0 and 2 takes shorter segments than cutting off corners 1 and 3. The neighbour counts
/// the corners in another order, so nothing here may depend on it; a tie cuts off the greater label.
fn even_is_shorter(edges: [Vec3; 4], labels: [u8; 4]) -> bool {
    let length = |a: usize, b: usize| edges[a].distance(edges[b]);
    let even = length(3, 0) + length(1, 2);
    let odd = length(0, 1) + length(2, 3);
    even < odd || (even == odd && labels[0] > labels[1])
}

/// Fills a cell whose corners have different `labels`; `vertex` and `position` give the number and place of its points.
pub fn fill_cell(
    labels: &[u8; 8],
    vertex: impl Fn(usize) -> u32,
    position: impl Fn(usize) -> Vec3,
    out: &mut impl CellOutput,
) {
    let segments = Segments::cut(labels, &position);
    let greatest = labels.iter().copied().fold(0, u8::max);
    let least = labels.iter().copied().fold(u8::MAX, u8::min);
    if labels.iter().all(|&label| label == greatest || label == least) {
        fill_loops(&segments, greatest, least, vertex, position, out);
    } else {
        let ends = segments.iter().flat_map(|segment| [segment.from, segment.to]);
        let sum: Vec3 = ends.map(|point| position(point.into())).sum();
        let centre = out.vertex(sum / (2 * segments.len) as f32);
        for &Segment { from, to, left, right, .. } in segments.iter() {
            out.triangle(right, left, [vertex(from.into()), vertex(to.into()), centre]);
        }
    }
}

/// A closed loop around `behind`.
#[derive(Debug, Default)]
struct Loop {
    points: [u8; 12],
    len: usize,
    /// Whether it runs over one face twice.
    folded: bool,
}

impl Loop {
    fn points(&self) -> &[u8] {
        &self.points[..self.len]
    }
}

/// Joins the segments between two materials to loops and fills them.
fn fill_loops(
    segments: &Segments,
    behind: u8,
    front: u8,
    vertex: impl Fn(usize) -> u32,
    position: impl Fn(usize) -> Vec3,
    out: &mut impl CellOutput,
) {
    const END: (u8, u8) = (u8::MAX, 0);
    let mut next = [END; POINTS];
    for &Segment { from, to, right, face, .. } in segments.iter() {
        let (from, to) = if right == behind { (from, to) } else { (to, from) };
        next[usize::from(from)] = (to, face);
    }
    for start in 0..POINTS {
        let (mut contour, mut faces) = (Loop::default(), 0_u8);
        let mut point = start;
        while next[point] != END {
            let (to, face) = std::mem::replace(&mut next[point], END);
            contour.points[contour.len] = point as u8;
            contour.len += 1;
            contour.folded |= faces >> face & 1 != 0;
            faces |= 1 << face;
            point = to.into();
        }
        if contour.len > 0 {
            fill_loop(&contour, behind, front, &vertex, &position, out);
        }
    }
}

fn fill_loop(
    contour: &Loop,
    behind: u8,
    front: u8,
    vertex: &impl Fn(usize) -> u32,
    position: &impl Fn(usize) -> Vec3,
    out: &mut impl CellOutput,
) {
    let points = contour.points();
    let len = points.len();
    let at = |n: usize| usize::from(points[n % len]);
    if contour.folded {
        let sum: Vec3 = points.iter().map(|&point| position(point.into())).sum();
        let centre = out.vertex(sum / len as f32);
        for n in 0..len {
            out.triangle(behind, front, [vertex(at(n)), vertex(at(n + 1)), centre]);
        }
        return;
    }
    if let Some(peak) = out.peak(points) {
        for n in 0..len {
            out.triangle(behind, front, [vertex(at(n)), vertex(at(n + 1)), peak]);
        }
        return;
    }
    // The fan with the shortest diagonals; of equals the first.
    let diagonals =
        |apex: usize| (2..len - 1).map(|n| position(at(apex)).distance_squared(position(at(apex + n)))).sum::<f32>();
    let mut best = (f32::INFINITY, 0);
    if len > 3 {
        for apex in 0..len {
            let sum = diagonals(apex);
            if sum < best.0 {
                best = (sum, apex);
            }
        }
    }
    let apex = best.1;
    for n in 1..len - 1 {
        out.triangle(behind, front, [at(apex), at(apex + n), at(apex + n + 1)].map(vertex));
    }
}
