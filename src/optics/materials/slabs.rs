//! The slabs a material file's resins are simulated as, and the file that uses the result.
//!
//! Profiles that were simulated once and stored make a set that loads at once and never changes; the built-in sets are
//! such.

use std::fmt::Write as _;

use super::file::MaterialFile;
use super::resin_table::Draft;
use super::simulate::{SimulatedProfile, simulate_profile};
use crate::optics::{OpticsError, VolumeCoefficients};
use crate::watch::Watch;
use crate::words::toml_string;

/// One slab to be simulated: a resin in a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabPlan {
    /// Name of the resin.
    pub resin: String,
    /// Name of the channel.
    pub channel: String,
    /// What the slab is made of.
    pub coefficients: VolumeCoefficients,
    /// How thick it is, mm.
    pub thickness_mm: f64,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Name of the file for its profiles: `set-resin-channel.csv`, without separators.
    pub file: String,
}

impl SlabPlan {
    /// Simulates the slab; `watch` hears of the photons.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for what is out of range; [`OpticsError::Stopped`].
    pub fn simulate(&self, photons: u64, watch: &dyn Watch) -> Result<SimulatedProfile, OpticsError> {
        simulate_profile(self.coefficients, self.thickness_mm, photons, self.seed, watch)
    }
}

impl MaterialFile {
    /// The slabs of all resins that have coefficients, in the order of the file, channel by channel. Every slab has a
    /// seed of its own: `first_seed` and up, by default the file's.
    pub fn slab_plans(&self, first_seed: Option<u64>) -> Vec<SlabPlan> {
        let first_seed = first_seed.unwrap_or(self.first_seed);
        let mut plans = Vec::new();
        for (index, draft) in self.resins.iter().enumerate() {
            let Some(volume) = &draft.volume else { continue };
            for (channel, name) in self.channels.iter().enumerate() {
                plans.push(SlabPlan {
                    resin: draft.name.clone(),
                    channel: name.clone(),
                    coefficients: volume[channel],
                    thickness_mm: draft.thickness_mm[channel],
                    seed: first_seed.wrapping_add((index * self.channels.len() + channel) as u64),
                    file: self.profile_name(draft, name),
                });
            }
        }
        plans
    }

    fn profile_name(&self, draft: &Draft, channel: &str) -> String {
        let lower = channel.to_lowercase();
        let unique = self.channels.iter().filter(|other| other.to_lowercase() == lower).count() == 1;
        format!("{}-{}-{}.csv", self.file_stem(), draft.name, if unique { &lower } else { channel })
    }

    /// The set's name, fit to be part of a file name.
    pub fn file_stem(&self) -> String {
        let safe = |c: char| if c.is_alphanumeric() || "-_+ ".contains(c) { c } else { '_' };
        let stem: String = self.name.chars().take(MAX_STEM).map(safe).collect();
        if stem.trim().is_empty() { "materials".to_owned() } else { stem.trim().to_owned() }
    }

    /// The text of a material file whose resins are those of `plans`, with the planned profiles beside it; the others
    /// have no coefficients or were left out of the plans.
    pub fn toml_with(&self, plans: &[SlabPlan]) -> String {
        let mut text = format!("name = {}\n", toml_string(&self.name));
        // Writing to a String cannot fail.
        let _ = writeln!(text, "channels = {}", list(self.channels.iter().map(|name| toml_string(name))));
        let _ = writeln!(text, "provenance = {}", toml_string(&format!("{}; profiles simulated", self.provenance)));
        for draft in &self.resins {
            let own: Vec<&SlabPlan> = plans.iter().filter(|plan| plan.resin == draft.name).collect();
            if own.len() != self.channels.len() {
                continue;
            }
            let numbers = |value: fn(&SlabPlan) -> f64| list(own.iter().map(|plan| value(plan).to_string()));
            let _ = writeln!(text, "\n[[resin]]\nname = {}", toml_string(&draft.name));
            let _ = writeln!(text, "rgba = {}", list(draft.rgba.iter().map(u8::to_string)));
            let _ = writeln!(text, "density-g-per-cm3 = {}", draft.density);
            if let Some(price) = draft.price {
                let _ = writeln!(text, "price-per-kg = {price}");
            }
            let _ = writeln!(text, "scattering-per-mm = {}", numbers(|plan| plan.coefficients.sigma_s));
            let _ = writeln!(text, "absorption-per-mm = {}", numbers(|plan| plan.coefficients.sigma_a));
            let _ = writeln!(text, "g = {}", numbers(|plan| plan.coefficients.g));
            let _ = writeln!(text, "refractive-index = {}", draft.refractive_index);
            let _ = writeln!(text, "thickness-mm = {}", numbers(|plan| plan.thickness_mm));
            let _ = writeln!(text, "reflection = {}", list(own.iter().map(|plan| toml_string(&plan.file))));
            if draft.background {
                text += "print-as = \"background\"\n";
            }
            if !draft.notes.is_empty() {
                let _ = writeln!(text, "notes = {}", toml_string(&draft.notes));
            }
        }
        text
    }
}

/// Longest part of a file name taken from a set's name, characters.
const MAX_STEM: usize = 100;

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::optics::{MaterialSet, regenerate_builtin};
    use crate::watch::Unwatched;

    /// What `regenerate_builtin` stores for a set and what its plans simulate are the same profiles under the same
    /// names.
    #[test]
    fn plans_of_built_in_sets_are_the_stored_profiles() {
        const PHOTONS: u64 = 64;
        let mut stored = Vec::new();
        let keep = |name: &str, profile: &SimulatedProfile| {
            stored.push((name.to_owned(), profile.comment()));
            Ok(())
        };
        regenerate_builtin(PHOTONS, &Unwatched, keep).unwrap();
        let mut planned = Vec::new();
        for set in MaterialSet::builtin_names() {
            let plans = MaterialFile::builtin(set).unwrap().slab_plans(None);
            // The others are in the set that they are shared with.
            for plan in plans.into_iter().filter(|plan| MaterialSet::stores(&plan.file)) {
                let profile = plan.simulate(PHOTONS, &Unwatched).unwrap();
                planned.push((plan.file, profile.comment()));
            }
        }
        assert_eq!(planned, stored);
    }

    #[test]
    fn file_with_simulated_profiles_is_a_material_file() {
        let folder = tempfile::tempdir().unwrap();
        let odd = r#"
            name = "../Größe \"7\""
            channels = ["a", "A"]
            [[resin]]
            name = "my resin"
            rgba = [1, 2, 3]
            density-g-per-cm3 = 1.1
            scattering-per-mm = [3.0, 4.0]
            absorption-per-mm = 1.0
            g = 0.2
            notes = "two\nlines"
        "#;
        let path = folder.path().join("odd.toml");
        std::fs::write(&path, odd).unwrap();
        let file = MaterialFile::read(&path).unwrap();
        let plans = file.slab_plans(Some(9));
        let names: Vec<_> = plans.iter().map(|plan| plan.file.as_str()).collect();
        assert_eq!(names, ["___Größe _7_-my resin-a.csv", "___Größe _7_-my resin-A.csv"]);
        for plan in &plans {
            let profile = plan.simulate(20_000, &Unwatched).unwrap();
            profile.write(&folder.path().join(&plan.file)).unwrap();
        }
        let again = folder.path().join("again.toml");
        std::fs::write(&again, file.toml_with(&plans)).unwrap();
        let set = MaterialSet::load(&again).unwrap();
        assert_eq!(set.name, "../Größe \"7\"");
        assert_eq!(set.resins[0].notes, "two\nlines");
        let volumes = set.resins[0].volumes().unwrap();
        assert_eq!(volumes, plans.iter().map(|plan| plan.coefficients).collect::<Vec<_>>());
        assert!(Path::new(&plans[0].file).components().count() == 1);
    }
}
