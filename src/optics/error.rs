//! What can go wrong in this room, by who is to blame: the disk, the file's contents, or a parameter.

use crate::words::suggest;
use std::path::PathBuf;

use super::SpectrumError;
use crate::blame::{Blame, Blamed};
use crate::watch::Stopped;

/// Errors of the optics room; every message is one line.
#[derive(Debug, thiserror::Error)]
pub enum OpticsError {
    /// A file could not be read or written.
    #[error("{}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file says something it may not say.
    #[error("{}{}: {element}: found {found}, expected {expected}", file.display(), at(*line))]
    Entry {
        /// The file.
        file: PathBuf,
        /// Line, counted from 1, where one is known.
        line: Option<usize>,
        /// Column, key or table.
        element: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// A parameter is out of range.
    #[error("{name}: found {found}, expected {expected}")]
    Parameter {
        /// Its name.
        name: String,
        /// What was given.
        found: String,
        /// What is accepted.
        expected: String,
    },
    /// Profiles that no slab of a resin can have.
    #[error("{}:{line}: resin {resin}, channel {channel}: {source}", file.display())]
    Spectrum {
        /// The material file.
        file: PathBuf,
        /// Line of the resin's table.
        line: usize,
        /// Name of the resin.
        resin: String,
        /// Name of the channel.
        channel: String,
        /// What is wrong with them.
        source: SpectrumError,
    },
    /// No built-in set of this name.
    #[error("unknown material set `{name}`{}; built in are: {known}", did_you_mean(suggestion.as_deref()))]
    UnknownSet {
        /// The name asked for.
        name: String,
        /// The nearest built-in name, if one is near.
        suggestion: Option<String>,
        /// All built-in names.
        known: String,
    },
    /// No resin of this name in a set.
    #[error("unknown resin `{name}`{}; {set} has: {known}", did_you_mean(suggestion.as_deref()))]
    UnknownResin {
        /// The name asked for.
        name: String,
        /// The nearest name of the set, if one is near.
        suggestion: Option<String>,
        /// Name of the set.
        set: String,
        /// All its resins.
        known: String,
    },
    /// A model needs coefficients of a resin that is given by profiles only.
    #[error("resin {resin}: found no coefficients, expected scattering-per-mm and absorption-per-mm")]
    NoCoefficients {
        /// The resin.
        resin: String,
    },
    /// The watch asked a simulation to stop.
    #[error("simulation cancelled")]
    Stopped(#[from] Stopped),
}

impl Blamed for OpticsError {
    fn blame(&self) -> Blame {
        match self {
            Self::Stopped(_) => Blame::Interrupt,
            _ => Blame::Input,
        }
    }
}

impl OpticsError {
    /// No resin `name` among `names` of the set `set`.
    pub(super) fn unknown_resin<'a>(name: &str, set: &str, names: impl Iterator<Item = &'a str> + Clone) -> Self {
        Self::UnknownResin {
            name: name.into(),
            suggestion: suggest(name, names.clone()).map(String::from),
            set: set.into(),
            known: names.collect::<Vec<_>>().join(", "),
        }
    }

    pub(crate) fn parameter(name: &str, found: impl std::fmt::Display, expected: String) -> Self {
        Self::Parameter { name: name.into(), found: found.to_string(), expected }
    }
}

fn at(line: Option<usize>) -> String {
    line.map(|line| format!(":{line}")).unwrap_or_default()
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map(|name| format!(", did you mean `{name}`?")).unwrap_or_default()
}
