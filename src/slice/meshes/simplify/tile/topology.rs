//! What meets where: curves along which boundaries meet, and that a collapse leaves them and all neighbourhoods as they
//! are.

use glam::DVec3;

use super::{Class, Tile};

impl Tile<'_> {
    /// Tells curves and the places where they meet; vertices that are fixed already stay so.
    pub(super) fn classify(&mut self) {
        let (mut around, mut seen) = (Vec::new(), Vec::new());
        for vertex in 0..self.vertices.len() as u32 {
            if self.vertices[vertex as usize].class == Class::Fixed {
                continue;
            }
            self.gather(vertex, &mut around);
            // The triangles that hang together by the edges at the vertex.
            seen.clear();
            seen.push(self.ends(around[0], vertex)[0]);
            let mut reached = 0;
            while reached < seen.len() {
                for &triangle in &around {
                    let ends = self.ends(triangle, vertex);
                    if ends.contains(&seen[reached]) {
                        for end in ends {
                            if !seen.contains(&end) {
                                seen.push(end);
                            }
                        }
                    }
                }
                reached += 1;
            }
            let whole = around.iter().all(|&triangle| seen.contains(&self.ends(triangle, vertex)[0]));
            let curves = seen.iter().filter(|&&end| self.is_curve(&around, vertex, end)).count();
            self.vertices[vertex as usize].class = match (whole, curves) {
                (true, 0) => Class::Free,
                (true, 2) => Class::Curve,
                _ => Class::Fixed,
            };
        }
    }

    /// Whether something else than one boundary's two triangles meets on the edge to `end` of the vertex that `around`
    /// is around.
    fn is_curve(&self, around: &[u32], vertex: u32, end: u32) -> bool {
        let (mut after, mut before, mut sides) = (0, 0, None);
        for &triangle in around {
            let [next, last] = self.ends(triangle, vertex);
            if next == end || last == end {
                let its = self.triangles[triangle as usize].sides;
                if *sides.get_or_insert(its) != its {
                    return true;
                }
                after += u32::from(next == end);
                before += u32::from(last == end);
            }
        }
        (after, before) != (1, 1)
    }

    /// The link condition: every vertex beside both ends forms a triangle with them, and no two triangles become one.
    /// Dey, Edelsbrunner, Guha and Nekhayev 1999, *Topology preserving edge contraction*.
    pub(super) fn keeps_topology(&mut self, gone: u32, stays: u32, of_gone: &[u32], of_stays: &[u32]) -> bool {
        self.mark += 2;
        let (beside, opposite) = (self.mark - 1, self.mark);
        let mut shared = false;
        for &triangle in of_gone {
            for end in self.ends(triangle, gone) {
                if self.marks[end as usize] != opposite {
                    self.marks[end as usize] = beside;
                }
            }
            let ends = self.ends(triangle, gone);
            if let Some(at) = ends.iter().position(|&end| end == stays) {
                self.marks[ends[1 - at] as usize] = opposite;
                shared = true;
            }
        }
        let is_opposite = |end: u32| self.marks[end as usize] == opposite;
        let mut closing = of_stays
            .iter()
            .map(|&triangle| self.ends(triangle, stays))
            .filter(|ends| ends.iter().all(|&end| is_opposite(end)));
        shared
            && of_stays.iter().all(|&triangle| {
                self.ends(triangle, stays).iter().all(|&end| end == gone || self.marks[end as usize] != beside)
            })
            && closing.all(|[a, b]| {
                of_gone.iter().all(|&triangle| {
                    let ends = self.ends(triangle, gone);
                    ends != [a, b] && ends != [b, a]
                })
            })
    }

    /// Of two ends on a curve: the curve's next vertex beyond `gone`, and how far the fine curve then is from the edge
    /// to it. An error where they may not be joined.
    pub(super) fn curve(
        &self,
        gone: u32,
        stays: u32,
        of_gone: &[u32],
        of_stays: &[u32],
    ) -> Result<Option<(u32, f64)>, ()> {
        let [p, q] = [gone, stays].map(|end| &self.vertices[end as usize]);
        if p.class == Class::Free {
            return Ok(None);
        }
        if !self.is_curve(of_gone, gone, stays) {
            return Err(());
        }
        let ends = of_gone.iter().flat_map(|&triangle| self.ends(triangle, gone));
        let beyond = ends
            .filter(|&end| end != stays && self.vertices[end as usize].class != Class::Free)
            .find(|&end| self.is_curve(of_gone, gone, end))
            .ok_or(())?;
        let touches = of_stays.iter().any(|&triangle| self.ends(triangle, stays).contains(&beyond));
        if touches && self.is_curve(of_stays, stays, beyond) {
            return Err(());
        }
        let off = distance_to_segment(p.position, q.position, self.position(beyond));
        let error = p.curve_error + off;
        if error * error <= 0.25 * self.limit { Ok(Some((beyond, error))) } else { Err(()) }
    }
}

fn distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(if share.is_finite() { a + share * along } else { a })
}
