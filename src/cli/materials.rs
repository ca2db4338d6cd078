//! `--materials`: a TOML file or the name of a built-in set.

use std::path::{Path, PathBuf};

use lumislice::{
    job::{
        Job, Prepared, RunError,
        file::{self, MaterialSource},
    },
    optics::{MaterialFile, MaterialSet, OpticsError},
    search::ResinLimit,
};

use super::{
    cache::CacheArgs,
    failure::{Failure, refusal, refuse},
    note,
    progress::Bars,
    tell::events,
    warn,
};

/// Materials as far as they are read quickly.
pub struct Materials {
    /// The file, built in or not.
    pub file: MaterialFile,
    /// Whether it is built in, so that its provenance must be shown.
    pub built_in: bool,
}

impl Materials {
    /// Reads what `name` stands for: a file if there is one or the name ends in `.toml`, else a built-in set. Says
    /// where a built-in set's numbers come from.
    pub fn read(name: &Path) -> Result<Self, OpticsError> {
        let (file, built_in) = MaterialFile::named(name)?;
        if built_in {
            say_provenance(file.name(), file.provenance());
        }
        Ok(Self { file, built_in })
    }

    /// Fits coefficients to the resins given by profiles only, of those in `names` or of all, and says what was found.
    /// The answer is one line for each resin that no coefficients fit.
    pub fn fit(&mut self, names: Option<&[&str]>, bars: &Bars) -> Result<Vec<String>, OpticsError> {
        let refused = self.file.fit(names, bars);
        bars.finish();
        refused
    }

    /// Fits coefficients to the resins given by profiles, for the transport model, saying what was refused and why: the
    /// first resin that is left without, if one is.
    pub fn lacks_coefficients(&mut self, bars: &Bars) -> Result<Option<String>, OpticsError> {
        self.fit(None, bars)?;
        Ok(self.file.resin_names().find(|name| self.file.volume(name).is_none()).map(str::to_owned))
    }

    /// All parameters; simulates the resins that come without profiles. Says what was done to the data of a file.
    pub fn load(self, bars: &Bars) -> Result<MaterialSet, OpticsError> {
        let set = self.file.into_set(bars);
        bars.finish();
        let set = set?;
        if !self.built_in {
            set.warnings.iter().for_each(|warning| warn(warning));
        }
        Ok(set)
    }
}

/// Says where the numbers of a built-in set come from; it must never be taken for a measurement.
pub fn say_provenance(set: &str, provenance: &str) {
    // The built-in text begins with the set's name already.
    let provenance = provenance.strip_prefix(&format!("{set}: ")).unwrap_or(provenance);
    note(&format!("materials `{set}`: {provenance}"));
}

/// How far a job is prepared.
#[derive(Debug, Clone, Copy)]
pub enum Corrected<'a> {
    /// As it is before its print was looked at.
    Draft,
    /// Corrected where its print would miss: by what an earlier run of it left in the first of these folders that has
    /// it, else anew.
    As(&'a [PathBuf]),
}

/// A job with everything read and matched; says where a built-in set's numbers come from.
pub fn prepared(mut job: Job, cache: &CacheArgs, corrected: Corrected<'_>, bars: &Bars) -> Result<Prepared, RunError> {
    job.search_cache = cache.cache();
    let built_in = matches!(job.materials, MaterialSource::Set(_));
    let prepared = match corrected {
        Corrected::Draft => Prepared::draft(job, bars),
        Corrected::As(folders) => Prepared::for_folders(job, folders, bars),
    };
    // As events they come at once, and as lines in the order of the summary.
    if let Some(prepared) = prepared.as_ref().ok().filter(|_| events().is_some()) {
        prepared.warnings.iter().for_each(|warning| warn(warning));
    }
    if let Some(set) = prepared.as_ref().ok().map(|prepared| &prepared.materials).filter(|_| built_in) {
        bars.finish();
        say_provenance(&set.name, &set.provenance);
    }
    prepared
}

/// The limits that `--min-depth` sets; support keeps its default depth unless it is given another.
pub fn min_depth_limits(file: &MaterialFile, given: &[(String, f64)]) -> super::Result<Vec<ResinLimit>> {
    for (index, (resin, _)) in given.iter().enumerate() {
        file.resin_id(resin)?;
        if given[..index].iter().any(|other| other.0 == *resin) {
            refuse!("--min-depth: found {resin} a second time, expected each resin once");
        }
    }
    let given = |name: &str| given.iter().find(|given| given.0 == name).map(|given| given.1);
    Ok(file::min_depth_limits(file.resin_names(), given))
}

/// The error of a model that needs what a resin of `materials` does not have.
pub fn no_coefficients(resin: &str, materials: &Path) -> Failure {
    let needed = "this model needs scattering-per-mm and absorption-per-mm";
    refusal!("{}: resin {resin}: found no coefficients; {needed}", materials.display())
}
