//! Which triangles, and which parts of them, are surface.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;

use super::{
    contact::{Frame, Line, Tolerance},
    cut::{self, Piece},
    point,
    soup::{Soup, outer_box},
};
use crate::{
    disjoint_sets::DisjointSets,
    mesh::{
        TriangleMesh,
        heal::{
            area,
            edges::{Edges, triangle_of},
        },
    },
    parallel,
};

/// What becomes of a triangle.
#[derive(Clone)]
pub(super) enum Verdict {
    Stays,
    Goes,
    Parts(Vec<Piece>),
}

/// A piece less than so many times as wide as it is judged from afar is judged from nearer: two faces that meet at 7°
/// or more are then told apart.
const NARROW: f64 = 16.0;

/// Decides over the triangles of one surface.
pub(super) struct Judge<'a> {
    pub(super) soup: &'a Soup,
    pub(super) tolerance: Tolerance,
    /// Of faces that lie on each other the one of lowest rank stays; those of the soup's triangles.
    pub(super) rank: &'a (dyn Fn(usize) -> u32 + Sync),
    /// Whether a triangle of the surface pays no heed to one of the soup.
    pub(super) skips: &'a (dyn Fn(usize, usize) -> bool + Sync),
    /// Whether corners in common make neighbours.
    pub(super) knows_neighbours: bool,
    /// Per body, whether it was met behind a face.
    pub(super) behind: Vec<AtomicBool>,
    /// Per body, whether it was met on either side of a face.
    pub(super) beside: Vec<AtomicBool>,
    /// Whether space was met that the surface goes round the wrong way.
    pub(super) inside_out: AtomicBool,
}

impl<'a> Judge<'a> {
    /// A judge of faces that are all first, and pay heed to all.
    pub(super) fn new(soup: &'a Soup, tolerance: Tolerance) -> Self {
        let none = || (0..soup.bodies).map(|_| Default::default()).collect();
        Self {
            soup,
            tolerance,
            rank: &|_| u32::MAX,
            skips: &|_, _| false,
            knows_neighbours: true,
            behind: none(),
            beside: none(),
            inside_out: AtomicBool::new(false),
        }
    }

    /// Whether space was met that the surface goes round the wrong way, with nothing on the other side of the face.
    pub(super) fn is_inside_out(&self) -> bool {
        self.inside_out.load(Ordering::Relaxed)
    }

    /// Whether a body was met behind a face.
    pub(super) fn is_behind(&self, body: u16) -> bool {
        self.behind[usize::from(body)].load(Ordering::Relaxed)
    }

    /// Whether a body was met on either side of a face.
    pub(super) fn is_beside(&self, body: u16) -> bool {
        self.beside[usize::from(body)].load(Ordering::Relaxed)
    }

    /// What becomes of triangles, of which those of `mesh` come first; `rank` is theirs.
    pub(super) fn verdicts(
        &self,
        corners: &[[DVec3; 3]],
        mesh: &TriangleMesh,
        rank: impl Fn(usize) -> u32 + Sync,
    ) -> Vec<Verdict> {
        let frames: Vec<Option<Frame>> = parallel::map_all(corners, Frame::new);
        // Lines to cut along; `None` where nothing touches the triangle.
        let lines: Vec<Option<Vec<Line>>> =
            parallel::map(frames.len(), |t| frames[t].as_ref().and_then(|frame| self.lines(t, &corners[t], frame)));
        let speaker = speakers(corners, mesh, |t| frames[t].is_none() || lines[t].is_some());
        let judged: Vec<Verdict> = parallel::map_in(corners.len(), Vec::new, |windings, t| {
            let Some(frame) = frames[t].as_ref().filter(|_| speaker[t] == t) else { return Verdict::Goes };
            let face = Face { corners: &corners[t], frame, rank: rank(t), touches: lines[t].is_some() };
            let lines = lines[t].clone().unwrap_or_default();
            match cut::kept(frame.corners, lines, self.tolerance, |piece| self.keeps(&face, piece, windings)) {
                None => Verdict::Stays,
                Some(parts) if parts.is_empty() => Verdict::Goes,
                Some(parts) => Verdict::Parts(parts),
            }
        });
        speaker.into_iter().map(|t| judged[t].clone()).collect()
    }

    /// The lines along which others meet a triangle.
    fn lines(&self, t: usize, corners: &[DVec3; 3], frame: &Frame) -> Option<Vec<Line>> {
        let mut lines = Vec::new();
        let mut touches = false;
        self.soup.boxes.near(outer_box(corners, self.tolerance.touch), |u| {
            if !(self.skips)(t, u) {
                let other = &self.soup.corners[u];
                let shared = other.map(|p| self.knows_neighbours && corners.contains(&p));
                touches |= frame.meet(other, shared, self.tolerance, &mut lines);
            }
        });
        touches.then_some(lines)
    }

    /// Whether a piece has inside behind it and none before it, and no other face lies on it that comes first.
    fn keeps(&self, face: &Face<'_>, piece: &Piece, windings: &mut Vec<i32>) -> bool {
        let Tolerance { touch, rounding } = self.tolerance;
        let width = cut::width(piece);
        // Narrow pieces are judged from nearer, or beside a seam all would seem to touch.
        let off = (width / NARROW).clamp(rounding, touch);
        let middle = piece.iter().map(|corner| corner.weights).sum::<DVec3>() / piece.len() as f64;
        let at = point(face.corners, middle);
        // Beside a sliver rounding may have met anything.
        let is_wide = width > NARROW * touch;
        let met = |seen: &[AtomicBool], windings: &[i32]| {
            for (seen, _) in seen.iter().zip(windings).filter(|(_, winding)| **winding > 0) {
                seen.store(true, Ordering::Relaxed);
            }
        };
        self.soup.windings(at - off * face.frame.normal, windings);
        let several = self.soup.bodies > 1;
        if several {
            met(&self.beside, windings);
        }
        if is_wide && several {
            met(&self.behind, windings);
        }
        let behind = windings.iter().any(|winding| *winding > 0);
        self.soup.windings(at + off * face.frame.normal, windings);
        if several {
            met(&self.beside, windings);
        }
        let before = windings.iter().any(|winding| *winding > 0);
        if is_wide && !before && !behind && windings.iter().any(|winding| *winding < 0) {
            self.inside_out.store(true, Ordering::Relaxed);
        }
        if before || !behind {
            return false;
        }
        let mut is_covered = false;
        if face.touches {
            self.soup.boxes.near(outer_box(&[at; 3], off), |u| {
                is_covered |= (self.rank)(u) < face.rank && face.frame.is_covered(at, &self.soup.corners[u], off);
            });
        }
        !is_covered
    }
}

/// A triangle before the judge.
struct Face<'a> {
    corners: &'a [DVec3; 3],
    frame: &'a Frame,
    rank: u32,
    touches: bool,
}

/// For every triangle the one that is judged in its place: the largest of those that edges connect, but for those
/// `alone`, and for those beyond the mesh.
fn speakers(corners: &[[DVec3; 3]], mesh: &TriangleMesh, alone: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut patches = DisjointSets::new(corners.len());
    for edge in Edges::new(mesh.positions.len(), &mesh.triangles).iter() {
        if let [a, b] = *edge.half_edges {
            let [a, b] = [a, b].map(triangle_of);
            if !alone(a) && !alone(b) {
                patches.join(a as u32, b as u32);
            }
        }
    }
    let mut largest: Vec<usize> = (0..corners.len()).collect();
    for t in 0..corners.len() {
        let root = patches.root(t as u32) as usize;
        if area(corners[t]) > area(corners[largest[root]]) {
            largest[root] = t;
        }
    }
    (0..corners.len()).map(|t| largest[patches.root(t as u32) as usize]).collect()
}
