//! Which fields a coupon has.
//!
//! Every resin lies over the lightest and over the darkest of the set, in the same four thicknesses whatever it is: a
//! resin that is opaque at 0.1 mm tells of its scattering by the thickest field and of its absorption by the thinnest,
//! a clear one the other way round. So nothing needs to be known of the resins but which are light and dark.

use std::path::Path;

use super::{Coupon, Field};
use crate::measure::MeasureError;
use crate::optics::{Stack, VolumeCoefficients};
use crate::words::short;

/// A resin of a set, as its material file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedResin {
    /// Name.
    pub name: String,
    /// Colour in slices.
    pub rgba: [u8; 4],
    /// Density, g/cm³.
    pub density_g_per_cm3: f64,
    /// Whether it is what the printer fills holes with: it cannot be seen and is left out.
    pub background: bool,
    /// What is believed of it, per channel.
    pub believed: Vec<VolumeCoefficients>,
}

/// A resin of a coupon: what is taken as stated, and where its fit starts.
#[derive(Debug, Clone, PartialEq)]
pub struct CouponResin {
    /// Name.
    pub name: String,
    /// Colour in slices.
    pub rgba: [u8; 4],
    /// Density, g/cm³.
    pub density_g_per_cm3: f64,
    /// What is believed of it, per channel: n and g stay, scattering and absorption are found.
    pub believed: Vec<VolumeCoefficients>,
}

/// Thicknesses of a resin, mm, before they are rounded to slices.
const LADDER_MM: [f64; 4] = [0.1, 0.3, 0.9, 2.7];
/// Of white below a resin: what goes farther aside than this has gone through to the black below.
const WHITE_MM: f64 = 2.0;
/// Of black below all.
const FLOOR_MM: f64 = 0.5;
/// Layers of a pair, mm.
const PAIR_MM: [f64; 2] = [0.2, 0.3];
/// Fields of a row.
const COLUMNS: usize = 2 * LADDER_MM.len();
/// So many rows are laid twice.
const FEW_ROWS: usize = 4;
/// Fields nearer together than this cannot be told from their neighbours, and farther apart need no coupon.
pub(super) const SPACING_MM: std::ops::RangeInclusive<f64> = 8.0..=40.0;

impl Coupon {
    /// A coupon of the resins of a set for a printer whose slices are `slice_mm` thick.
    ///
    /// # Errors
    /// [`MeasureError::Scene`] for fewer than two resins that are printed, unlike refractive indices, and a spacing out
    /// of range.
    pub fn new(
        materials: &str,
        channels: &[String],
        resins: &[NamedResin],
        (printer, slice_mm): (&str, f64),
        spacing_mm: f64,
    ) -> Result<Self, MeasureError> {
        if !SPACING_MM.contains(&spacing_mm) {
            let (from, to) = (SPACING_MM.start(), SPACING_MM.end());
            return Err(MeasureError::scene(
                "spacing",
                format!("{} mm", short(spacing_mm)),
                format!("{from} to {to} mm"),
            ));
        }
        let printed: Vec<&NamedResin> = resins.iter().filter(|resin| !resin.background).collect();
        if printed.len() < 2 {
            let found = format!("{} resins that are printed", printed.len());
            return Err(MeasureError::scene(format!("materials {materials}"), found, "a light one and a dark one"));
        }
        // What an endless depth of it would return, by the shares of scattering in all channels.
        let light = |resin: &NamedResin| -> f64 {
            resin
                .believed
                .iter()
                .map(|volume| volume.sigma_s * (1.0 - volume.g) / (volume.sigma_a + 1e-6))
                .map(libm::log)
                .sum()
        };
        let by_light = |a: &usize, b: &usize| light(printed[*a]).total_cmp(&light(printed[*b]));
        let (Some(white), Some(dark)) = ((0..printed.len()).max_by(by_light), (0..printed.len()).min_by(by_light))
        else {
            return Err(MeasureError::scene("resins", "none", "a light one and a dark one"));
        };
        // Whole slices, without the last digits of a product.
        let rounded = |mm: f64| (mm * 1e6).round() / 1e6;
        let whole = |mm: f64| rounded((mm / slice_mm).round().max(1.0) * slice_mm);
        let height = whole(LADDER_MM[3] + WHITE_MM + FLOOR_MM);
        let ladder = LADDER_MM.map(whole);
        let down = |layers: Vec<(usize, f64)>| {
            let laid: f64 = layers.iter().map(|layer| layer.1).sum();
            Stack::joined(layers.into_iter().chain([(dark, rounded(height - laid))]))
        };
        let over_white = |resin: usize, mm: f64| down(vec![(resin, mm), (white, whole(WHITE_MM))]);
        let over_dark = |resin: usize, mm: f64| down(vec![(resin, mm)]);
        let mut rows: Vec<Vec<Stack<usize>>> = Vec::new();
        let mut row = |resin: usize| {
            let left = ladder.map(|mm| match resin == white {
                // As thick as it gets: what it absorbs shows best there.
                true => down(vec![(white, rounded(height - whole(FLOOR_MM)))]),
                false => over_white(resin, mm),
            });
            let mut right = ladder.map(|mm| over_dark(resin, mm));
            right.reverse();
            rows.push(left.into_iter().chain(right).collect());
        };
        row(white);
        let coloured: Vec<usize> = (0..printed.len()).filter(|resin| ![white, dark].contains(resin)).collect();
        coloured.iter().copied().for_each(&mut row);
        row(dark);
        if coloured.len() > 1 {
            // Each over the next, over white and over black.
            let half = |below: usize| {
                let ground = (below == white).then_some((white, whole(WHITE_MM)));
                let mut fields = Vec::new();
                for (place, &upper) in coloured.iter().enumerate().take(LADDER_MM.len()) {
                    let lower = coloured[(place + 1) % coloured.len()];
                    let pair = [(upper, whole(PAIR_MM[0])), (lower, whole(PAIR_MM[1]))];
                    fields.push(down(pair.into_iter().chain(ground).collect()));
                }
                fields.resize(LADDER_MM.len(), down(vec![(below, rounded(height - whole(FLOOR_MM)))]));
                fields
            };
            rows.push([half(white), half(dark)].concat());
        }
        // Of few resins, everything twice: what one field is off by, another is not.
        let rows = if rows.len() <= FEW_ROWS { [rows.clone(), rows].concat() } else { rows };
        let size_mm = [(COLUMNS + 2) as f64 * spacing_mm, (rows.len() + 2) as f64 * spacing_mm, height];
        let field = |(place, stack): (usize, Stack<usize>)| {
            let (column, row) = (place % COLUMNS, place / COLUMNS);
            let middle_mm = [(column as f64 + 1.5) * spacing_mm, size_mm[1] - (row as f64 + 1.5) * spacing_mm];
            Field { middle_mm, stack }
        };
        let [left, right] = [0.5 * spacing_mm, size_mm[0] - 0.5 * spacing_mm];
        let [lower, upper] = [0.5 * spacing_mm, size_mm[1] - 0.5 * spacing_mm];
        let kept = |resin: &&NamedResin| CouponResin {
            name: resin.name.clone(),
            rgba: resin.rgba,
            density_g_per_cm3: resin.density_g_per_cm3,
            believed: resin.believed.clone(),
        };
        let coupon = Self {
            materials: materials.to_owned(),
            printer: printer.to_owned(),
            spacing_mm,
            size_mm,
            channels: channels.to_vec(),
            resins: printed.iter().map(kept).collect(),
            rim: white,
            dark,
            marks: [[left, upper], [right, upper], [right, lower], [left, lower], [left + spacing_mm, upper]],
            mark_mm: 0.5 * spacing_mm,
            fields: rows.concat().into_iter().enumerate().map(field).collect(),
        };
        coupon.refractive_index()?;
        Ok(coupon)
    }

    /// The same, as a file of it says.
    ///
    /// # Errors
    /// [`MeasureError`]: the first thing that is wrong.
    pub fn read(path: &Path) -> Result<Self, MeasureError> {
        super::json::read(path)
    }
}
