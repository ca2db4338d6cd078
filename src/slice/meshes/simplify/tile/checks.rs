//! What speaks against a collapse: triangles that turn over, and places that would be too far from the fine triangles
//! or these from them.
//!
//! Distances are bounded from above: a fine vertex is held against the new triangles alone, a place on these against
//! some fine triangles nearby or the exact boundary. A fine edge across two new triangles may be further from them than
//! its ends; its middle is looked at, or what is next to it on the exact boundary. In triangles that are nearly flat to each other what lies between is no further than what was looked
//! at.

use glam::DVec3;

use super::{NONE, New, Sample, Scratch, Tile, Triangle};
use crate::{sdf::closest_point, slice::meshes::simplify::tile::Class};

/// Cosine of how far a triangle may turn in one collapse.
const TURN: f64 = 0.3;
/// A new triangle's least height over its longest edge.
const LEAST_SHAPE: f64 = 1e-4;
/// Where two new triangles are not flat to each other, their edge is held against the fine ones every so many pitches.
const SPACING: f64 = 0.7;
/// They are flat if a fine edge across would be off by no more than this share of the error.
const FLAT: f64 = 0.25;
/// A triangle that a fine vertex lies straight above, by no more than this share of the squared error, will do: others
/// are not looked at.
const GOOD: f64 = 1e-2;

/// Of triangles with an edge of so many pitches, the fine vertices that lie well within are told first.
const LARGE: f64 = 6.0;
/// No fine edge is longer than so many pitches, but those to vertices on edges of the surface beyond the cell; none of
/// these leads across a large triangle.
const LONGEST: f64 = 2.0;

/// The exact boundary stands in for the middle of a fine edge where it is no further from it than this share of the
/// pitch.
const STANDS_IN: f64 = 0.1;

/// Unit vectors in the plane of a triangle, from the edge after each corner inwards.
fn inwards(new: &New) -> [DVec3; 3] {
    let [a, b, c] = new.corners;
    [b - a, c - b, a - c].map(|edge| new.normal.cross(edge).normalize_or_zero())
}

/// A triangle between two materials that places are held against, and a box beyond which none is near it.
struct Boxed {
    corners: [DVec3; 3],
    sides: [u8; 2],
    low: DVec3,
    high: DVec3,
}

impl Boxed {
    fn new(corners: [DVec3; 3], sides: [u8; 2], reach: f64) -> Self {
        let [a, b, c] = corners;
        Self { corners, sides, low: a.min(b).min(c) - reach, high: a.max(b).max(c) + reach }
    }

    /// Whether `p` is within √`limit`, which is less than the reach.
    fn is_near(&self, p: DVec3, limit: f64) -> bool {
        p.cmpge(self.low).all() && p.cmple(self.high).all() && closest_point(p, &self.corners).distance_squared <= limit
    }
}

/// How far the normals of triangles are from the first one's, at most.
fn bend(new: &[New]) -> f64 {
    new.iter().map(|other| other.normal.distance(new[0].normal)).fold(0.0, f64::max)
}

impl Tile<'_> {
    /// Fills `scratch.new`; false if a triangle would turn over or have no area.
    pub(super) fn turns(&self, gone: u32, stays: u32, place: DVec3, scratch: &mut Scratch) -> bool {
        let Scratch { around: [of_gone, of_stays], new, .. } = scratch;
        new.clear();
        for (around, vertex, other) in [(of_gone, gone, stays), (of_stays, stays, gone)] {
            for &triangle in around.iter() {
                let ends = self.ends(triangle, vertex);
                if ends.contains(&other) {
                    continue;
                }
                let [a, b] = ends.map(|end| self.position(end));
                let area = (a - place).cross(b - place);
                let from = self.position(vertex);
                let before = (a - from).cross(b - from);
                let size = area.length();
                let longest = (a - place).length_squared().max((b - place).length_squared());
                let longest = longest.max((a - b).length_squared()).sqrt();
                if size < longest * self.least.max(LEAST_SHAPE * longest)
                    || area.dot(before) < TURN * size * before.length()
                {
                    return false;
                }
                let sides = self.triangles[triangle as usize].sides;
                new.push(New { triangle, corners: [place, a, b], normal: area / size, sides, ends });
            }
        }
        !new.is_empty()
    }

    /// Fills `scratch.samples` and finds the new triangle that each is nearest to; false if one is too far from all.
    pub(super) fn holds_samples(&self, gone: u32, stays: u32, place: DVec3, scratch: &mut Scratch) -> bool {
        let Scratch { around, new, samples, nearest, .. } = scratch;
        samples.clear();
        nearest.clear();
        for (vertex, around) in [(gone, &around[0]), (stays, &around[1])] {
            let it = &self.vertices[vertex as usize];
            if it.class == Class::Free && it.itself && it.position != place {
                samples.push((it.id, self.triangles[around[0] as usize].sides));
            }
        }
        for &triangle in around.iter().flatten() {
            let Triangle { sides, mut sample, corners } = self.triangles[triangle as usize];
            // Those of both ends are seen from one.
            if corners.contains(&gone) && corners.contains(&stays) && around[1].contains(&triangle) {
                continue;
            }
            while sample != NONE {
                let Sample { id, next } = self.samples[sample as usize];
                samples.push((id, sides));
                sample = next;
            }
        }
        for &triangle in around[0].iter().filter(|&&triangle| self.ends(triangle, gone).contains(&stays)) {
            let Triangle { sides, mut sample, .. } = self.triangles[triangle as usize];
            while sample != NONE {
                let Sample { id, next } = self.samples[sample as usize];
                samples.push((id, sides));
                sample = next;
            }
        }
        let mut last = 0;
        samples.iter().all(|&(id, sides)| {
            let p = self.fine.at(id);
            let (mut best, mut least) = (last, f64::INFINITY);
            for n in (last..new.len()).chain(0..last) {
                let new = &new[n];
                // The plane alone may tell that another one is nearer.
                let above = new.normal.dot(p - new.corners[0]).powi(2);
                if new.sides == sides && above < least {
                    let distance = closest_point(p, &new.corners).distance_squared;
                    if distance < least {
                        (best, least) = (n, distance);
                    }
                    if distance <= GOOD * self.limit && distance <= above + GOOD * GOOD * self.limit {
                        break;
                    }
                }
            }
            nearest.push(best as u32);
            last = best;
            least <= self.limit
        })
    }

    /// `place`, moved so that the samples furthest above and below are as far.
    pub(super) fn between(&self, place: DVec3, scratch: &Scratch) -> DVec3 {
        let Scratch { new, samples, .. } = scratch;
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for &(id, sides) in samples {
            let p = self.fine.at(id);
            let (mut distance, mut found) = (f64::INFINITY, f64::NAN);
            for new in new.iter().filter(|new| new.sides == sides) {
                // The plane alone may tell that another one is nearer.
                if new.normal.dot(p - new.corners[0]).powi(2) < distance {
                    let nearest = closest_point(p, &new.corners);
                    if nearest.distance_squared < distance {
                        (distance, found) = (nearest.distance_squared, new.normal.dot(p - nearest.point));
                    }
                }
            }
            // Not a number leaves both as they are.
            (least, greatest) = (least.min(found), greatest.max(found));
        }
        let normal: DVec3 = new.iter().map(|new| new.normal).sum();
        let shift = 0.5 * (least + greatest);
        if shift.is_finite() { self.rounded(place + shift * normal.normalize_or_zero()) } else { place }
    }

    /// A place as files have it, within the bounds of all fine triangles.
    pub(super) fn rounded(&self, place: DVec3) -> DVec3 {
        let [low, high] = self.fine.bounds;
        place.clamp(low, high).as_vec3().as_dvec3()
    }

    /// Whether the middles of fine edges that were near the triangles still are, where these are not flat.
    ///
    /// A triangle that is near both ends of an edge is near all of it, for distance to a triangle is convex.
    pub(super) fn holds_middles(&mut self, gone: u32, stays: u32, scratch: &Scratch) -> bool {
        if self.is_flat(2.0 * bend(&scratch.new)) {
            return true;
        }
        for (&(id, _), &near) in scratch.samples.iter().zip(&scratch.nearest) {
            self.near[id as usize] = near;
        }
        let holds = self.holds_crossing(gone, stays, scratch);
        for &(id, _) in &scratch.samples {
            self.near[id as usize] = NONE;
        }
        holds
    }

    /// The same, of those edges whose ends are not near one triangle.
    fn holds_crossing(&self, gone: u32, stays: u32, scratch: &Scratch) -> bool {
        let Scratch { around, new, samples, nearest, .. } = scratch;
        let now: Vec<Boxed> = new.iter().map(|new| Boxed::new(new.corners, new.sides, self.error)).collect();
        let before: Vec<Boxed> = around
            .iter()
            .flatten()
            .map(|&triangle| {
                let Triangle { corners, sides, .. } = self.triangles[triangle as usize];
                Boxed::new(corners.map(|corner| self.position(corner)), sides, self.error)
            })
            .collect();
        let is_near = |all: &[Boxed], p: DVec3, sides: [u8; 2]| {
            all.iter().any(|it| it.sides == sides && it.is_near(p, self.limit))
        };
        let is_large = |new: &New| new.corners[1].distance(new.corners[0]) > LARGE * self.pitch;
        let frames: Vec<[DVec3; 3]> =
            if new.iter().any(is_large) { new.iter().map(inwards).collect() } else { Vec::new() };
        let holds = |id: u32, near: usize| {
            let New { sides, ref corners, .. } = new[near];
            let inner = |inwards: &[DVec3; 3]| {
                let p = self.fine.at(id);
                corners.iter().zip(inwards).all(|(corner, inwards)| inwards.dot(p - corner) > LONGEST * self.pitch)
            };
            frames.get(near).is_some_and(inner)
                || self.fine.ends(id).all(|end| {
                    let other = self.near[end as usize];
                    if other == near as u32 || (other != NONE && end < id) {
                        return true;
                    }
                    let middle = 0.5 * (self.fine.at(id) + self.fine.at(end));
                    now[near].is_near(middle, self.limit)
                        || is_near(&now, middle, sides)
                        || !is_near(&before, middle, sides)
                        || self.fine.exact.above_level(middle, [id, end]).is_some_and(|level| {
                            level.off <= STANDS_IN * self.pitch && is_near(&now, level.onto, sides)
                        })
                })
        };
        let itself = |vertex: u32| {
            let vertex = &self.vertices[vertex as usize];
            (vertex.itself && vertex.class == Class::Free).then_some(vertex.id)
        };
        samples.iter().zip(nearest).all(|(&(id, ..), &near)| holds(id, near as usize))
            && (0..new.len()).all(|near| itself(new[near].ends[0]).is_none_or(|id| holds(id, near)))
            && [gone, stays].iter().all(|&vertex| itself(vertex).is_none_or(|id| holds(id, 0)))
    }

    /// Whether the joined vertex and the edges at it that are not flat are near the fine triangles.
    pub(super) fn stays_near(&self, gone: u32, stays: u32, place: DVec3, scratch: &mut Scratch) -> bool {
        let Scratch { new, samples, anchors, .. } = scratch;
        anchors.clear();
        anchors.extend(samples.iter().map(|&(id, ..)| (id, self.fine.at(id))));
        let ends = new.iter().map(|new| new.ends[0]).chain([gone, stays]);
        anchors.extend(ends.filter_map(|end| {
            let vertex = &self.vertices[end as usize];
            vertex.itself.then_some((vertex.id, vertex.position))
        }));
        let near = |p: DVec3| {
            let nearest = anchors.iter().map(|&(id, anchor)| (anchor.distance_squared(p), id));
            let nearest = nearest.reduce(|best, other| if other.0 < best.0 { other } else { best });
            nearest.is_some_and(|(distance, id)| {
                self.fine.is_near(p, id, self.limit)
                    || distance <= (LONGEST * self.pitch).powi(2)
                        && self.fine.exact.above_level(p, [id; 2]).is_some_and(|level| level.off.powi(2) <= self.limit)
            })
        };
        if place != self.position(stays) && !near(place) {
            return false;
        }
        let along = |from: DVec3, to: DVec3| {
            let steps = (from.distance(to) / (SPACING * self.pitch)).ceil().max(2.0) as u32;
            (1..steps).all(|step| near(from.lerp(to, f64::from(step) / f64::from(steps))))
        };
        new.iter().all(|one| {
            let end = one.ends[0];
            let across = new.iter().filter(|other| other.ends[1] == end && other.sides == one.sides);
            let bend = across.map(|other| one.normal.distance(other.normal)).fold(0.0, f64::max);
            self.is_flat(bend) || along(place, self.position(end))
        })
    }

    /// Whether a fine edge across two triangles whose unit normals differ by `bend` keeps near to them.
    fn is_flat(&self, bend: f64) -> bool {
        0.25 * self.pitch * bend <= FLAT * self.error
    }
}
