//! What can be wrong with a job, each said in one line: place, key, found, expected.

use crate::optics::StackError;
use crate::toml_reader::Place;

/// Why a job is refused. Every message is one line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JobError {
    /// The disk: the job file cannot be read.
    #[error("{file}: found {found}, expected a readable job file")]
    Unreadable {
        /// The job file.
        file: String,
        /// What stands in the way.
        found: String,
    },
    /// The file: it is too large to be a job.
    #[error("{file}: found {found} bytes or more, expected a job of at most {limit}")]
    TooLarge {
        /// The job file.
        file: String,
        /// Bytes seen.
        found: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The file: it is not TOML.
    #[error("{place}: found text that is not valid TOML: {message}")]
    Syntax {
        /// Where the parser stumbled.
        place: Place,
        /// The parser's words.
        message: String,
    },
    /// A key that no job has.
    #[error("{place}: {key}: found an unknown key; {hint}")]
    UnknownKey {
        /// Where it stands.
        place: Place,
        /// Its full path.
        key: String,
        /// "did you mean `…`?", or the keys there are.
        hint: String,
    },
    /// A key that must be there and is not.
    #[error("{place}: {key}: found nothing, expected {expected}")]
    Missing {
        /// The table that lacks it.
        place: Place,
        /// Its full path.
        key: String,
        /// What it should hold.
        expected: String,
    },
    /// Two keys that exclude each other.
    #[error("{place}: {key}: found together with `{other}`, expected only one of the two")]
    Conflict {
        /// The later one.
        place: Place,
        /// Its full path.
        key: String,
        /// The other one's name in the same table.
        other: String,
    },
    /// A value of the wrong type or out of range.
    #[error("{place}: {key}: found {found}, expected {expected}")]
    Value {
        /// Where the value stands.
        place: Place,
        /// The key's full path.
        key: String,
        /// The value.
        found: String,
        /// What would do.
        expected: String,
    },
    /// A stack that cannot be read.
    #[error("{place}: {key}: {error}")]
    Stack {
        /// Where the text stands.
        place: Place,
        /// The key's full path.
        key: String,
        /// Which layer, what was found, what was expected.
        error: StackError,
    },
    /// An input file or folder that is not there, or is not what it should be.
    #[error("{place}: {key}: found \"{found}\", {problem}, expected {expected} (looked at {looked_at})")]
    Input {
        /// Where the path stands.
        place: Place,
        /// The key's full path.
        key: String,
        /// The path as written.
        found: Box<str>,
        /// What is wrong with it.
        problem: String,
        /// What should be there.
        expected: &'static str,
        /// The path after resolving it against the job file's folder.
        looked_at: Box<str>,
    },
    /// A resin, set or printer of that name does not exist.
    #[error("{place}: {key}: found the unknown {kind} \"{found}\"; {hint}")]
    UnknownName {
        /// Where the name stands.
        place: Place,
        /// The key's full path.
        key: String,
        /// What it should name.
        kind: &'static str,
        /// The name.
        found: String,
        /// "did you mean `…`?", or the names there are.
        hint: String,
    },
    /// A part of lumislice that the job asks for and that does not exist yet.
    #[error("{place}: {key}: found \"{found}\", which is not built yet; expected {expected}")]
    NotBuilt {
        /// Where it is asked for.
        place: Place,
        /// The key's full path.
        key: String,
        /// What was asked for.
        found: String,
        /// What there is instead.
        expected: String,
    },
}

impl crate::blame::Blamed for JobError {}
