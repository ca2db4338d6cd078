//! Families.

mod model;
mod shape;
mod solve;

pub use solve::{Family, FamilyAnswer};
