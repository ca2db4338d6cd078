//! What is wrong in a file, before a room words it.

use std::{fmt, path::PathBuf, sync::Arc};

/// A place in a file. Lines and columns count from 1; a column is a character, not a byte.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as it was named.
    pub file: Arc<str>,
    /// Line, from 1.
    pub line: u32,
    /// Character in the line, from 1.
    pub column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A complaint about a file.
#[derive(Debug)]
pub(crate) struct Fault {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub place: Place,
    /// The key with what stands before it, as `object[0].mesh` or `resin white: rgba`.
    pub key: String,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a key or its value.
#[derive(Debug)]
pub(crate) enum Problem {
    /// The text is no TOML: the parser's words, on several lines.
    Syntax(String),
    /// No such key.
    UnknownKey {
        /// What stands before the keys of its table.
        prefix: String,
        /// The key alone.
        name: String,
        /// The keys there are.
        known: Vec<String>,
    },
    /// A key that must be there and is not.
    Missing {
        /// What it should hold.
        expected: String,
    },
    /// A key that excludes another one, which is there.
    Conflict {
        /// The other one's name in the same table.
        other: String,
    },
    /// A value of the wrong type or out of range.
    Value {
        /// The value, or what it is.
        found: String,
        /// What would do.
        expected: String,
    },
}
