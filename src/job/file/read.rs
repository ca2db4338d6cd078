//! The reader of TOML as jobs use it, and how a job words what it refuses.

use super::error::JobError;
use crate::toml_reader::{self, Fault, Problem};
use crate::words::{escaped, excerpt, hint};

pub(super) type Result<T> = std::result::Result<T, JobError>;

/// A table of the job, known by its full path.
pub(super) type Table<'a> = toml_reader::Table<'a, JobError>;

/// A value of the job, known by its full path.
pub(super) type Value<'a> = toml_reader::Value<'a, JobError>;

impl Value<'_> {
    /// The refusal of a name that nothing bears.
    pub(super) fn unknown(&self, kind: &'static str, found: &str, hint: String) -> JobError {
        let found = excerpt(found);
        JobError::UnknownName { place: self.place(), key: self.key().to_owned(), kind, found, hint }
    }
}

impl From<Fault> for JobError {
    fn from(Fault { place, key, problem, .. }: Fault) -> Self {
        match problem {
            Problem::Syntax(message) => Self::Syntax { place, message: syntax_message(&message) },
            Problem::UnknownKey { name, known, .. } => {
                let hint = hint(&name, known.iter().map(String::as_str));
                Self::UnknownKey { place, key, hint }
            }
            Problem::Missing { expected } => Self::Missing { place, key, expected },
            Problem::Conflict { other } => Self::Conflict { place, key, other },
            Problem::Value { found, expected } => Self::Value { place, key, found, expected },
        }
    }
}

/// The parser's message on one line.
fn syntax_message(message: &str) -> String {
    let parts: Vec<&str> = message.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    escaped(&parts.join(", "))
}
