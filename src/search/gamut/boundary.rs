//! The outline of a gamut: the least and the greatest half-energy radius at every albedo.
//!
//! Between the two everything is taken as reached: thicknesses change in steps so fine that the plane is covered.

use serde::{Deserialize, Serialize};

/// Both outlines, by ascending albedo, from the least albedo of all to the greatest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Boundary {
    narrow: Vec<[f64; 2]>,
    wide: Vec<[f64; 2]>,
}

/// Columns of albedo that each give a point of either outline.
const COLUMNS: usize = 36;

impl Boundary {
    /// Around places of (albedo, half-energy radius in mm); `None` without any.
    pub fn around(places: &[[f64; 2]]) -> Option<Self> {
        let by_albedo = |a: &&[f64; 2], b: &&[f64; 2]| a[0].total_cmp(&b[0]);
        let (first, last) = (*places.iter().min_by(by_albedo)?, *places.iter().max_by(by_albedo)?);
        let width = (last[0] - first[0]).max(f64::MIN_POSITIVE);
        let column = |place: &[f64; 2]| (((place[0] - first[0]) / width * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let mut extremes: Vec<Option<[[f64; 2]; 2]>> = vec![None; COLUMNS];
        for place in places {
            let [narrow, wide] = extremes[column(place)].get_or_insert([*place; 2]);
            if place[1] < narrow[1] {
                *narrow = *place;
            }
            if place[1] > wide[1] {
                *wide = *place;
            }
        }
        let outline = |side: usize| {
            let inner = extremes.iter().flatten().map(|extreme| extreme[side]);
            let inner = inner.filter(|place| place[0] > first[0] && place[0] < last[0]);
            let mut outline: Vec<[f64; 2]> = std::iter::once(first).chain(inner).collect();
            if last[0] > first[0] {
                outline.push(last);
            }
            outline
        };
        Some(Self { narrow: outline(0), wide: outline(1) })
    }

    /// (albedo, radius in mm) along the narrow side, by ascending albedo.
    pub fn narrow(&self) -> &[[f64; 2]] {
        &self.narrow
    }

    /// (albedo, radius in mm) along the wide side, by ascending albedo.
    pub fn wide(&self) -> &[[f64; 2]] {
        &self.wide
    }

    /// The outline as a polygon.
    pub fn polygon(&self) -> Vec<[f64; 2]> {
        // The ends stand on both sides.
        let back = self.narrow.iter().rev().skip(1).take(self.narrow.len().saturating_sub(2));
        self.wide.iter().chain(back).copied().collect()
    }

    /// Least and greatest albedo.
    pub fn albedo(&self) -> [f64; 2] {
        [self.narrow[0][0], self.narrow[self.narrow.len() - 1][0]]
    }

    /// Least and greatest half-energy radius at `albedo`, mm; at the nearest that is reached, where it is not.
    pub fn radius_mm(&self, albedo: f64) -> [f64; 2] {
        let [narrow, wide] = [&self.narrow, &self.wide].map(|side| interpolated(side, albedo));
        // The two are interpolated between different albedos.
        [narrow.min(wide), wide.max(narrow)]
    }

    /// Whether a place lies inside or on the outline.
    pub fn contains(&self, [albedo, radius_mm]: [f64; 2]) -> bool {
        const ROUNDING: f64 = 1e-9;
        let ([low, high], [narrow, wide]) = (self.albedo(), self.radius_mm(albedo));
        let share = 1.0 + ROUNDING;
        (low / share..=high * share).contains(&albedo) && (narrow / share..=wide * share).contains(&radius_mm)
    }
}

/// ln r as a line between the places around `albedo`.
fn interpolated(side: &[[f64; 2]], albedo: f64) -> f64 {
    let after = side.partition_point(|place| place[0] < albedo);
    if after == 0 {
        return side[0][1];
    }
    let Some(next) = side.get(after) else { return side[after - 1][1] };
    let before = side[after - 1];
    let part = (albedo - before[0]) / (next[0] - before[0]);
    libm::exp(libm::log(before[1]) + part * (libm::log(next[1]) - libm::log(before[1])))
}
