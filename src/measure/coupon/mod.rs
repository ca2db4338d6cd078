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

use crate::optics::Stack;

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
    /// Names of a field's layers, as `--stack` takes them.
    pub fn named(&self, field: &Field) -> String {
        field.stack.map(|&resin| self.resins[resin].name.clone()).to_string()
    }
}
