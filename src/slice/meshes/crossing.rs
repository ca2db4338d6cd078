//! Where the boundary between two materials crosses the edge between two nodes.
//!
//! Hašan et al. 2010, section 7.2, makes every grid point take depth *and layer offsets* from its closest surface
//! point. So a node x has g_s(x) = depth(x) − bottom_s(x) for every slot s, and the lower face of slot s is where g_s =
//! 0: linear between nodes. With the outer surface as the bottom of slot −1 (air), g is negative for the slots not yet
//! passed and not for the others, hence every boundary between the slots of two nodes crosses their edge exactly once.
//!
//! An edge carries one vertex, whoever asks: that makes neighbours share their boundary bit for bit. Where layers still
//! lie between the materials of its ends (next to an edge of another layer or chart), the vertex is halfway between
//! leaving the one and entering the other; but the outer surface stays where it is.
//!
//! Where the boundary is a level set of the exact distance, Newton's steps along the edge put the vertex on it, and it
//! knows its tangent plane there.

use glam::{DVec3, Vec3};

use crate::sdf::LpScratch;

use super::{
    Bounds,
    nodes::{NO_OBJECT, Node, VOID},
    object::{AboveLevel, NodeObject, Row, slots_passed},
};

/// A vertex keeps this share of the pitch away from the ends of its edge, so that no triangle collapses. A boundary
/// right on the nodes is off by as much: at a pitch of half a layer that is 0.05% of its volume.
const END_MARGIN: f64 = 1e-3;

/// It keeps at least so many steps of single precision away, so that files tell it from the vertices beside it.
const END_STEPS: f64 = 4.0;

/// Steps of Newton's method along an edge, at most; two do where one facet of the surface is nearest all along.
const STEPS: usize = 4;

/// No further from its level set than this share of the pitch, a vertex is moved onto the tangent plane and is there:
/// off by the square of 40 nm over the radius of curvature.
const ON_LEVEL: f64 = 2e-4;

/// A slope along the edge below which it does not tell where the level set crosses.
const LEAST_SLOPE: f64 = 0.02;

/// A vertex on an edge.
#[derive(Debug, Clone, Copy)]
pub struct Crossing {
    /// Where it is, mm.
    pub position: DVec3,
    /// The surface there.
    pub tangent: Tangent,
}

/// The tangent plane of a level set of the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tangent {
    /// Points to where depth is less; 0 where it is not known, or where several planes meet.
    pub normal: Vec3,
    /// Which level set.
    pub level: Level,
    /// The triangle of the object that is nearest.
    pub triangle: u32,
}

/// A level set of the distance of one object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level {
    /// The object.
    pub object: u16,
    /// Boundaries above it: 0 is the outer surface, b the bottom of slot b − 1.
    pub boundary: u16,
}

impl Tangent {
    /// Of a surface that is no level set of an exact distance.
    pub const UNKNOWN: Self = Self { normal: Vec3::ZERO, level: Level { object: NO_OBJECT, boundary: 0 }, triangle: 0 };

    /// Whether its level set is known.
    pub fn is_known(&self) -> bool {
        self.level.object != NO_OBJECT
    }
}

/// Finds crossings; holds buffers.
#[derive(Debug)]
pub struct Crossings<'a> {
    objects: &'a [NodeObject<'a>],
    /// Bounds of all objects, which no vertex leaves.
    bounds: Bounds,
    /// How near to the end of an edge a vertex may be, mm.
    margin: f64,
    pitch: f64,
    rows: [Row; 2],
    lp: LpScratch,
}

/// A node as one object sees it.
struct End<'r> {
    label: u8,
    /// Negative outside of the object, mm.
    depth: f64,
    /// The same by the exact distance, which the outer surface goes by.
    exact: f64,
    /// Boundaries above it; boundary 0 is the outer surface, boundary b the bottom of slot b − 1.
    passed: usize,
    /// Bottoms of the slots.
    row: &'r [f32],
}

impl<'a> Crossings<'a> {
    /// Crossings among `objects`, whose corners `bounds` holds, on edges `pitch` mm long.
    pub fn new(objects: &'a [NodeObject<'a>], bounds: Bounds, pitch: f64) -> Self {
        let reach = bounds.0.abs().max(bounds.1.abs()).max_element();
        let margin = f64::max(END_MARGIN * pitch, END_STEPS * f64::from(f32::EPSILON) * reach);
        Self { objects, bounds, margin, pitch, rows: Default::default(), lp: LpScratch::default() }
    }

    /// The vertex on the edge along `axis` between two nodes of different labels, of which `p` has the lower
    /// coordinate.
    pub fn vertex(&mut self, axis: usize, p: (Node, DVec3), q: (Node, DVec3)) -> Crossing {
        let (t, level) = self.share(p, q);
        let (from, to) = (p.1[axis], q.1[axis]);
        let mut position = p.1;
        position[axis] = from + t * (to - from);
        let (low, high) = (from + self.margin, to - self.margin);
        let found = level.and_then(|level| {
            let measured = |node: Node| (node.measured == level.object).then_some(node.nearest.triangle);
            let likely: [u32; 2] = [p.0, q.0].map(|node| measured(node).unwrap_or(0));
            self.on_level(level, axis, position, (low, high), &likely)
        });
        // The surface ends with the objects; an interpolation over a hole in it might not.
        let end = |place: f64| place.clamp(self.bounds.0[axis], self.bounds.1[axis]).clamp(low, high);
        let (mut position, tangent) = found.unwrap_or((position, Tangent::UNKNOWN));
        position[axis] = end(position[axis]);
        Crossing { position, tangent }
    }

    /// Moves `position` along `axis`, between `low` and `high`, onto a level set; `None` if it is not found there.
    fn on_level(
        &self,
        level: Level,
        axis: usize,
        mut position: DVec3,
        (low, high): (f64, f64),
        likely: &[u32],
    ) -> Option<(DVec3, Tangent)> {
        let object = &self.objects[usize::from(level.object)];
        let (from, to) = (low - self.margin, high + self.margin);
        let mut best: Option<(f64, DVec3, AboveLevel)> = None;
        for _ in 0..STEPS {
            let found = object.above_level(level.boundary, position, likely)?;
            if best.is_none_or(|best| found.off < best.0) {
                best = Some((found.off, position, found));
            }
            if found.off < ON_LEVEL * self.pitch || found.normal[axis].abs() < LEAST_SLOPE {
                break;
            }
            position[axis] = (position[axis] - found.above / found.normal[axis]).clamp(from, to);
        }
        let (off, mut position, AboveLevel { above, normal, triangle, .. }) = best?;
        if off > ON_LEVEL * self.pitch {
            return None;
        }
        if normal[axis].abs() >= LEAST_SLOPE {
            position[axis] -= above / normal[axis];
        }
        Some((position, Tangent { normal: normal.as_vec3(), level, triangle }))
    }

    /// How far along the edge the boundary is, 0 at `p`, 1 at `q`, and the level set that it is.
    fn share(&mut self, p: (Node, DVec3), q: (Node, DVec3)) -> (f64, Option<Level>) {
        // Of two objects the earlier one's surface is the boundary: it owns what they share.
        let number = p.0.owner.min(q.0.owner);
        if number == NO_OBJECT {
            return (0.5, None);
        }
        let object = &self.objects[usize::from(number)];
        // Between two objects of one body is no surface: somewhere the one's layers give way to the other's.
        if p.0.owner != q.0.owner && object.is_body_of([p.0.owner, q.0.owner]) {
            return (0.5, None);
        }
        let [row_p, row_q] = &mut self.rows;
        let mut ends =
            (End::see(object, number, p, row_p, &mut self.lp), End::see(object, number, q, row_q, &mut self.lp));
        if (ends.0.passed == 0) != (ends.1.passed == 0) {
            ends.0.go_exact(object, p.1);
            ends.1.go_exact(object, q.1);
        }
        let (p, q) = ends;
        let (t, boundary) = if p.passed <= q.passed {
            boundary(object.labels(), self.pitch, &p, &q)
        } else {
            let (t, boundary) = boundary(object.labels(), self.pitch, &q, &p);
            (1.0 - t, boundary)
        };
        // The outer surface is one of the body, whose first object stands for it.
        let first = object.members().map_or(number, |members| members[0] as u16);
        let level = boundary
            .map(|boundary| Level { object: if boundary == 0 { first } else { number }, boundary: boundary as u16 });
        if t.is_finite() { (t.clamp(0.0, 1.0), level) } else { (0.5, None) }
    }
}

impl<'r> End<'r> {
    fn see(
        object: &NodeObject,
        number: u16,
        (node, position): (Node, DVec3),
        row: &'r mut Row,
        lp: &mut LpScratch,
    ) -> Self {
        let nearest = if node.measured == number { node.nearest } else { object.nearest(position, lp) };
        let row = object.bottoms(nearest.triangle, position, row);
        let distance = f64::from(nearest.distance);
        let (depth, passed) =
            if node.owner == number { (distance, 1 + slots_passed(row, nearest.distance)) } else { (-distance, 0) };
        Self { label: node.label, depth, exact: depth, passed, row }
    }

    /// Measures the exact distance where depth goes by another one.
    fn go_exact(&mut self, object: &NodeObject, position: DVec3) {
        if let Some(exact) = object.exact(position) {
            self.exact = exact.copysign(self.depth);
        }
    }

    /// Depth of a boundary here, mm.
    fn boundary(&self, number: usize) -> f64 {
        if number == 0 { 0.0 } else { f64::from(self.row[number - 1]) }
    }
}

/// The share of the way from the shallower node to the deeper one at which the label changes, and the boundary at which
/// it does if that is one.
fn boundary(labels: &[u8], pitch: f64, shallow: &End, deep: &End) -> (f64, Option<usize>) {
    let label = |passed: usize| match passed {
        n if n == shallow.passed => shallow.label,
        n if n == deep.passed => deep.label,
        0 => VOID,
        n => labels[n - 1],
    };
    let boundaries = shallow.passed..deep.passed;
    let leaving = boundaries.clone().find(|&b| label(b + 1) != shallow.label);
    let entering = boundaries.rev().find(|&b| label(b) != deep.label);
    let (Some(leaving), Some(entering)) = (leaving, entering) else { return (0.5, None) };
    let at = |b: usize| {
        let (above, below) = match b {
            0 => (shallow.exact, deep.exact),
            b => (shallow.depth - shallow.boundary(b), deep.depth - deep.boundary(b)),
        };
        above / (above - below)
    };
    if (deep.depth - shallow.depth).abs() < 0.5 * pitch {
        match (rim(labels, pitch, shallow, deep), rim(labels, pitch, deep, shallow)) {
            (Some(_), Some(_)) => return (0.5, None),
            (Some(share), None) => return (share, None),
            (None, Some(share)) => return (1.0 - share, None),
            (None, None) => {}
        }
    }
    // What begins right at the surface begins there, whatever is lost below.
    if leaving == 0 {
        (at(0), Some(0))
    } else {
        (0.5 * (at(leaving) + at(entering)), (leaving == entering).then_some(leaving))
    }
}

/// How far the layer around `here` reaches towards `there`, along the surface, if it has ended there.
///
/// Somewhere between the two, so half an edge on average; but marching cubes bevels the rim of a layer of thickness h
/// to a cross-section of t · p · (h − p/2) where t · p · h is due.
fn rim(labels: &[u8], pitch: f64, here: &End, there: &End) -> Option<f64> {
    if here.passed == 0 || there.passed == 0 {
        return None;
    }
    let same = |slot: usize| labels[slot] == here.label;
    let (mut first, mut last) = (here.passed - 1, here.passed - 1);
    while first > 0 && same(first - 1) {
        first -= 1;
    }
    while last + 1 < labels.len() && same(last + 1) {
        last += 1;
    }
    if last + 1 == labels.len() || !same(here.passed - 1) {
        return None; // the core does not end
    }
    let thickness = |end: &End| end.boundary(last + 1) - end.boundary(first);
    if thickness(there) > 0.0 {
        return None;
    }
    let h = thickness(here).max(pitch);
    Some(0.5 * h / (h - 0.5 * pitch))
}
