//! Voxels against formulas and brute force: where a surface is, what is inside, what depth every voxel has.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)] // helpers of tests

#[path = "../common/mod.rs"]
mod common;

mod bunny;
mod fractions;
mod inside;
mod joined;
mod laws;
mod shapes;
mod support;
mod textured;
mod whole;
