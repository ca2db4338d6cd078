//! In which order the targets of an object are answered: each from the answer to one that is like it.
//!
//! Targets are points of the lightness and of the logarithm of the width in every channel; answers travel along their
//! minimum spanning tree (Prim 1957), from the target in the middle outwards.

use super::PartTarget;
use crate::colour::lightness;

/// Where a target lies among the others.
type Place = Vec<f64>;

/// A part of half this thickness looks endless.
const THICK_MM: f64 = 10.0;

/// L*/100 of the albedo and a tenth of the logarithm of the width per channel, and of the half thickness.
fn place(target: &PartTarget) -> Place {
    let channels = target.target.channels.iter().flat_map(|spectrum| {
        let albedo = spectrum.first().copied().unwrap_or(0.0);
        // Where R̂ has fallen to a half, in steps.
        let below = spectrum.iter().position(|value| *value < 0.5 * albedo);
        let steps = match below {
            Some(at) if at > 0 => {
                let (over, under) = (spectrum[at - 1], spectrum[at]);
                at as f64 - 1.0 + (over - 0.5 * albedo) / (over - under)
            }
            _ => spectrum.len() as f64,
        };
        [lightness(albedo.max(0.0)) / 100.0, 0.1 * libm::log(steps.max(1e-3))]
    });
    let half_mm = target.half_thickness_mm.unwrap_or(THICK_MM).clamp(1e-3, THICK_MM);
    channels.chain([0.1 * libm::log(half_mm)]).collect()
}

fn square(a: &Place, b: &Place) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The targets as points.
pub(super) struct Places(Vec<Place>);

/// Where answers come from: targets in groups, each with the one that is answered before it.
pub(super) type Levels = Vec<Vec<(usize, usize)>>;

impl Places {
    pub fn new(targets: &[PartTarget]) -> Self {
        Self(targets.iter().map(place).collect())
    }

    /// The target next to the mean of all.
    pub fn middle(&self) -> usize {
        let count = self.0.len() as f64;
        let dimensions = self.0.first().map_or(0, Vec::len);
        let mean: Place = (0..dimensions).map(|i| self.0.iter().map(|place| place[i]).sum::<f64>() / count).collect();
        let nearest =
            (0..self.0.len()).min_by(|&a, &b| square(&self.0[a], &mean).total_cmp(&square(&self.0[b], &mean)));
        nearest.unwrap_or(0)
    }

    /// `count` targets far from each other, the middle one first.
    pub fn spread(&self, count: usize) -> Vec<usize> {
        let mut chosen = vec![self.middle()];
        let mut far: Vec<f64> = self.0.iter().map(|place| square(place, &self.0[chosen[0]])).collect();
        while chosen.len() < count.min(self.0.len()) {
            let next = (0..far.len()).fold(0, |best, i| if far[i] > far[best] { i } else { best });
            if far[next] <= 0.0 {
                break;
            }
            chosen.push(next);
            for (far, place) in far.iter_mut().zip(&self.0) {
                *far = far.min(square(place, &self.0[next]));
            }
        }
        chosen
    }

    /// The tree from `root` outwards, level after level.
    pub fn levels(&self, root: usize) -> Levels {
        let count = self.0.len();
        let mut near: Vec<(f64, usize)> = self.0.iter().map(|place| (square(place, &self.0[root]), root)).collect();
        let (mut level, mut done) = (vec![0; count], vec![false; count]);
        done[root] = true;
        let mut levels: Levels = Vec::new();
        for _ in 1..count {
            let open = (0..count).filter(|&i| !done[i]);
            let Some(next) = open.min_by(|&a, &b| near[a].0.total_cmp(&near[b].0)) else { break };
            let parent = near[next].1;
            done[next] = true;
            level[next] = level[parent] + 1;
            if levels.len() < level[next] {
                levels.push(Vec::new());
            }
            levels[level[next] - 1].push((next, parent));
            for (i, near) in near.iter_mut().enumerate().filter(|(i, _)| !done[*i]) {
                let distance = square(&self.0[i], &self.0[next]);
                if distance < near.0 {
                    *near = (distance, next);
                }
            }
        }
        levels
    }

    /// The `count` targets that are most like one.
    pub fn neighbours(&self, of: usize, count: usize) -> Vec<usize> {
        let mut others: Vec<(f64, usize)> =
            (0..self.0.len()).filter(|&i| i != of).map(|i| (square(&self.0[i], &self.0[of]), i)).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        others.into_iter().map(|(_, i)| i).take(count).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::SearchTarget;

    fn target(albedo: f64, width: f64, half_thickness_mm: Option<f64>) -> PartTarget {
        let spectrum = (0..128).map(|i| albedo / (1.0 + (f64::from(i) * width).powi(2))).collect();
        PartTarget { target: SearchTarget { channels: vec![spectrum] }, half_thickness_mm }
    }

    #[test]
    fn every_target_has_one_like_it_before_it() {
        let targets: Vec<_> = (0..40)
            .map(|i| target(0.1 + 0.01 * f64::from(i * 7 % 40), 0.05 + 0.01 * f64::from(i % 3), None))
            .chain([target(0.3, 0.06, Some(0.4))])
            .collect();
        let places = Places::new(&targets);
        let root = places.middle();
        let levels = places.levels(root);
        let mut done = vec![root];
        for level in &levels {
            assert!(level.iter().all(|(_, parent)| done.contains(parent)));
            done.extend(level.iter().map(|(target, _)| *target));
        }
        done.sort_unstable();
        assert_eq!(done, (0..41).collect::<Vec<_>>());
        let spread = places.spread(5);
        assert!(spread.len() == 5 && spread.contains(&40), "{spread:?}");
        // The nearest are the nearest in lightness.
        let nearest = places.neighbours(0, 2);
        assert!(nearest.iter().all(|&i| square(&places.0[i], &places.0[0]) <= square(&places.0[1], &places.0[0])));
    }
}
