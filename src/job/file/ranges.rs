//! What a number in a job may be. Bounds catch slips of unit (a height in µm, a pitch in metres), not bad taste.

use crate::toml_reader::{IntRange, Range};

/// Longest length a job may name, mm: twice the longest tray of any PolyJet machine (Objet1000, 1000 mm).
const MAX_EXTENT_MM: f64 = 2000.0;
/// Thinnest layer a job may name, mm: 0.1 µm, far below the 14 µm a printer can do.
const MIN_THICKNESS_MM: f64 = 1e-4;
/// Deepest a stacking may reach, mm: profiles of support, the clearest resin, are cut off at 40.
const MAX_DEPTH_MM: f64 = 100.0;

/// A height below 0.01 mm is less than one layer of any printer.
pub(super) const HEIGHT: Range = Range::new("a height in mm", 0.01, MAX_EXTENT_MM);
/// Micrometres to metres, either way.
pub(super) const SCALE: Range = Range::new("a factor", 1e-6, 1e6);
pub(super) const ANGLE: Range = Range::new("an angle in degrees", -360.0, 360.0);
pub(super) const POSITION: Range = Range::new("a position in mm", -MAX_EXTENT_MM, MAX_EXTENT_MM);
/// As many as a tray of half a metre holds of what is a centimetre large.
pub(super) const COUNT: IntRange = IntRange { noun: "a number of copies", min: 1, max: 1000 };
/// Room to get a spatula between.
pub(super) const GAP: Range = Range::new("a distance in mm", 0.0, 100.0);
/// A voxel of 1 µm is finer than any printer; one of 10 mm is coarser than any preview.
pub(super) const PITCH: Range = Range::new("a voxel size in mm", 0.001, 10.0);
/// Up to a voxel of the coarsest printers; 0 turns simplification off.
pub(super) const MESH_ERROR: Range = Range::new("a distance in mm", 0.0, 1.0);
pub(super) const TRAY: Range = Range::new("a tray size in mm", 1.0, MAX_EXTENT_MM);
/// Material ids are bytes, and 0 is the background.
pub(super) const COLORS: IntRange = IntRange { noun: "a number of colours", min: 1, max: 255 };
pub(super) const SLICES: IntRange = IntRange { noun: "a number of slices", min: 1, max: 100_000 };
pub(super) const ALBEDO: Range = Range::new("an albedo", 0.0, 1.0);
/// At 0 there would be nothing to rescale to.
pub(super) const MAX_ALBEDO: Range = Range::new("an albedo", 0.001, 1.0);
/// From well below a voxel to well above a tray's depth.
pub(super) const MEAN_FREE_PATH: Range = Range::new("a mean free path in mm", 1e-4, 1000.0);
/// What radii are multiplied by.
pub(super) const SUBSURFACE_SCALE: Range = Range::new("a factor", 1e-4, 1000.0);
/// At either end no light would ever turn round.
pub(super) const ANISOTROPY: Range = Range::new("a mean cosine", -0.99, 0.99);
/// A tile smaller than a voxel or two shows nothing.
pub(super) const TILE: Range = Range::new("a width in mm", 0.1, MAX_EXTENT_MM);
/// Stacking ids are 16-bit.
pub(super) const CLUSTERS: IntRange = IntRange { noun: "a number of clusters", min: 1, max: 65_535 };
/// TOML's integers are signed 64-bit.
pub(super) const SEED: IntRange = IntRange { noun: "a whole number", min: 0, max: i64::MAX as u64 };
pub(super) const MAX_THICKNESS: Range = Range::new("a thickness in mm", 0.01, MAX_DEPTH_MM);
/// 4096 units of 5 mm are 1.2 µm each: beyond any printer, and the search's tables grow with them.
pub(super) const UNITS: IntRange = IntRange { noun: "a power of two", min: 2, max: 4096 };
/// Depth 8 is the deepest whose search was measured (16 ms with the tight bound, 16 s with the paper's); each
/// further step multiplies it.
pub(super) const DEPTH: IntRange = IntRange { noun: "a number of blocks", min: 1, max: 12 };
/// Each takes as long as slicing and a look; what four do not correct no more do.
pub(super) const ROUNDS: IntRange = IntRange { noun: "a number of rounds", min: 0, max: 16 };
pub(super) const DC_WEIGHT: Range = Range::new("a weight", 0.0, 1e6);
pub(super) const LIMIT_DEPTH: Range = Range::new("a depth in mm", 0.0, MAX_DEPTH_MM);
pub(super) const LIMIT_MIN: Range = Range::new("a thickness in mm", 0.0, MAX_DEPTH_MM);
pub(super) const LIMIT_MAX: Range = Range::new("a thickness in mm", MIN_THICKNESS_MM, MAX_DEPTH_MM);
/// An Lp distance to a surface vanishes on it only for p > 2: near a plane ∫ d^−p dA goes as h^(2−p).
pub(super) const LP_EXPONENT: Range = Range::new("an exponent", 2.1, 64.0);
