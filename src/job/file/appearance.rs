//! `[appearance]`: what is done so that the print looks as asked on any shape.

use super::options::{StackingModel, StackingOptions};
use super::ranges as range;
use super::read::{Result, Table};

/// What is done beyond one stacking for each target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AppearanceOptions {
    /// Rounds of printing in memory, looking, and correcting the targets, 0 to 16; default 3, or 0 where stackings are
    /// judged by Kubelka–Munk, which is as the paper has it.
    pub rounds: u32,
    /// Whether parts thinner than the stackings get stackings of their own; default true, or false with Kubelka–Munk.
    pub thin_parts: bool,
}

/// Rounds that README's job can afford.
const DEFAULT_ROUNDS: u32 = 3;

pub(super) const APPEARANCE_KEYS: &[&str] = &["rounds", "thin-parts"];

pub(super) fn read_appearance(table: &Table<'_>, stacking: &StackingOptions) -> Result<AppearanceOptions> {
    table.allow_only(APPEARANCE_KEYS)?;
    let judged = stacking.model != StackingModel::KubelkaMunk;
    let rounds = table.integer_or("rounds", if judged { u64::from(DEFAULT_ROUNDS) } else { 0 }, range::ROUNDS)? as u32;
    let thin_parts = table.get("thin-parts").map_or(Ok(judged), |value| value.truth())?;
    if !judged && (rounds > 0 || thin_parts) {
        let key = if rounds > 0 { "rounds" } else { "thin-parts" };
        let value = table.require(key, "a key that was read")?;
        return Err(value
            .refuse_as(format!("{key} with stackings judged by Kubelka-Munk"), "model = \"transport\" in [stacking]"));
    }
    Ok(AppearanceOptions { rounds, thin_parts })
}
