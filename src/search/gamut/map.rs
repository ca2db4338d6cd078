//! Targets moved into a gamut, smoothly and in order, where a search would clip each one on its own.
//!
//! A profile keeps its shape and is scaled: R'(r) = a/s² R(r/s), hence R̂'(k) = a R̂(sk): albedo times a, every radius
//! times s.
//!
//! 1. **Albedo.** v, the albedo over the ceiling, in colour of the channel where that is greatest, becomes v' = G(v),
//!    and a = v'/v is common to all channels: hue is kept. G is the identity well inside and bends towards the ceiling
//!    and the floor so that the brightest and the darkest target just reach them.
//! 2. **Width.** At the new albedo the gamut spans certain radii; ln r is bent in the same way towards their ends, and
//!    s = r'/r. In colour s is common too: the greatest widening and the greatest narrowing that a channel asks for,
//!    multiplied.
//!
//! With one channel, of two targets the brighter stays the brighter, and of two equally bright ones the wider stays the
//! wider: distinct targets stay distinct as far as the gamut has room. It has none at its tips, where only one stacking
//! is; so where a target is brighter than the ceiling or darker than the floor, these are not simply the brightest and
//! the darkest that can be reached: of those that leave some room for widths they are the ones that move albedos least,
//! by the weighted mean of (Δ ln albedo)². Widths never cost light: where the albedos of all targets are reached, they
//! stay, as the search meets an albedo before a width. Targets that are all inside are not moved at all.
//!
//! A gamut is that of pure layers; mixtures reach farther, above all to narrow dark glows. How far is known only where
//! it was tried: at the targets, by the search itself ([`GamutMap::with_mixtures`]).

use super::{Boundary, ChannelGamut, Gamut, place_of};
use crate::{
    numeric::rounding::rounded,
    optics::{FrequencyGrid, InverseHankel},
    search::SearchTarget,
};

/// Where the targets of a set go.
#[derive(Debug, Clone, PartialEq)]
pub struct GamutMap {
    /// One per target.
    pub moves: Vec<Move>,
}

/// What happens to a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// a, the factor of its albedo.
    pub albedo_factor: f64,
    /// s, the factor of its width.
    pub width_factor: f64,
    /// Albedo and half-energy radius in mm before, per channel; `None` for a channel without light, or as wide as the
    /// grid cannot tell.
    pub from: Vec<Option<[f64; 2]>>,
    /// Where it lay before.
    pub lies: Lies,
}

/// Where a target lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lies {
    /// Inside what layers of one resin each reach, in every channel.
    Inside,
    /// Outside of that, but a stacking with mixtures looks like it.
    Mixed,
    /// Outside of all that is known to be reached.
    Outside,
}

/// Ceilings and floors that are tried, and how far into the range of albedos they go.
const TRIED: usize = 16;
const CEILING_REACH: f64 = 0.5;
const FLOOR_REACH: f64 = 0.25;
/// A side of the gamut bends at least over this share of its extent, where something lies beyond it, and at most over
/// that one.
const LEAST_BEND: f64 = 0.2;
const MOST_BEND: f64 = 0.5;
/// What the logarithms of the radii are to span at the ceiling and at the floor, if the targets' do.
const LEAST_ROOM: f64 = 0.1;
/// Changes of a logarithm below this are none.
const MOVED: f64 = 1e-3;

impl Move {
    /// Whether what the target asked for is reached as it was.
    pub fn reached(&self) -> bool {
        self.lies != Lies::Outside
    }

    /// Whether the target changes by more than a thousandth.
    pub fn moves(&self) -> bool {
        libm::log(self.albedo_factor).abs() > MOVED || libm::log(self.width_factor).abs() > MOVED
    }

    /// The target's spectra, moved: R̂'(k) = a R̂(sk).
    pub fn apply(&self, target: &SearchTarget, grid: &FrequencyGrid) -> SearchTarget {
        if !self.moves() {
            return target.clone();
        }
        let channel = |spectrum: &Vec<f64>| {
            let light = InverseHankel::new(spectrum, grid);
            grid.as_slice().iter().map(|k| self.albedo_factor * light.value(self.width_factor * k)).collect()
        };
        SearchTarget { channels: target.channels.iter().map(channel).collect() }
    }
}

impl GamutMap {
    /// The map for `targets`, each counting `weights[target]` ≥ 0 times, on the grid of the gamut's resins.
    pub fn new(gamut: &Gamut, targets: &[SearchTarget], weights: &[f64], grid: &FrequencyGrid) -> Self {
        let places = places_of(targets, grid);
        let lies = places.iter().map(|place| gamut.lies(place)).collect();
        Self::bent(gamut, places, lies, weights)
    }

    /// The same where stackings may have mixtures: `found[target]` is what the best of them reflects, R̂ per channel.
    /// What looks like its target is reached, and the gamut is as wide as all that was found.
    pub fn with_mixtures(
        gamut: &Gamut,
        found: &[&[Vec<f64>]],
        targets: &[SearchTarget],
        weights: &[f64],
        grid: &FrequencyGrid,
    ) -> Self {
        let places = places_of(targets, grid);
        let lies = places.iter().zip(targets).zip(found).map(|((place, target), found)| match gamut.lies(place) {
            Lies::Outside if target.looks_like(found, grid) => Lies::Mixed,
            lies => lies,
        });
        let lies = lies.collect();
        Self::bent(&gamut.widened(found, grid), places, lies, weights)
    }

    fn bent(gamut: &Gamut, places: Vec<Place>, lies: Vec<Lies>, weights: &[f64]) -> Self {
        let factors = if lies.iter().all(|lies| *lies != Lies::Outside) {
            vec![[1.0, 1.0]; places.len()]
        } else {
            let tries = (0..TRIED).flat_map(|ceiling| (0..TRIED).map(move |floor| [ceiling, floor]));
            let tries = tries.map(|tried| {
                let [ceiling, floor] = tried.map(|n| n as f64 / (TRIED - 1) as f64);
                let bend = Bend::new(gamut, &places, 1.0 - CEILING_REACH * ceiling, FLOOR_REACH * floor);
                let factors: Vec<[f64; 2]> = places.iter().map(|place| bend.factors(place)).collect();
                let cost = factors.iter().zip(weights).map(|([a, _], weight)| weight * libm::log(*a).powi(2));
                ((bend.lacking_room(), cost.sum::<f64>()), factors)
            });
            // The first of equals: the highest ceiling.
            tries
                .reduce(|best, next| if next.0 < best.0 { next } else { best })
                .map(|(_, factors)| factors)
                .unwrap_or_default()
        };
        let moves = places.into_iter().zip(factors).zip(lies).map(|((from, factors), lies)| {
            let [albedo_factor, width_factor] = factors.map(rounded);
            Move { albedo_factor, width_factor, from, lies }
        });
        Self { moves: moves.collect() }
    }

    /// Targets that change.
    pub fn moved(&self) -> usize {
        self.moves.iter().filter(|moved| moved.moves()).count()
    }
}

/// Albedo and half-energy radius in mm, per channel.
type Place = Vec<Option<[f64; 2]>>;

fn places_of(targets: &[SearchTarget], grid: &FrequencyGrid) -> Vec<Place> {
    targets.iter().map(|target| target.channels.iter().map(|spectrum| place_of(spectrum, grid)).collect()).collect()
}

impl Gamut {
    fn lies(&self, place: &[Option<[f64; 2]>]) -> Lies {
        let mut channels = place.iter().zip(&self.channels);
        let inside = channels.all(|(place, channel)| place.is_some_and(|place| channel.boundary.contains(place)));
        if inside { Lies::Inside } else { Lies::Outside }
    }

    /// Around what stackings `found` reflect too, R̂ per channel on `grid`.
    fn widened(&self, found: &[&[Vec<f64>]], grid: &FrequencyGrid) -> Self {
        let wider = |(n, channel): (usize, &ChannelGamut)| {
            let known = channel.points.iter().map(|point| [point.albedo, point.half_energy_radius_mm]);
            let more = found.iter().filter_map(|found| place_of(found.get(n)?, grid));
            let boundary = Boundary::around(&known.chain(more).collect::<Vec<_>>());
            ChannelGamut { boundary: boundary.unwrap_or_else(|| channel.boundary.clone()), ..channel.clone() }
        };
        Self { channels: self.channels.iter().enumerate().map(wider).collect() }
    }
}

/// The map of one ceiling and one floor.
struct Bend<'a> {
    gamut: &'a Gamut,
    /// Albedo of every channel at v = 1.
    ceiling: Vec<f64>,
    /// Albedo of every channel below which nothing is left.
    floor: Vec<f64>,
    albedo: SoftClip,
    /// ln of the least and greatest radius of all targets, per channel.
    ln_radius: Vec<[f64; 2]>,
}

impl<'a> Bend<'a> {
    /// `ceiling` and `floor` are shares of the way from the least albedo to the greatest.
    fn new(gamut: &'a Gamut, places: &[Place], ceiling: f64, floor: f64) -> Self {
        let level = |share: f64| -> Vec<f64> {
            let range = gamut.channels.iter().map(|channel| channel.boundary.albedo());
            range.map(|[least, greatest]| least + share * (greatest - least)).collect()
        };
        let (ceiling, floor) = (level(ceiling), level(floor));
        let lowest = floor.iter().zip(&ceiling).map(|(floor, ceiling)| floor / ceiling).fold(0.0, f64::max);
        let brightness = places.iter().filter_map(|place| brightness(place, &ceiling));
        let (dark, bright) = brightness.fold((1.0_f64, 0.0_f64), |(d, b), v| (d.min(v), b.max(v)));
        let ln_radius = (0..ceiling.len()).map(|channel| {
            let radii = places.iter().filter_map(|place| place[channel]).map(|place| libm::log(place[1]));
            radii.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], r| [low.min(r), high.max(r)])
        });
        Self {
            gamut,
            ln_radius: ln_radius.collect(),
            albedo: SoftClip::new([lowest.min(1.0), 1.0], [dark, bright]),
            ceiling,
            floor,
        }
    }

    /// By how much the logarithms of the radii span less than they should at the albedos that the brightest and the
    /// darkest targets are brought to.
    fn lacking_room(&self) -> f64 {
        let brought = [(self.albedo.high, &self.ceiling), (self.albedo.low, &self.floor)];
        let ends = brought.into_iter().filter_map(|(side, albedos)| side.map(|_| albedos));
        let channels = |albedos: &Vec<f64>| {
            let each = albedos.iter().zip(&self.gamut.channels).zip(&self.ln_radius);
            let lacking = each.map(|((albedo, channel), [least, most])| {
                let [narrow, wide] = channel.boundary.radius_mm(*albedo);
                (most - least).min(LEAST_ROOM) - libm::log(wide / narrow)
            });
            lacking.fold(0.0, f64::max)
        };
        ends.map(channels).fold(0.0, f64::max)
    }

    /// a and s of a target.
    fn factors(&self, place: &[Option<[f64; 2]>]) -> [f64; 2] {
        let Some(v) = brightness(place, &self.ceiling) else { return [1.0, 1.0] };
        let a = self.albedo.at(v) / v;
        let (mut widen, mut narrow) = (0.0_f64, 0.0_f64);
        for ((place, channel), range) in place.iter().zip(&self.gamut.channels).zip(&self.ln_radius) {
            let Some([albedo, radius]) = place else { continue };
            let limits = channel.boundary.radius_mm(a * albedo).map(libm::log);
            let change = SoftClip::new(limits, *range).at(libm::log(*radius)) - libm::log(*radius);
            (widen, narrow) = (widen.max(change), narrow.min(change));
        }
        [a, libm::exp(widen + narrow)]
    }
}

/// v of a target: the greatest albedo over the ceiling of its channel; `None` without light.
fn brightness(place: &[Option<[f64; 2]>], ceiling: &[f64]) -> Option<f64> {
    let channels = place.iter().zip(ceiling).filter_map(|(place, ceiling)| Some(place.as_ref()?[0] / ceiling));
    channels.reduce(f64::max).filter(|v| *v > 0.0)
}

/// A function that bends [least, greatest] of the data into [low, high]: the identity in between, where the data exceed
/// a side y/(1 + y(1/Y − 1/X)) of the distance y from a knee, which has slope 1 at the knee and takes X, the farthest,
/// to Y, the limit.
#[derive(Debug, Clone, Copy)]
struct SoftClip {
    low: Option<Side>,
    high: Option<Side>,
}

#[derive(Debug, Clone, Copy)]
struct Side {
    knee: f64,
    room: f64,
    reach: f64,
}

impl SoftClip {
    fn new([low, high]: [f64; 2], [least, greatest]: [f64; 2]) -> Self {
        let extent = high - low;
        // So long that the slope at the end is a quarter or more, where there is room for it.
        let side = |limit: f64, beyond: f64| {
            (beyond > 0.0).then(|| {
                let room = beyond.clamp(LEAST_BEND * extent, MOST_BEND * extent);
                (limit, room, room + beyond)
            })
        };
        Self {
            low: side(low, low - least).map(|(low, room, reach)| Side { knee: low + room, room, reach }),
            high: side(high, greatest - high).map(|(high, room, reach)| Side { knee: high - room, room, reach }),
        }
    }

    fn at(&self, x: f64) -> f64 {
        match (self.low, self.high) {
            (Some(side), _) if x < side.knee => side.knee - side.bent(side.knee - x),
            (_, Some(side)) if x > side.knee => side.knee + side.bent(x - side.knee),
            _ => x,
        }
    }
}

impl Side {
    fn bent(&self, y: f64) -> f64 {
        if self.room == 0.0 { 0.0 } else { y / (1.0 + y * (1.0 / self.room - 1.0 / self.reach)) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn bending_keeps_order_and_limits(
            low in -2.0..0.0f64,
            extent in 0.0..3.0f64,
            least in -5.0..0.0f64,
            greatest in 0.0..5.0f64,
        ) {
            let high = low + extent;
            let clip = SoftClip::new([low, high], [least, greatest]);
            let at = |n: usize| least + (greatest - least) * n as f64 / 400.0;
            let mut last = f64::NEG_INFINITY;
            for n in 0..=400 {
                let y = clip.at(at(n));
                prop_assert!(y > last || extent < 1e-6, "{y} after {last} at {}", at(n));
                prop_assert!(y >= low - 1e-9 && y <= high + 1e-9, "{y} at {}", at(n));
                last = y;
            }
            // No jump at the knees and slope 1 there, where there is room to bend at all.
            for knee in [clip.low, clip.high].into_iter().flatten().map(|side| side.knee) {
                let slope = clip.at(knee + 1e-7) - clip.at(knee - 1e-7);
                prop_assert!((slope - 2e-7).abs() < 1e-10 || extent < 1e-3);
            }
        }
    }

    #[test]
    fn what_is_inside_stays() {
        let clip = SoftClip::new([0.0, 1.0], [0.1, 0.9]);
        assert_eq!([0.1, 0.5, 0.9].map(|x| clip.at(x)), [0.1, 0.5, 0.9]);
        // Far inside also where others are beyond.
        assert_eq!(SoftClip::new([0.0, 1.0], [0.1, 1.1]).at(0.7), 0.7);
    }
}
