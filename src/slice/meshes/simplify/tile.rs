//! Collapses in one cube of space.

mod checks;
mod topology;

use glam::DVec3;

use super::{Home, Whole, fine::Fine, groups::Groups, quadric::Quadric, queue::Queue};
use crate::slice::meshes::interfaces::Facet;

/// The share of the error that is used up where it is measured: what lies between the places may be off by more.
const USED: f64 = 0.9;
/// An edge whose quadric says it would be off by more than this many errors, root mean square, is not tried.
const HOPELESS: f64 = 2.0;
/// What length adds to a collapse's cost, as (mm off by) / (mm long) squared: of flat ones the shortest comes first, so
/// that triangles grow evenly.
const SHORT_FIRST: f64 = 1e-10;
/// A new triangle's least height in steps of single precision at the greatest coordinate.
const LEAST_STEPS: f64 = 16.0;
/// No corner, sample, triangle.
const NONE: u32 = u32::MAX;

/// What a cube's collapses came to.
#[derive(Debug, Default)]
pub struct Changes {
    /// The triangles that are left.
    pub facets: Vec<Facet>,
    /// Vertices that are elsewhere.
    pub moved: Vec<(u32, [f32; 3])>,
    /// What became of fine vertices; facets are counted in `facets`.
    pub homes: Vec<(u32, Home)>,
    /// See [`Whole::curve_errors`].
    pub curve_errors: Vec<(u32, f32)>,
}

/// Where a vertex may go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    /// Anywhere: it is inside of one boundary.
    Free,
    /// Along its curve.
    Curve,
    /// Nowhere.
    Fixed,
}

#[derive(Debug)]
struct Vertex {
    /// Its number in the whole.
    id: u32,
    position: DVec3,
    class: Class,
    /// Whether it is the fine vertex of its number still.
    itself: bool,
    /// Counts its changes.
    version: u32,
    quadric: Quadric,
    curve_error: f64,
    /// First of its corners, linked by `Tile::next`; corner k of triangle t is 3 t + k.
    corner: u32,
}

/// A fine vertex that is none any more.
#[derive(Debug)]
struct Sample {
    id: u32,
    /// The next one near the same triangle.
    next: u32,
}

/// The triangles of one cube.
pub struct Tile<'a> {
    fine: &'a Fine<'a>,
    /// Quadrics are about this.
    origin: DVec3,
    /// Square of the error as it is measured.
    limit: f64,
    error: f64,
    pitch: f64,
    /// Least height of a triangle, mm.
    least: f64,
    vertices: Vec<Vertex>,
    triangles: Vec<Triangle>,
    /// Per corner, the next one of its vertex.
    next: Vec<u32>,
    samples: Vec<Sample>,
    queue: Queue<Candidate>,
    marks: Vec<u32>,
    mark: u32,
    /// Per fine vertex, which of the triangles of a collapse it is nearest to; [`NONE`] between collapses.
    near: &'a mut [u32],
    scratch: Scratch,
}

#[derive(Debug, Clone, Copy)]
struct Triangle {
    /// Vertices; all [`NONE`] once it is gone.
    corners: [u32; 3],
    sides: [u8; 2],
    /// First of the samples near it.
    sample: u32,
}

/// An edge in the queue: its ends, and their versions.
type Candidate = ([u32; 2], [u32; 2]);

/// A triangle as it would be.
#[derive(Debug, Clone, Copy)]
struct New {
    triangle: u32,
    corners: [DVec3; 3],
    /// Of unit length.
    normal: DVec3,
    sides: [u8; 2],
    /// The vertices after and before the joined one.
    ends: [u32; 2],
}

/// Buffers of one collapse.
#[derive(Debug, Default)]
struct Scratch {
    around: [Vec<u32>; 2],
    new: Vec<New>,
    /// Samples, or fine vertices that become samples, and the sides of their triangle.
    samples: Vec<(u32, [u8; 2])>,
    /// Which of `new` each is nearest to.
    nearest: Vec<u32>,
    /// Fine vertices nearby and where they are.
    anchors: Vec<(u32, DVec3)>,
}

impl<'a> Tile<'a> {
    /// The triangles `facets` of `whole`; `free` says of a vertex whether all of its triangles are among them. `local`
    /// is one entry per vertex, all [`NONE`] before and after.
    pub fn new(
        whole: &'a Whole<'a>,
        facets: &[u32],
        held: &Groups,
        free: impl Fn(u32) -> bool,
        [error, pitch]: [f64; 2],
        local: &'a mut [u32],
    ) -> Self {
        let at = |vertex: u32| DVec3::from(whole.positions[vertex as usize].map(f64::from));
        let origin = facets.first().map_or(DVec3::ZERO, |&facet| at(whole.facets[facet as usize].corners[0]));
        let mut tile = Tile {
            fine: whole.fine,
            origin,
            limit: (USED * error).powi(2),
            error,
            pitch,
            least: 0.0,
            vertices: Vec::new(),
            triangles: Vec::with_capacity(facets.len()),
            next: Vec::with_capacity(3 * facets.len()),
            samples: Vec::new(),
            queue: Queue::default(),
            marks: Vec::new(),
            mark: 0,
            near: &mut [],
            scratch: Scratch::default(),
        };
        let mut reach = 0.0_f64;
        for &facet in facets {
            let number = tile.triangles.len() as u32;
            let corners = whole.facets[facet as usize].corners.map(|id| {
                let local = &mut local[id as usize];
                if *local == NONE {
                    *local = tile.vertices.len() as u32;
                    let position = at(id);
                    reach = reach.max(position.abs().max_element());
                    tile.vertices.push(Vertex {
                        id,
                        position,
                        class: if free(id) { Class::Free } else { Class::Fixed },
                        itself: whole.homes[id as usize] == Home::Itself,
                        version: 0,
                        quadric: Quadric::default(),
                        curve_error: f64::from(whole.curve_errors[id as usize]),
                        corner: NONE,
                    });
                }
                *local
            });
            for (k, corner) in (0..).zip(corners) {
                let head = &mut tile.vertices[corner as usize].corner;
                tile.next.push(std::mem::replace(head, 3 * number + k));
            }
            let mut sample = NONE;
            for &id in held.of(facet) {
                tile.samples.push(Sample { id, next: sample });
                sample = (tile.samples.len() - 1) as u32;
            }
            tile.triangles.push(Triangle { corners, sides: whole.facets[facet as usize].sides(), sample });
        }
        for vertex in &tile.vertices {
            local[vertex.id as usize] = NONE;
        }
        tile.near = local;
        tile.least = LEAST_STEPS * f64::from(f32::EPSILON) * reach;
        tile.marks = vec![0; tile.vertices.len()];
        tile.classify();
        tile.add_quadrics();
        tile
    }

    fn position(&self, vertex: u32) -> DVec3 {
        self.vertices[vertex as usize].position
    }

    /// Replaces `around` by the triangles of a vertex.
    fn gather(&self, vertex: u32, around: &mut Vec<u32>) {
        around.clear();
        let mut corner = self.vertices[vertex as usize].corner;
        while corner != NONE {
            if self.triangles[(corner / 3) as usize].corners[0] != NONE {
                around.push(corner / 3);
            }
            corner = self.next[corner as usize];
        }
    }

    /// The vertices after and before `vertex` in a triangle of it.
    fn ends(&self, triangle: u32, vertex: u32) -> [u32; 2] {
        let [a, b, c] = self.triangles[triangle as usize].corners;
        if a == vertex {
            [b, c]
        } else if b == vertex {
            [c, a]
        } else {
            [a, b]
        }
    }

    fn add_quadrics(&mut self) {
        for Triangle { corners, .. } in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.vertices[corner as usize].position - self.origin);
            let area = (b - a).cross(c - a);
            let quadric = Quadric::plane(area.normalize_or_zero(), a, 0.5 * area.length());
            for &corner in corners {
                self.vertices[corner as usize].quadric.add(&quadric);
            }
        }
    }

    /// Collapses all edges that may be.
    pub fn collapse_all(&mut self) {
        for triangle in 0..self.triangles.len() {
            let [a, b, c] = self.triangles[triangle].corners;
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let ends = [from, to].map(|end| &self.vertices[end as usize]);
                let once = from < to || ends.iter().all(|end| end.class != Class::Free);
                if once {
                    self.push(from, to);
                }
            }
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        while let Some(([u, v], versions)) = self.queue.pop() {
            if [u, v].map(|end| self.vertices[end as usize].version) != versions {
                continue;
            }
            if let Some((_, gone, stays, place)) = self.candidate(u, v)
                && self.collapse(gone, stays, place, &mut scratch)
            {
                self.push_around(stays, &mut scratch);
            }
        }
        self.scratch = scratch;
    }

    fn push_around(&mut self, vertex: u32, scratch: &mut Scratch) {
        let [around, _] = &mut scratch.around;
        self.gather(vertex, around);
        self.mark += 1;
        for &triangle in around.iter() {
            for end in self.ends(triangle, vertex) {
                if std::mem::replace(&mut self.marks[end as usize], self.mark) != self.mark {
                    self.push(vertex, end);
                }
            }
        }
    }

    fn push(&mut self, u: u32, v: u32) {
        if let Some((cost, ..)) = self.candidate(u, v) {
            let versions = [u, v].map(|end| self.vertices[end as usize].version);
            self.queue.push(cost, ([u, v], versions));
        }
    }

    /// What it would cost to collapse an edge, which end goes, which one stays, and where that comes to lie.
    fn candidate(&self, u: u32, v: u32) -> Option<(f64, u32, u32, DVec3)> {
        let [p, q] = [u, v].map(|end| &self.vertices[end as usize]);
        let mut quadric = p.quadric;
        quadric.add(&q.quadric);
        let at = |place: DVec3| quadric.at(place - self.origin);
        let (gone, stays, place) = match (p.class, q.class) {
            (Class::Free, Class::Free) => {
                let middle = 0.5 * (p.position + q.position);
                let best = quadric.best(middle - self.origin) + self.origin;
                let far = !(best.distance_squared(middle) < p.position.distance_squared(q.position));
                let best = self.rounded(if far { middle } else { best });
                let (to_p, to_q) = (at(p.position), at(q.position));
                if at(best) < 0.999 * to_p.min(to_q) {
                    (u, v, best)
                } else if to_p < to_q {
                    (v, u, p.position)
                } else {
                    (u, v, q.position)
                }
            }
            (Class::Free, _) => (u, v, q.position),
            (_, Class::Free) => (v, u, p.position),
            (Class::Curve, Class::Curve) if at(p.position) < at(q.position) => (v, u, p.position),
            (Class::Curve, _) => (u, v, q.position),
            (Class::Fixed, Class::Curve) => (v, u, p.position),
            (Class::Fixed, Class::Fixed) => return None,
        };
        let cost = at(place);
        if cost > (HOPELESS * self.error).powi(2) * quadric.weight {
            return None;
        }
        let length = SHORT_FIRST * quadric.weight * p.position.distance_squared(q.position);
        Some((cost + length, gone, stays, place))
    }

    /// Joins `gone` with `stays` at `place` if nothing speaks against it.
    fn collapse(&mut self, gone: u32, stays: u32, mut place: DVec3, scratch: &mut Scratch) -> bool {
        let [of_gone, of_stays] = &mut scratch.around;
        self.gather(gone, of_gone);
        self.gather(stays, of_stays);
        if !self.keeps_topology(gone, stays, of_gone, of_stays) {
            return false;
        }
        let Ok(curve) = self.curve(gone, stays, of_gone, of_stays) else { return false };
        if !self.turns(gone, stays, place, scratch) {
            return false;
        }
        if !self.holds_samples(gone, stays, place, scratch) {
            // The place that is best on the mean may be too far from one: the middle between the furthest may not.
            if place == self.position(stays) {
                return false;
            }
            place = self.between(place, scratch);
            if !self.turns(gone, stays, place, scratch) || !self.holds_samples(gone, stays, place, scratch) {
                return false;
            }
        }
        if !self.holds_middles(gone, stays, scratch) || !self.stays_near(gone, stays, place, scratch) {
            return false;
        }
        if let Some((end, error)) = curve {
            for vertex in [stays, end] {
                let known = &mut self.vertices[vertex as usize].curve_error;
                *known = known.max(error);
            }
        }
        self.join(gone, stays, place, scratch);
        true
    }

    /// Carries the collapse out.
    fn join(&mut self, gone: u32, stays: u32, place: DVec3, scratch: &mut Scratch) {
        let Scratch { around: [of_gone, of_stays], new, samples, nearest, .. } = scratch;
        for &triangle in of_gone.iter().chain(of_stays.iter()) {
            let triangle = &mut self.triangles[triangle as usize];
            triangle.sample = NONE;
            if triangle.corners.contains(&gone) && triangle.corners.contains(&stays) {
                triangle.corners = [NONE; 3];
            }
            for corner in triangle.corners.iter_mut().filter(|corner| **corner == gone) {
                *corner = stays;
            }
        }
        // The corners of the one go to the end of the other's.
        let mut last = self.vertices[stays as usize].corner;
        while self.next[last as usize] != NONE {
            last = self.next[last as usize];
        }
        self.next[last as usize] = std::mem::replace(&mut self.vertices[gone as usize].corner, NONE);
        let quadric = {
            let it = &mut self.vertices[gone as usize];
            it.version += 1;
            it.quadric
        };
        let it = &mut self.vertices[stays as usize];
        it.version += 1;
        it.quadric.add(&quadric);
        it.itself &= it.position == place;
        it.position = place;
        for (&(id, ..), &near) in samples.iter().zip(nearest.iter()) {
            let triangle = &mut self.triangles[new[near as usize].triangle as usize];
            self.samples.push(Sample { id, next: triangle.sample });
            triangle.sample = (self.samples.len() - 1) as u32;
        }
    }

    /// What is left.
    pub fn changes(&self) -> Changes {
        let mut changes = Changes::default();
        let fine = |id: u32| self.fine.positions[id as usize];
        for vertex in &self.vertices {
            let position = vertex.position.as_vec3().to_array();
            if position != fine(vertex.id) {
                changes.moved.push((vertex.id, position));
            }
            if vertex.corner == NONE && vertex.class == Class::Curve {
                changes.homes.push((vertex.id, Home::Curve));
            }
            if vertex.curve_error > 0.0 {
                changes.curve_errors.push((vertex.id, vertex.curve_error as f32));
            }
        }
        for triangle in self.triangles.iter().filter(|triangle| triangle.corners[0] != NONE) {
            let home = Home::Facet(changes.facets.len() as u32);
            let mut sample = triangle.sample;
            while sample != NONE {
                let Sample { id, next } = self.samples[sample as usize];
                changes.homes.push((id, home));
                sample = next;
            }
            let [behind, front] = triangle.sides;
            let corners = triangle.corners.map(|corner| self.vertices[corner as usize].id);
            changes.facets.push(Facet { corners, behind, front });
        }
        changes
    }
}
