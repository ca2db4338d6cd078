//! `[appearance]`: what is done so that the print looks as asked on any shape.

use super::options::{StackingModel, StackingOptions};
use super::ranges as range;
use super::read::{Result, Table};
use super::target::TargetSpec;

/// What is done beyond one stacking for each target; what a job does not say follows from whether layers may be
/// mixtures, see [`super::Job::rounds`] and [`super::Job::thin_parts`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AppearanceOptions {
    /// Rounds of printing in memory, looking, and correcting the targets, 0 to 16.
    pub rounds: Option<u32>,
    /// Whether parts thinner than the stackings get stackings of their own.
    pub thin_parts: Option<bool>,
}

/// Rounds that README's job can afford.
const DEFAULT_ROUNDS: u32 = 4;

pub(super) const APPEARANCE_KEYS: &[&str] = &["rounds", "thin-parts"];

pub(super) fn read_appearance(table: &Table<'_>, stacking: &StackingOptions) -> Result<AppearanceOptions> {
    table.allow_only(APPEARANCE_KEYS)?;
    let rounds = table.get("rounds").map(|value| value.integer(range::ROUNDS)).transpose()?.map(|rounds| rounds as u32);
    let thin_parts = table.get("thin-parts").map(|value| value.truth()).transpose()?;
    for (key, asked) in [("rounds", rounds.is_some_and(|rounds| rounds > 0)), ("thin-parts", thin_parts == Some(true))]
    {
        if let Some(value) = table.get(key).filter(|_| asked && stacking.model == StackingModel::KubelkaMunk) {
            return Err(value.refuse_as(
                format!("{key} of stackings that Kubelka-Munk judges"),
                "model = \"transport\" in [stacking]",
            ));
        }
    }
    Ok(AppearanceOptions { rounds, thin_parts })
}

impl super::Job {
    /// Rounds of correction: as the job says, else [`DEFAULT_ROUNDS`] where layers may be mixtures. Layers of pure
    /// resins can make up for little.
    pub fn rounds(&self) -> u32 {
        self.appearance.rounds.unwrap_or(if self.allows_mixtures() { DEFAULT_ROUNDS } else { 0 })
    }

    /// Whether stackings of any object are searched for, as those that are given are not.
    pub fn searches(&self) -> bool {
        self.objects.iter().any(|object| !matches!(object.target, TargetSpec::Stacking { .. }))
    }

    /// Whether parts thinner than the stackings get stackings of their own: as the job says, else where layers may be
    /// mixtures.
    pub fn thin_parts(&self) -> bool {
        self.appearance.thin_parts.unwrap_or(self.allows_mixtures())
    }
}
