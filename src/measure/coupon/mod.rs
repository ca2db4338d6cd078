//! A test piece for a printer's own resins: fields of known layers, printed as one part, photographed from above.
//!
//! ```text
//!   ■ white rim  ■                 ■   marks of the darkest resin; the fifth, beside the first, says which way is up
//!     ┌──┬──┬──┬──┬──┬──┬──┬──┐
//!     │ cyan over white  │ over black  a row a resin: thin to thick over white, thick to thin over black,
//!     ├──┼──┼──┼──┼──┼──┼──┼──┤        so that neighbours differ little
//!     │ magenta …              │
//!     └──┴──┴──┴──┴──┴──┴──┴──┘
//!   ■                              ■
//! ```
//!
//! **In:** a set's resins and a printer's pitch become a [`Coupon`]: its fields, and the job that prints them
//! (`layout`, `print`). Photographs of the print become a [`Reading`]: the share of the light that the middle of every
//! field returns (`find`, `read`). **Out:** coefficients of all resins at once ([`fit_coupon`]).
//!
//! Millimetres of the print as seen from above: x to the right, y up, from its lower left corner; z up.

mod aside;
mod find;
mod fit;
mod json;
mod layout;
mod print;
mod read;
mod report;
#[cfg(test)]
mod tests;

pub use fit::{CouponFit, fit_coupon};
pub use layout::{CouponResin, NamedResin};
pub use read::{Photographs, Reading};

use super::MeasureError;
use crate::{optics::Stack, words::counted};

/// A printed test piece: what it is made of and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Coupon {
    /// What the set of resins is called, or the file's name.
    pub materials: String,
    /// Preset of the printer.
    pub printer: String,
    /// Side of a field, mm; fields lie side by side.
    pub spacing_mm: f64,
    /// Extent along x, y and z, mm.
    pub size_mm: [f64; 3],
    /// Names of the channels.
    pub channels: Vec<String>,
    /// The resins it is made of.
    pub resins: Vec<CouponResin>,
    /// Resins of rim and marks, by their place among the resins.
    pub rim: usize,
    /// The darkest.
    pub dark: usize,
    /// Middles of the marks, mm: the four corners from the upper left clockwise, then the one to the right of the
    /// first.
    pub marks: [[f64; 2]; 5],
    /// Side of a mark, mm.
    pub mark_mm: f64,
    /// The fields, row by row from the top.
    pub fields: Vec<Field>,
}

/// A square of one stack.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its middle, mm.
    pub middle_mm: [f64; 2],
    /// Layers from the top down, by place among the resins; below them nothing.
    pub stack: Stack<usize>,
}

/// Side of the square in the middle of a field that is read, as a share of the field's.
pub(crate) const READ_SHARE: f64 = 0.375;

impl Coupon {
    /// The refractive index of all its resins, in every channel.
    ///
    /// # Errors
    /// [`MeasureError::Scene`] where it is not one: light is refracted at the coupon's surface alone, and a material
    /// file has one for all channels.
    fn refractive_index(&self) -> Result<f64, MeasureError> {
        self.refractive_index_or(|found, expected| MeasureError::scene("refractive indices", found, expected))
    }

    /// [`Self::refractive_index`], or what is made of what was found and expected.
    fn refractive_index_or(&self, refuse: impl Fn(String, &'static str) -> MeasureError) -> Result<f64, MeasureError> {
        let all = || self.resins.iter().flat_map(|resin| resin.believed.iter().map(move |volume| (resin, volume)));
        let first = all().next().map(|(resin, volume)| (resin, volume.refractive_index));
        let (first, index) = first.ok_or_else(|| MeasureError::scene("coupon", "no resin", "two at least"))?;
        let Some((other, unlike)) = all().find(|(_, volume)| volume.refractive_index != index) else {
            return Ok(index);
        };
        let found = format!("{} of {} beside {index} of {}", unlike.refractive_index, other.name, first.name);
        let expected =
            "one for all resins: of others a coupon tells nothing, for light is refracted at its surface alone";
        Err(refuse(found, expected))
    }

    /// Refuses what was read of another coupon.
    fn check_reading(&self, reading: &Reading) -> Result<(), MeasureError> {
        let (channels, fields) = (self.channels.len(), self.fields.len());
        let odd = reading.values.iter().map(Vec::len).find(|read| *read != fields);
        if reading.values.len() == channels && odd.is_none() {
            return Ok(());
        }
        let words = |channels, fields| format!("{} of {}", counted(channels, "channel"), counted(fields, "field"));
        let found = words(reading.values.len(), odd.unwrap_or(fields));
        Err(MeasureError::scene("reading", found, format!("{}: one of this coupon", words(channels, fields))))
    }

    /// Refuses what was fitted to another coupon.
    fn check_fits(&self, fits: &[CouponFit]) -> Result<(), MeasureError> {
        let (channels, resins, fields) = (self.channels.len(), self.resins.len(), self.fields.len());
        let of_this =
            |fit: &CouponFit| [fit.coefficients.len(), fit.shares.len()] == [resins; 2] && fit.missed.len() == fields;
        if fits.len() == channels && fits.iter().all(of_this) {
            return Ok(());
        }
        let words = |channels, resins, fields| {
            let resins = counted(resins, "resin");
            format!("{} of {resins} and {}", counted(channels, "channel"), counted(fields, "field"))
        };
        let odd = fits.iter().find(|fit| !of_this(fit));
        let (its, missed) = odd.map_or((resins, fields), |fit| (fit.coefficients.len(), fit.missed.len()));
        let expected = format!("{}: those of this coupon", words(channels, resins, fields));
        Err(MeasureError::scene("fits", words(fits.len(), its, missed), expected))
    }

    /// Names of a field's layers, as `--stack` takes them.
    pub fn named(&self, field: &Field) -> String {
        field.stack.map(|&resin| self.resins[resin].name.clone()).to_string()
    }
}
