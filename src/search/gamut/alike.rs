//! Whether what was found will do: by eye, or at least without a warning.

use super::{super::SearchTarget, place_of};
use crate::{colour::lightness, optics::FrequencyGrid};

/// A stacking looks like a target where its albedo is within this of the target's, and its half-energy radius within
/// that, as shares: both are below what an eye sees.
const ALIKE: [f64; 2] = [0.02, 0.1];

/// Where a target is black, or wider than can be told, its spectrum is met this closely.
const BLACK: f64 = 1e-3;

/// Albedos that differ by less, and by less in lightness L*, look much alike: wider than [`ALIKE`], as one does not warn
/// of all that an eye sees side by side. Of 0.03 and 0.06 the albedos differ by little, but eyes tell them from afar.
const MUCH_ALIKE: f64 = 0.05;
const MUCH_AS_LIGHT: f64 = 5.0;

impl SearchTarget {
    /// Whether what reflects `found`, R̂ per channel on `grid`, looks like this target in every channel.
    pub fn looks_like(&self, found: &[Vec<f64>], grid: &FrequencyGrid) -> bool {
        let alike = |(asked, found): (&Vec<f64>, &Vec<f64>)| match (place_of(asked, grid), place_of(found, grid)) {
            (Some(asked), Some(found)) => (0..2).all(|axis| (found[axis] / asked[axis] - 1.0).abs() <= ALIKE[axis]),
            // Black, or wider than can be told.
            (None, _) => asked.iter().zip(found).all(|(asked, found)| (asked - found).abs() <= BLACK),
            _ => false,
        };
        self.channels.len() == found.len() && self.channels.iter().zip(found).all(alike)
    }
}

/// A channel returning less shows no glow that anyone sees; a guess.
pub const GLOWS: f64 = 0.01;
/// What is closer together is one to an eye that reads, mm: an arc minute from 30 cm.
const SEEN_MM: f64 = 0.1;

impl SearchTarget {
    /// The half-energy radii asked for and found, mm, of the channel in which they are farthest apart, where that is far
    /// enough for a warning ([`far_glow`]); `found` is R̂ per channel on `grid`.
    pub fn far_radius(&self, found: &[Vec<f64>], grid: &FrequencyGrid) -> Option<[f64; 2]> {
        let radii = |(asked, found): (&Vec<f64>, &Vec<f64>)| {
            let [[asked, asked_mm], [found, found_mm]] = [place_of(asked, grid)?, place_of(found, grid)?];
            (asked.min(found) > GLOWS && (asked_mm - found_mm).abs() > SEEN_MM).then_some([asked_mm, found_mm])
        };
        far_glow(self.channels.iter().zip(found).filter_map(radii))
    }
}

/// Of albedos asked for and found, the two that are farthest apart if that is far enough for a warning: more than 0.05,
/// or 5 in L*.
pub fn far_miss(albedos: impl Iterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
    let gap = |[asked, found]: &[f64; 2]| {
        let lighter = lightness(*asked) - lightness(*found);
        ((asked - found).abs() / MUCH_ALIKE).max(lighter.abs() / MUCH_AS_LIGHT)
    };
    albedos.filter(|pair| gap(pair) > 1.0).max_by(|a, b| gap(a).total_cmp(&gap(b)))
}

/// Glows that differ by no more than this factor in width look much alike; a guess.
const MUCH_WIDER: f64 = 1.5;

/// Of widths of a glow asked for and found, mm, the two that are farthest apart by their ratio if that is far enough
/// for a warning: more than 1.5.
pub fn far_glow(widths_mm: impl Iterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
    let ratio = |[asked, found]: &[f64; 2]| (asked / found).max(found / asked);
    widths_mm.filter(|pair| ratio(pair) > MUCH_WIDER).max_by(|a, b| ratio(a).total_cmp(&ratio(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a profile like exp(−r/`width_mm`)/r reflects, R̂(0) = `albedo`.
    fn spectrum(albedo: f64, width_mm: f64, grid: &FrequencyGrid) -> Vec<f64> {
        grid.as_slice().iter().map(|k| albedo / (k * width_mm).hypot(1.0)).collect()
    }

    #[test]
    fn targets_look_like_what_is_near_them_in_albedo_and_width() {
        let grid = FrequencyGrid::default();
        let found = |albedo, width| spectrum(albedo, width, &grid);
        let target = SearchTarget { channels: vec![found(0.5, 1.0)] };
        for (albedo, width, alike) in [
            (0.5, 1.0, true),
            (0.509, 1.08, true),
            (0.491, 0.92, true),
            (0.511, 1.0, false),
            (0.489, 1.0, false),
            (0.5, 1.2, false),
            (0.5, 0.8, false),
            (0.0, 1.0, false),
        ] {
            assert_eq!(target.looks_like(&[found(albedo, width)], &grid), alike, "{albedo}, {width} mm");
        }
        assert!(!target.looks_like(&[found(0.5, 1.0), found(0.5, 1.0)], &grid));
        let two = SearchTarget { channels: vec![found(0.5, 1.0), found(0.2, 1.0)] };
        assert!(two.looks_like(&[found(0.5, 1.0), found(0.2, 1.0)], &grid));
        assert!(!two.looks_like(&[found(0.5, 1.0), found(0.3, 1.0)], &grid));
    }

    #[test]
    fn black_is_met_by_black() {
        let grid = FrequencyGrid::default();
        let black = SearchTarget { channels: vec![vec![0.0; grid.len()]] };
        assert!(black.looks_like(&[vec![0.0; grid.len()]], &grid));
        assert!(black.looks_like(&[spectrum(0.0009, 1.0, &grid)], &grid));
        assert!(!black.looks_like(&[spectrum(0.0011, 1.0, &grid)], &grid));
    }

    #[test]
    fn glows_are_told_by_the_radius_of_half_their_light() {
        let grid = FrequencyGrid::default();
        let found = |albedo, width| spectrum(albedo, width, &grid);
        let target = SearchTarget { channels: vec![found(0.5, 1.0), found(0.2, 1.0)] };
        assert_eq!(target.far_radius(&[found(0.3, 1.4), found(0.2, 0.7)], &grid), None);
        let [asked, narrower] = target.far_radius(&[found(0.5, 1.4), found(0.2, 0.5)], &grid).unwrap();
        assert!((asked / narrower - 2.0).abs() < 0.1, "{asked}, {narrower}");
        // No eye sees a tenth of a millimetre.
        let fine = SearchTarget { channels: vec![found(0.5, 0.1)] };
        assert_eq!(fine.far_radius(&[found(0.5, 0.2)], &grid), None);
        // Of black nothing glows.
        assert_eq!(target.far_radius(&[found(0.5, 1.0), found(0.005, 0.1)], &grid), None);
    }

    #[test]
    fn the_farthest_miss_is_told() {
        assert_eq!(far_miss([[0.5, 0.54], [0.3, 0.1], [0.2, 0.3]].into_iter()), Some([0.3, 0.1]));
        assert_eq!(far_miss([[0.5, 0.54], [0.2, 0.24], [0.031, 0.04]].into_iter()), None);
        // Black that no resin is: 0.025 apart, but 8 in lightness.
        assert_eq!(far_miss([[0.5, 0.54], [0.031, 0.056]].into_iter()), Some([0.031, 0.056]));
        assert_eq!(far_miss(std::iter::empty()), None);
        assert_eq!(far_miss([[f64::NAN, 0.5], [0.5, 0.6]].into_iter()), Some([0.5, 0.6]));
        assert_eq!(far_glow([[1.0, 1.6], [2.0, 0.9], [1.0, 1.4]].into_iter()), Some([2.0, 0.9]));
        assert_eq!(far_glow([[1.0, 1.4], [2.0, 1.4]].into_iter()), None);
    }
}
