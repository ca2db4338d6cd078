//! What all texels' profiles have in common along r, and how a profile goes on between two rings.
//!
//! ```text
//!   P(x, r) = g(r)·e^q(x, r),      q between rings on a straight line in r
//! ```
//!
//! q is smooth along r only where g is: on a patch of few large squares the mean response jumps from distance to
//! distance, as pairs of equal texels become more or fewer, by a factor of 3 where squares are 8 texels wide and decay
//! in 0.12 and 0.35 mm. A profile on straight lines over such a g cannot follow the data, and what it misses looks like
//! noise. So the fit begins with a smooth curve through the means, and in each round g is corrected at every distance
//! by what all texels together miss there, less what q at the rings can follow by itself.
//!
//! The lit texel stands for itself: its pixel holds the 1/r at the centre, and no line leads from it to the next ring.

use super::{rings::Rings, survey::Survey};

/// Noise is told from light in the mean response by this many standard deviations.
const SURE: f64 = 3.0;
/// Spread of single distances about a smooth curve, beyond their noise, in ln: fewer than this is not believed.
const SPREAD: f64 = 0.05;
/// Functions of r (in pixels) whose sum a smooth curve is: powers, exponentials, and what lies between.
const FUNCTIONS: [fn(f64) -> f64; 6] =
    [|_| 1.0, libm::log, |r| r, |r| libm::log(r).powi(2), |r| r * r, |r| libm::log(r).powi(3)];
/// So many distances for each of them.
const DISTANCES_EACH: usize = 3;
/// A function that the ones before it make up to this share says nothing new.
const DEPENDENT: f64 = 1e-6;
/// Largest correction of ln g in a round.
const LONGEST_CORRECTION: f64 = 0.3;

/// Where a distance lies between the rings: `q = q[below] + share·(q[below + 1] − q[below])`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// The ring below, or the one that a line begins at.
    pub below: usize,
    /// Part of the next ring; below 0 or above 1 where the line is continued.
    pub share: f32,
}

impl Node {
    /// q of a row at this distance.
    pub fn blend<'a>(&self, rows: impl Fn(usize) -> &'a [f32], out: &mut [f32]) {
        if self.share == 0.0 {
            out.copy_from_slice(rows(self.below));
            return;
        }
        for ((out, a), b) in out.iter_mut().zip(rows(self.below)).zip(rows(self.below + 1)) {
            *out = a + self.share * (b - a);
        }
    }

    /// The two rings between which it lies; twice the same where it lies on one.
    pub fn ends(&self) -> [usize; 2] {
        [self.below, self.below + usize::from(self.share != 0.0)]
    }

    /// The rings it rests on, and their parts.
    pub fn parts(&self) -> impl Iterator<Item = (usize, f32)> {
        let both = [(self.below, 1.0 - self.share), (self.below + 1, self.share)];
        both.into_iter().take(if self.share == 0.0 { 1 } else { 2 })
    }
}

/// The node of every distance.
pub fn nodes(rings: &Rings) -> Vec<Node> {
    let middle = rings.means(&rings.distances_mm);
    let last = middle.len() - 1;
    let node = |r: f64| {
        if r == 0.0 || last < 2 {
            return Node { below: if r == 0.0 { 0 } else { last.min(1) }, share: 0.0 };
        }
        let above = middle.partition_point(|middle| *middle <= r).clamp(2, last);
        let below = above - 1;
        Node { below, share: ((r - middle[below]) / (middle[above] - middle[below])) as f32 }
    };
    rings.distances_mm.iter().map(|r| node(*r)).collect()
}

/// Mean response per distance; if `smooth`, on a smooth curve beyond the lit texel. Where it sinks into its own noise
/// it goes on falling as before.
pub fn global_profile(rings: &Rings, survey: &Survey, smooth: bool) -> Vec<f32> {
    let distances = rings.distances_mm.len();
    let mut global = vec![0.0; distances];
    let mut spread = vec![0.0; distances];
    let mut sure: Vec<usize> = Vec::new();
    for (distance, global) in global.iter_mut().enumerate() {
        let count = survey.counts[distance] as f64;
        let mean = survey.sums[distance] / count.max(1.0);
        let variance = (survey.squares[distance] / count.max(1.0) - mean * mean).max(0.0) / count.max(1.0);
        if mean > SURE * variance.sqrt() && mean > 0.0 {
            sure.push(distance);
            *global = mean;
            spread[distance] = variance.sqrt() / mean;
        }
    }
    if smooth {
        let pitch = rings.distances_mm.get(1).copied().unwrap_or(1.0);
        let known: Vec<usize> = sure.iter().copied().filter(|distance| *distance > 0).collect();
        let points: Vec<[f64; 3]> = known
            .iter()
            .map(|&d| [rings.distances_mm[d] / pitch, libm::log(global[d]), libm::hypot(spread[d], SPREAD).powi(-1)])
            .collect();
        if let Some(curve) = smoothed(&points) {
            known.iter().zip(curve).for_each(|(distance, log)| global[*distance] = libm::exp(log));
        }
    }
    let r = |distance: usize| rings.distances_mm[distance];
    for distance in 0..distances {
        if global[distance] > 0.0 {
            continue;
        }
        // The nearest sure ones on both sides, else the last two.
        let after = sure.partition_point(|known| *known < distance);
        let (a, b) = match (after.checked_sub(1).map(|i| sure[i]), sure.get(after)) {
            (Some(a), Some(&b)) => (a, b),
            (Some(b), None) => (after.checked_sub(8).map_or(sure[0], |i| sure[i]), b),
            (None, Some(&b)) => (b, b),
            (None, None) => {
                global[distance] = f64::from(f32::MIN_POSITIVE).sqrt();
                continue;
            }
        };
        let slope = if a == b { 0.0 } else { libm::log(global[b] / global[a]) / (r(b) - r(a)) };
        let slope = if distance > b { slope.min(0.0) } else { slope };
        global[distance] = global[b] * libm::exp(slope * (r(distance) - r(b)));
    }
    let most = global.iter().copied().fold(0.0, f64::max);
    global.iter().map(|g| g.max(1e-12 * most) as f32).collect()
}

/// The sum of [`FUNCTIONS`] nearest to points (r, value, weight), at each of them; `None` if there are too few.
fn smoothed(points: &[[f64; 3]]) -> Option<Vec<f64>> {
    if points.len() < DISTANCES_EACH * FUNCTIONS.len() {
        return None;
    }
    let weighted = |value: &dyn Fn(&[f64; 3]) -> f64| points.iter().map(|p| value(p) * p[2]).collect::<Vec<f64>>();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let less = |a: &mut [f64], factor: f64, b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a -= factor * b);
    let mut rest = weighted(&|point| point[1]);
    // Gram and Schmidt's orthogonal functions, one after the other.
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for function in FUNCTIONS {
        let mut vector = weighted(&|point| function(point[0]));
        let size = dot(&vector, &vector).sqrt();
        // Twice, because once leaves rounding.
        for _ in 0..2 {
            for known in &basis {
                let part = dot(&vector, known);
                less(&mut vector, part, known);
            }
        }
        let left = dot(&vector, &vector).sqrt();
        if left > DEPENDENT * size {
            vector.iter_mut().for_each(|value| *value /= left);
            let part = dot(&rest, &vector);
            less(&mut rest, part, &vector);
            basis.push(vector);
        }
    }
    Some(points.iter().zip(rest).map(|(point, rest)| point[1] - rest / point[2]).collect())
}

/// Corrections of ln g at every distance, from Σ weight·residual and Σ weight there, less what q at the rings follows;
/// and their root mean square by weight.
pub fn correction(nodes: &[Node], rings: usize, sums: &[[f64; 2]]) -> (Vec<f64>, f64) {
    let missed: Vec<f64> = sums.iter().map(|[residual, weight]| residual / (weight + 1.0)).collect();
    // Least squares of lines between rings: a tridiagonal system.
    let (mut diagonal, mut beside, mut right) = (vec![0.0; rings], vec![0.0; rings], vec![0.0; rings]);
    let most = sums.iter().map(|sums| sums[1]).fold(0.0, f64::max);
    for ((node, missed), [_, weight]) in nodes.iter().zip(&missed).zip(sums) {
        for (ring, part) in node.parts() {
            let part = f64::from(part);
            diagonal[ring] += weight * part * part;
            right[ring] += weight * part * missed;
        }
        beside[node.below] += weight * f64::from(node.share) * f64::from(1.0 - node.share);
    }
    diagonal.iter_mut().for_each(|value| *value += 1e-9 * most + f64::MIN_POSITIVE);
    for ring in 1..rings {
        let factor = beside[ring - 1] / diagonal[ring - 1];
        diagonal[ring] -= factor * beside[ring - 1];
        right[ring] -= factor * right[ring - 1];
    }
    for ring in (0..rings).rev() {
        let above = if ring + 1 < rings { beside[ring] * right[ring + 1] } else { 0.0 };
        right[ring] = (right[ring] - above) / diagonal[ring];
    }
    let line = |node: &Node| node.parts().map(|(ring, part)| f64::from(part) * right[ring]).sum::<f64>();
    let off: Vec<f64> = nodes
        .iter()
        .zip(missed)
        .map(|(node, missed)| (missed - line(node)).clamp(-LONGEST_CORRECTION, LONGEST_CORRECTION))
        .collect();
    let total: f64 = sums.iter().map(|sums| sums[1]).sum();
    let square: f64 = off.iter().zip(sums).map(|(off, sums)| off * off * sums[1]).sum();
    (off, (square / total.max(f64::MIN_POSITIVE)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_lead_through_the_rings() {
        let rings = Rings::new(9, 9, 0.1);
        let (nodes, middle) = (nodes(&rings), rings.means(&rings.distances_mm));
        assert_eq!(nodes[0], Node { below: 0, share: 0.0 });
        for (node, r) in nodes.iter().zip(&rings.distances_mm).skip(1) {
            let along: f64 = node.parts().map(|(ring, part)| f64::from(part) * middle[ring]).sum();
            assert!((along - r).abs() < 1e-6 && node.below > 0, "{node:?} for {r}");
        }
        for few in [1, 3] {
            let rings = Rings::new(few, few, 0.1);
            assert!(super::nodes(&rings).iter().all(|node| node.below < rings.len() && node.share == 0.0));
        }
    }

    #[test]
    fn smooth_curves_stay_and_jumps_go() {
        let at = |jump: f64| {
            let r = (4..60).map(|i| 0.25 * f64::from(i));
            let points: Vec<[f64; 3]> = r.map(|r| [r, -0.7 * r - 1.2 * r.ln() + jump * (7.0 * r).sin(), 1.0]).collect();
            let curve = smoothed(&points).unwrap();
            let off = points.iter().zip(curve).map(|(p, c)| (c + 0.7 * p[0] + 1.2 * p[0].ln()).powi(2));
            (off.sum::<f64>() / points.len() as f64).sqrt()
        };
        // Of a wave of 0.35, root mean square, less than half is left.
        assert!(at(0.0) < 1e-9 && at(0.5) < 0.17, "{} {}", at(0.0), at(0.5));
        assert!(smoothed(&[[1.0, 1.0, 1.0]]).is_none());
    }

    /// What lines between rings follow is left to them; what jumps between two distances of a ring is corrected.
    #[test]
    fn corrections_leave_lines_to_the_rings() {
        let rings = Rings::new(15, 15, 0.1);
        let nodes = nodes(&rings);
        let of = |value: &dyn Fn(usize) -> f64| {
            let sums: Vec<[f64; 2]> = (0..nodes.len()).map(|d| [1e6 * value(d), 1e6]).collect();
            correction(&nodes, rings.len(), &sums)
        };
        let (_, line) = of(&|d| 0.1 + 0.3 * rings.distances_mm[d]);
        let (off, jump) = of(&|d| if d == 12 { 0.1 } else { 0.0 });
        assert!(line < 1e-6 && jump > 1e-3 && off[12] > 0.02, "{line} {jump} {off:?}");
    }
}
