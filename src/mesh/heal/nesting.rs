//! Shells: connected pieces, which way each faces, and which are cavities.
//!
//! A shell is what edges connect; shells whose rims run along each other are one body ([`super::rims`]), and judged as
//! one. If the shells together hold a negative volume, all turn. A body that then still holds a negative volume is a
//! cavity if most of its faces lie within others (their winding number is positive there) and stays; else it faces
//! inwards by mistake and turns. Faces are asked a little within the body, so that a pocket which ends in the face of
//! what it is cut into counts as within. Larger bodies are judged before the smaller ones they may hold. Which way a
//! shell faces that is open by more than [`MAX_CAP_FRACTION`] is unknown: it is refused where it would have to turn.

use glam::DVec3;

use super::edges::{Edges, triangle_of};
use super::fill::Cap;
use super::rims::Bodies;
use super::union::{Soup, tolerance};
use super::{HealthReport, MAX_CAP_FRACTION, MIN_COMPACTNESS, MeshError, TriangleMesh, area};
use crate::parallel;
use crate::{disjoint_sets::DisjointSets, mesh::bounds};

/// Faces that the cavity test may ask for: about a second.
const BUDGET: usize = 400_000;

/// Faces of a body that are asked.
const SAMPLES: usize = 24;

/// Solid angles summed by one task; fixed, so that sums do not depend on the thread count.
const CHUNK: usize = 1 << 14;

/// Share of the volume that an open piece may hold and be turned without more ado: debris of scans does.
const NEGLIGIBLE: f64 = 1e-3;

/// Connected pieces of a mesh.
pub(super) struct Shells {
    /// Shell of every triangle, numbered in order of first appearance.
    pub(super) of_triangle: Vec<u32>,
    pub(super) all: Vec<Shell>,
}

/// Measures of one piece.
#[derive(Debug, Clone)]
pub(super) struct Shell {
    pub(super) area: f64,
    pub(super) cap_area: f64,
    /// Signed, caps included.
    pub(super) volume: f64,
    pub(super) triangles: usize,
    /// Whether its rim lies in or on the others, so that nothing of its caps shows.
    pub(super) is_seated: bool,
    low: DVec3,
    high: DVec3,
}

impl Shells {
    pub(super) fn new(mesh: &TriangleMesh, edges: &Edges) -> Self {
        let mut pieces = DisjointSets::new(mesh.triangles.len());
        for edge in edges.iter() {
            for pair in edge.half_edges.windows(2) {
                pieces.join(triangle_of(pair[0]) as u32, triangle_of(pair[1]) as u32);
            }
        }
        const UNNAMED: u32 = u32::MAX;
        let mut name = vec![UNNAMED; mesh.triangles.len()];
        let mut all = Vec::new();
        let of_triangle = (0..mesh.triangles.len())
            .map(|t| {
                let root = pieces.root(t as u32) as usize;
                if name[root] == UNNAMED {
                    name[root] = all.len() as u32;
                    let (low, high) = bounds(&[]);
                    all.push(Shell {
                        area: 0.0,
                        cap_area: 0.0,
                        volume: 0.0,
                        triangles: 0,
                        is_seated: false,
                        low,
                        high,
                    });
                }
                name[root]
            })
            .collect();
        Self { of_triangle, all }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// Sums up areas, volumes and bounds.
    pub(super) fn measure(&mut self, mesh: &TriangleMesh, caps: &[Cap]) {
        // Measured from the middle, so that a mesh far from the origin loses no digits.
        let (low, high) = bounds(&mesh.positions);
        let middle = 0.5 * (low + high);
        let volume = |[a, b, c]: [DVec3; 3]| (a - middle).dot((b - middle).cross(c - middle)) / 6.0;
        for (corners, &shell) in mesh.corners().zip(&self.of_triangle) {
            let shell = &mut self.all[shell as usize];
            shell.area += area(corners);
            shell.volume += volume(corners);
            shell.triangles += 1;
            for p in corners {
                (shell.low, shell.high) = (shell.low.min(p), shell.high.max(p));
            }
        }
        for cap in caps {
            let shell = &mut self.all[cap.shell as usize];
            shell.cap_area += area(cap.corners);
            shell.volume += volume(cap.corners);
        }
    }

    /// Notes which shells are seated, by their triangles; none are where the list is empty.
    pub(super) fn seat(&mut self, seated: &[bool]) {
        let mut count = vec![0; self.len()];
        for (&shell, _) in self.of_triangle.iter().zip(seated).filter(|(_, seated)| **seated) {
            count[shell as usize] += 1;
        }
        self.all.iter_mut().zip(count).for_each(|(shell, count)| shell.is_seated = count == shell.triangles);
    }

    /// Turns bodies that face inwards by mistake, in the mesh and the caps.
    ///
    /// # Errors
    /// An open shell would have to turn.
    pub(super) fn turn_outwards(
        &mut self,
        mesh: &mut TriangleMesh,
        caps: Vec<Cap>,
        bodies: &Bodies,
        health: &mut HealthReport,
    ) -> Result<Vec<[DVec3; 3]>, MeshError> {
        let total: f64 = self.all.iter().map(|shell| shell.volume).sum();
        let mut turned = vec![total < 0.0; self.len()];
        if total < 0.0 {
            self.all.iter_mut().for_each(|shell| shell.volume = -shell.volume);
        }
        let mut volume = vec![0.0; self.len()];
        let mut parts = vec![0; self.len()];
        for (shell, &body) in self.all.iter().zip(&bodies.of_shell) {
            volume[body as usize] += shell.volume;
            parts[body as usize] += 1;
        }
        let mut negative: Vec<usize> = (0..self.len()).filter(|&body| volume[body] < 0.0).collect();
        // A stable sort: equal volumes keep their order.
        negative.sort_by(|&a, &b| volume[a].total_cmp(&volume[b]));
        let mut judge = None;
        let mut spent = 0;
        for body in negative {
            let is_own = |shell: usize| bodies.of_shell[shell] as usize == body;
            if (0..self.len()).any(|other| !is_own(other) && self.all[other].meets(&self.all[body])) {
                let judge = judge.get_or_insert_with(|| CavityJudge::new(mesh, &caps, self, bodies));
                if spent + SAMPLES > BUDGET {
                    health.unjudged_shells += parts[body];
                    continue;
                }
                spent += SAMPLES;
                let alone = Some(&self.all[body]).filter(|shell| parts[body] == 1 && shell.is_open());
                if judge.is_within(body, alone, &bodies.of_shell, &turned) {
                    continue;
                }
            }
            let alone = &self.all[body];
            let matters = -alone.volume > NEGLIGIBLE * total.abs();
            if parts[body] == 1 && self.len() > 1 && alone.is_open() && !alone.is_seated && matters {
                return Err(MeshError::Facing {
                    triangles: alone.triangles,
                    percent: 100.0 * alone.cap_area / alone.area,
                    limit_percent: 100.0 * MAX_CAP_FRACTION,
                });
            }
            for shell in (body..self.len()).filter(|&shell| is_own(shell)) {
                turned[shell] = !turned[shell];
                self.all[shell].volume = -self.all[shell].volume;
            }
        }
        for t in 0..mesh.triangles.len() {
            if turned[self.of_triangle[t] as usize] {
                mesh.flip(t);
            }
        }
        health.turned_shells = turned.iter().filter(|&&turned| turned).count();
        let turn = |Cap { shell, corners: [a, b, c] }| if turned[shell as usize] { [a, c, b] } else { [a, b, c] };
        Ok(caps.into_iter().map(turn).collect())
    }

    /// Whether the boxes of any two come as near as `touch`.
    pub(super) fn may_meet(&self, touch: f64) -> bool {
        let mut order: Vec<&Shell> = self.all.iter().collect();
        order.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
        // Those that begin after a shell's end are beyond it.
        order.iter().enumerate().any(|(i, shell)| {
            let after = order[i + 1..].iter().take_while(|other| other.low.x - touch <= shell.high.x);
            let meets = |other: &&Shell| (other.low.max(shell.low) - touch).cmple(other.high.min(shell.high)).all();
            after.into_iter().any(meets)
        })
    }
}

/// Tells whether bodies that face inwards lie within others.
struct CavityJudge {
    soup: Soup,
    /// Shell of every triangle of the soup.
    shell_of: Vec<u32>,
    /// Triangles of every body, without caps.
    members: Vec<Vec<u32>>,
    /// How far within faces are asked.
    off: f64,
}

impl CavityJudge {
    fn new(mesh: &TriangleMesh, caps: &[Cap], shells: &Shells, bodies: &Bodies) -> Self {
        let corners: Vec<_> = mesh.corners().chain(caps.iter().map(|cap| cap.corners)).collect();
        let shell_of: Vec<u32> = shells.of_triangle.iter().copied().chain(caps.iter().map(|cap| cap.shell)).collect();
        let mut members = vec![Vec::new(); shells.len()];
        for (t, &shell) in (0..).zip(&shells.of_triangle) {
            members[bodies.of_shell[shell as usize] as usize].push(t);
        }
        let off = tolerance(mesh.corner_bounds()).touch;
        let body_of = vec![0; corners.len()];
        Self { soup: Soup::new(corners, body_of), shell_of, members, off }
    }

    /// Whether most of a body's surface lies within the others, and all corners if it is an open shell: one whose rims
    /// end in their faces may be the wall of a hole. Its triangles face inwards, unless its shells turned.
    fn is_within(&self, body: usize, open: Option<&Shell>, of_shell: &[u32], turned: &[bool]) -> bool {
        let way = |t: usize| if turned[self.shell_of[t] as usize] { -1 } else { 1 };
        let weight = |t: usize| if of_shell[self.shell_of[t] as usize] as usize == body { 0 } else { way(t) };
        let members = &self.members[body];
        let count = members.len().min(SAMPLES);
        let mut balance = 0.0;
        for t in (0..count).map(|i| members[i * members.len() / count] as usize) {
            let [a, b, c] = self.soup.corners[t];
            let normal = (b - a).cross(c - a);
            let within = (a + b + c) / 3.0 + self.off * f64::from(way(t)) * normal.normalize_or_zero();
            let is_in = self.soup.winding(within, weight) > 0;
            let leaves = |shell: &Shell| {
                let middle = 0.5 * (shell.low + shell.high);
                let beyond = |p: DVec3| p + self.off * (p - middle).normalize_or_zero();
                [a, b, c].into_iter().any(|p| self.soup.winding(beyond(p), weight) <= 0)
            };
            if open.is_some_and(leaves) {
                return false;
            }
            balance += if is_in { normal.length() } else { -normal.length() };
        }
        balance >= 0.0
    }
}

impl Shell {
    /// Whether it holds next to nothing.
    pub(super) fn is_flat(&self) -> bool {
        self.volume.abs() <= MIN_COMPACTNESS * libm::pow(self.area, 1.5)
    }

    /// Whether what closes it is more than mending.
    pub(super) fn is_open(&self) -> bool {
        self.cap_area > MAX_CAP_FRACTION * self.area
    }

    /// Whether the boxes around two meet.
    fn meets(&self, other: &Self) -> bool {
        self.low.max(other.low).cmple(self.high.min(other.high)).all()
    }
}

/// Winding number of a closed surface around a point off it.
pub(super) fn winding(surface: &[[DVec3; 3]], p: DVec3) -> i64 {
    let chunks: Vec<&[[DVec3; 3]]> = surface.chunks(CHUNK).collect();
    let chunks: Vec<f64> = parallel::map_all(&chunks, |chunk| chunk.iter().map(|&t| solid_angle(t, p)).sum());
    (chunks.iter().sum::<f64>() / (4.0 * std::f64::consts::PI)).round() as i64
}

/// Signed solid angle of a triangle seen from a point, positive from its inner side (van Oosterom and Strackee, *The
/// solid angle of a plane triangle*, IEEE Trans. Biomed. Eng. 1983, eq. 8).
pub(super) fn solid_angle(corners: [DVec3; 3], p: DVec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - p);
    let [la, lb, lc] = [a.length(), b.length(), c.length()];
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * libm::atan2(numerator, denominator)
}
