//! Where the boundary between two materials crosses the edge between two nodes.
//!
//! Hašan et al. 2010, section 7.2, makes every grid point take depth *and layer offsets* from its closest surface point. So a node
//! x has g_s(x) = depth(x) − bottom_s(x) for every slot s, and the lower face of slot s is where g_s = 0: linear between nodes.
//! With the outer surface as the bottom of slot −1 (air), g is negative for the slots not yet passed and not for the others, hence
//! every boundary between the slots of two nodes crosses their edge exactly once.
//!
//! An edge carries one vertex, whoever asks: that makes neighbours share their boundary bit for bit. If layers thinner than
//! the edge lie between the two materials, the vertex is halfway between leaving the one and entering the other, so their
//! volume goes to both alike.

use glam::DVec3;

use super::{
    nodes::{NOBODY, Nearest, Node, VOID},
    object::{NodeObject, slots_passed},
};

/// A vertex keeps this share of the pitch away from the ends of its edge, so that no triangle collapses. A boundary right on the nodes
/// is off by as much: at a pitch of half a layer that is 0.05% of its volume.
const END_MARGIN: f64 = 1e-3;

/// It keeps at least so many steps of single precision away, so that files tell it from the vertices beside it.
const END_STEPS: f64 = 4.0;

/// Finds crossings; holds buffers.
#[derive(Debug)]
pub struct Crossings<'a> {
    objects: &'a [NodeObject<'a>],
    /// Bounds of all objects, which no vertex leaves.
    bounds: (DVec3, DVec3),
    /// How near to the end of an edge a vertex may be, mm.
    margin: f64,
    rows: [Vec<f32>; 2],
}

/// A node as one object sees it.
struct Seen {
    /// Negative outside of the object, mm.
    depth: f64,
    nearest: Nearest,
    position: DVec3,
    label: u8,
    inside: bool,
}

impl<'a> Crossings<'a> {
    /// Crossings among `objects`, whose corners `bounds` holds, on edges `pitch` mm long.
    pub fn new(objects: &'a [NodeObject<'a>], bounds: (DVec3, DVec3), pitch: f64) -> Self {
        let reach = bounds.0.abs().max(bounds.1.abs()).max_element();
        let margin = f64::max(END_MARGIN * pitch, END_STEPS * f64::from(f32::EPSILON) * reach);
        Self { objects, bounds, margin, rows: Default::default() }
    }

    /// The vertex on the edge along `axis` between two nodes of different labels, of which `p` has the lower coordinate.
    pub fn vertex(&mut self, axis: usize, p: (Node, DVec3), q: (Node, DVec3)) -> DVec3 {
        let t = self.share(p, q);
        let (from, to) = (p.1[axis], q.1[axis]);
        // The surface ends with the objects; an interpolation over a hole in it might not.
        let place = (from + t * (to - from)).clamp(self.bounds.0[axis], self.bounds.1[axis]);
        let mut vertex = p.1;
        vertex[axis] = place.clamp(from + self.margin, to - self.margin);
        vertex
    }

    /// How far along the edge the boundary is, 0 at `p`, 1 at `q`.
    fn share(&mut self, p: (Node, DVec3), q: (Node, DVec3)) -> f64 {
        // Of two objects the earlier one's surface is the boundary: it owns what they share.
        let number = p.0.owner.min(q.0.owner);
        if number == NOBODY {
            return 0.5;
        }
        let object = &self.objects[usize::from(number)];
        let [p, q] = [p, q].map(|(node, position)| see(object, number, node, position));
        let [row_p, row_q] = &mut self.rows;
        let slot_p = slot(object, &p, row_p);
        let slot_q = slot(object, &q, row_q);
        let t = if slot_p <= slot_q {
            boundary(object, (&p, row_p, slot_p), (&q, row_q, slot_q))
        } else {
            1.0 - boundary(object, (&q, row_q, slot_q), (&p, row_p, slot_p))
        };
        if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.5 }
    }
}

fn see(object: &NodeObject, number: u16, node: Node, position: DVec3) -> Seen {
    let nearest = if node.measured == number { node.nearest } else { object.nearest(position) };
    let inside = node.owner == number;
    let distance = f64::from(nearest.distance);
    Seen { depth: if inside { distance } else { -distance }, nearest, position, label: node.label, inside }
}

/// Number of boundaries above a node, the outer surface included; its bottoms go to `row`.
fn slot(object: &NodeObject, seen: &Seen, row: &mut Vec<f32>) -> usize {
    object.bottoms(seen.nearest.triangle, seen.position, row);
    if seen.inside { 1 + slots_passed(row, seen.nearest.distance) } else { 0 }
}

/// The share of the way from the shallower node to the deeper one at which the label changes.
fn boundary(
    object: &NodeObject,
    (shallow, shallow_row, first): (&Seen, &[f32], usize),
    (deep, deep_row, last): (&Seen, &[f32], usize),
) -> f64 {
    let labels = object.labels();
    // Labels on the way: the ends' own, the slots' in between. Boundary b lies above slot b.
    let label = |passed: usize| match passed {
        n if n == first => shallow.label,
        n if n == last => deep.label,
        0 => VOID,
        n => labels[n - 1],
    };
    let leaving = (first..last).find(|&b| label(b + 1) != shallow.label);
    let entering = (first..last).rev().find(|&b| label(b) != deep.label);
    let at = |b: usize| {
        let bottom = |row: &[f32]| if b == 0 { 0.0 } else { f64::from(row[b - 1]) };
        let (above, below) = (shallow.depth - bottom(shallow_row), deep.depth - bottom(deep_row));
        above / (above - below)
    };
    match (leaving, entering) {
        (Some(leaving), Some(entering)) if leaving == entering => at(leaving),
        (Some(leaving), Some(entering)) => 0.5 * (at(leaving) + at(entering)),
        _ => 0.5,
    }
}
