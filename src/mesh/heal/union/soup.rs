//! Closed surfaces that space is judged by: which of their triangles are near, and how often they wind around a point.

use glam::{DVec3, Vec3A};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

/// Directions of rays, tried in this order until one meets no edge. No face of a drawn thing looks along them, and none
/// has an edge that lies in their planes.
const DIRECTIONS: [DVec3; 6] = [
    DVec3::new(0.538_461, 0.287_317, 0.792_113),
    DVec3::new(-0.413_217, 0.691_931, 0.592_337),
    DVec3::new(0.271_873, -0.838_779, 0.471_731),
    DVec3::new(-0.617_341, -0.366_167, 0.696_313),
    DVec3::new(0.811_259, 0.433_817, -0.391_789),
    DVec3::new(0.197_371, 0.579_433, -0.790_753),
];

/// Triangles of one or several closed, oriented surfaces.
pub(in crate::mesh) struct Soup {
    pub(in crate::mesh) corners: Vec<[DVec3; 3]>,
    /// The body of every triangle.
    pub(super) body_of: Vec<u16>,
    pub(super) bodies: usize,
    pub(super) boxes: Boxes,
}

/// Boxes, and a hierarchy over them.
pub(in crate::mesh) struct Boxes {
    all: Vec<Aabb>,
    bvh: Bvh2,
}

impl Boxes {
    pub(in crate::mesh) fn new(all: Vec<Aabb>) -> Self {
        let bvh = build_bvh2(&all, BvhBuildParams::very_fast_build(), &mut Default::default());
        Self { all, bvh }
    }

    /// The box of this index.
    pub(in crate::mesh) fn get(&self, index: usize) -> Aabb {
        self.all[index]
    }

    /// Calls `visit` for the boxes that meet `around`, by index.
    pub(in crate::mesh) fn near(&self, around: Aabb, mut visit: impl FnMut(usize)) {
        if self.all.is_empty() {
            return;
        }
        self.bvh.aabb_traverse(around, |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let leaf = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for &other in &bvh.primitive_indices[leaf] {
                if around.intersect_aabb(&self.all[other as usize]) {
                    visit(other as usize);
                }
            }
            true
        });
    }
}

impl Soup {
    /// A hierarchy over triangles with their bodies.
    pub(in crate::mesh) fn new(corners: Vec<[DVec3; 3]>, body_of: Vec<u16>) -> Self {
        let boxes = Boxes::new(corners.iter().map(|t| outer_box(t, 0.0)).collect());
        let bodies = body_of.iter().max().map_or(0, |&last| usize::from(last) + 1);
        Self { corners, body_of, bodies, boxes }
    }

    /// Winding number of every body around a point, by the signed crossings of a ray. Exact where the ray meets no
    /// edge: the sides of an edge that its two triangles see are each other's negative, bit for bit.
    pub(super) fn windings(&self, p: DVec3, windings: &mut Vec<i32>) {
        for direction in DIRECTIONS {
            windings.clear();
            windings.resize(self.bodies, 0);
            if self.count(p, direction, |index, turn| windings[usize::from(self.body_of[index])] += turn) {
                return;
            }
        }
    }

    /// Winding number around a point of all together, each triangle by its weight.
    pub(in crate::mesh) fn winding(&self, p: DVec3, weight: impl Fn(usize) -> i32) -> i32 {
        let mut winding = 0;
        for direction in DIRECTIONS {
            winding = 0;
            if self.count(p, direction, |index, turn| winding += turn * weight(index)) {
                break;
            }
        }
        winding
    }

    /// Whether a ray meets nothing.
    pub(in crate::mesh) fn is_free(&self, p: DVec3, direction: DVec3) -> bool {
        let mut is_free = true;
        self.count(p, direction, |_, _| is_free = false) && is_free
    }

    /// Tells the crossings of a ray, by triangle; whether none was with an edge.
    fn count(&self, p: DVec3, direction: DVec3, mut crosses: impl FnMut(usize, i32)) -> bool {
        if self.corners.is_empty() {
            return true;
        }
        let inverse = direction.recip();
        let meets = |aabb: &Aabb| {
            let (a, b) = ((aabb.min.as_dvec3() - p) * inverse, (aabb.max.as_dvec3() - p) * inverse);
            a.max(b).min_element() >= a.min(b).max_element().max(0.0)
        };
        let mut stack = vec![0_usize];
        while let Some(node) = stack.pop() {
            let node = &self.boxes.bvh.nodes[node];
            if !meets(node.aabb()) {
                continue;
            }
            let first = node.first_index as usize;
            if !node.is_leaf() {
                stack.extend([first, first + 1]);
                continue;
            }
            for &index in &self.boxes.bvh.primitive_indices[first..first + node.prim_count as usize] {
                match crossing(&self.corners[index as usize], p, direction) {
                    Some(0) => {}
                    Some(turn) => crosses(index as usize, turn),
                    None => return false,
                }
            }
        }
        true
    }
}

/// +1 where a ray leaves through a triangle, −1 where it enters, 0 where it passes; `None` where it meets an edge.
fn crossing(corners: &[DVec3; 3], p: DVec3, direction: DVec3) -> Option<i32> {
    let [a, b, c] = corners.map(|corner| corner - p);
    let sides = [direction.dot(b.cross(c)), direction.dot(c.cross(a)), direction.dot(a.cross(b))];
    let turn = if sides.iter().all(|side| *side >= 0.0) {
        1
    } else if sides.iter().all(|side| *side <= 0.0) {
        -1
    } else {
        return Some(0);
    };
    // The ray's line passes through it; ahead, if it is on the side that the normal says.
    let ahead = a.dot((b - a).cross(c - a)) * f64::from(turn);
    if ahead <= 0.0 {
        return Some(0);
    }
    if sides.contains(&0.0) { None } else { Some(turn) }
}

/// A box in single precision that surely holds all within `margin` of the triangle.
pub(in crate::mesh) fn outer_box(corners: &[DVec3; 3], margin: f64) -> Aabb {
    let low = corners[0].min(corners[1]).min(corners[2]) - margin;
    let high = corners[0].max(corners[1]).max(corners[2]) + margin;
    let down = low.to_array().map(|c| (c as f32).next_down());
    let up = high.to_array().map(|c| (c as f32).next_up());
    Aabb::new(Vec3A::from_array(down), Vec3A::from_array(up))
}
