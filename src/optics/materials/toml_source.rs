//! The reader of TOML as material files use it, how they word what they refuse, and where the files they name come
//! from.

use std::cell::RefCell;
use std::path::PathBuf;

use crate::optics::OpticsError;
use crate::toml_reader::{Fault, Problem, Table};
use crate::words::suggest;

/// A table of a material file.
pub(crate) type Keys<'a> = Table<'a, OpticsError>;

impl From<Fault> for OpticsError {
    fn from(Fault { path, place, key, problem }: Fault) -> Self {
        let (element, found, expected) = match problem {
            Problem::Syntax(message) => {
                ("syntax".into(), message.lines().next().unwrap_or("an error").into(), "TOML".into())
            }
            Problem::UnknownKey { prefix, name, known } => {
                let expected = match suggest(&name, known.iter().map(String::as_str)) {
                    Some(near) => format!("a known key (did you mean `{near}`?)"),
                    None => format!("one of {}", known.join(", ")),
                };
                (format!("{prefix}key"), format!("`{name}`"), expected)
            }
            Problem::Missing { expected } => (key, "nothing".into(), expected),
            Problem::Conflict { other } => (key, format!("together with `{other}`"), "only one of the two".into()),
            Problem::Value { found, expected } => (key, found, expected),
        };
        Self::Entry { file: path, line: Some(place.line as usize), element, found, expected }
    }
}

/// Where the files a material file names come from.
pub(crate) enum Folder<'a> {
    /// The folder of the material file, and what was read from it.
    Disk(PathBuf, RefCell<Vec<PathBuf>>),
    /// Texts compiled in, by name.
    Embedded(&'a [(&'a str, &'a str)]),
}

impl Folder<'_> {
    /// Path for messages, and the text.
    pub(crate) fn read(&self, name: &str) -> Result<(PathBuf, String), OpticsError> {
        match self {
            Self::Disk(folder, read) => {
                let file = folder.join(name);
                match crate::regular_file::read_text(&file) {
                    Ok(text) => {
                        read.borrow_mut().push(file.clone());
                        Ok((file, text))
                    }
                    Err(source) => Err(OpticsError::File { file, source }),
                }
            }
            Self::Embedded(files) => {
                let file = PathBuf::from(name);
                match files.iter().find(|(known, _)| *known == name) {
                    Some((_, text)) => Ok((file, (*text).to_string())),
                    None => Err(OpticsError::File { file, source: std::io::ErrorKind::NotFound.into() }),
                }
            }
        }
    }
}
