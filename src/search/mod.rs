//! The inverse problem: which stacking of resins reflects like the target (Hašan et al. 2010, section 6).
//!
//! **In:** a set of resins, a target reflection R̂_t per channel, limits. **Out:** what a [`Matcher`] [`Found`]: the
//! [`Stack`](crate::optics::Stack) of least error in a space of whole units h₀, with the proof that it is, and what
//! transport makes of it; what a set can reach at all, its [`Gamut`].
//!
//! ```text
//!   MaterialSet, MatchOptions ──► Matcher: BlockTable ──┬──► branch_and_bound ──► refine ──► Found
//!                            │                          └──► algorithm_1 (reference, as printed)
//!                            └──► Gamut ──► GamutMap: targets within reach
//! ```
//!
//! # Limits
//! A resin lies nowhere above its min-depth; every layer of it (adjacent blocks joined) is at least min-mm and at most
//! max-mm thick. They are kept in whole units, rounded to the safe side. The half-space of the core starts below the
//! last layer and keeps its resin's min-depth; a last layer of the core's own resin merges into it, so it is exempt
//! from min-mm and max-mm and is not listed in the result.

mod algorithm_1;
mod branch_and_bound;
mod cache;
mod endings;
mod envelope;
mod family;
mod forward;
mod gamut;
mod kernels;
mod matcher;
mod objective;
mod options;
mod refine;
mod table;
#[cfg(test)]
mod tests;

pub use cache::SearchCache;
pub(crate) use family::LEAST_MIXED_MM;
pub use family::{Family, FamilyAnswer, PartTarget};
pub use gamut::{
    Boundary, ChannelGamut, GLOWS, Gamut, GamutMap, GamutPoint, Lies, Move, Side, far_glow, far_miss, place_of,
};
pub use matcher::{Found, Judge, Judged, MatchOptions, Matcher};
pub(crate) use objective::BLACK_RMS;
pub use objective::{Norm, Objective};
pub use options::{Match, SearchError, SearchOptions, SearchTarget};
pub use refine::{RefineOptions, Refined};
use table::BlockTable;

/// What a resin is allowed to do in a stacking.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ResinLimit {
    /// No part of the resin lies above this depth, mm.
    pub min_depth_mm: f64,
    /// Every layer of it is at least this thick, mm.
    pub min_mm: f64,
    /// Every layer of it is at most this thick, mm.
    pub max_mm: f64,
}

impl ResinLimit {
    /// Everything is allowed.
    pub const NONE: Self = Self { min_depth_mm: 0.0, min_mm: 0.0, max_mm: f64::INFINITY };

    /// What keeps all of `limits`, as a mixture does those of its resins.
    pub fn all(limits: impl IntoIterator<Item = Self>) -> Self {
        limits.into_iter().fold(Self::NONE, |all, one| Self {
            min_depth_mm: all.min_depth_mm.max(one.min_depth_mm),
            min_mm: all.min_mm.max(one.min_mm),
            max_mm: all.max_mm.min(one.max_mm),
        })
    }
}
