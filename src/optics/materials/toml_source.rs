//! TOML tables read key by key, so that every complaint has its line.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::optics::OpticsError;
use crate::words::suggest;

/// A text and what to call it in errors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) text: &'a str,
    pub(crate) path: &'a Path,
}

impl<'a> Source<'a> {
    /// The document's top table.
    pub(crate) fn parse(&self) -> Result<Spanned<DeTable<'a>>, OpticsError> {
        DeTable::parse(self.text).map_err(|error| {
            let start = error.span().map(|span| span.start);
            self.error(start, "syntax", error.message().lines().next().unwrap_or("an error").into(), "TOML".into())
        })
    }

    pub(crate) fn error(&self, at: Option<usize>, element: &str, found: String, expected: String) -> OpticsError {
        let line =
            at.map(|at| 1 + self.text.as_bytes()[..at.min(self.text.len())].iter().filter(|b| **b == b'\n').count());
        OpticsError::Entry { file: self.path.to_path_buf(), line, element: element.into(), found, expected }
    }
}

/// One table, with what to call it in errors.
pub(crate) struct Keys<'a, 't> {
    pub(crate) source: Source<'a>,
    pub(crate) table: &'t DeTable<'a>,
    /// Byte at which the table starts.
    pub(crate) start: usize,
    /// Said before each key in errors, such as `resin 2 (white): `.
    pub(crate) prefix: String,
}

/// A value that has been read, and the byte it stands at.
pub(crate) struct At<T> {
    pub(crate) value: T,
    pub(crate) at: usize,
}

/// Strings, and whether they stood in an array.
pub(crate) struct Strings {
    pub(crate) items: Vec<At<String>>,
    pub(crate) is_array: bool,
}

impl<'a, 't> Keys<'a, 't> {
    /// Complains about keys that are not known, naming the nearest that is.
    pub(crate) fn reject_unknown(&self, known: &[&str]) -> Result<(), OpticsError> {
        for key in self.table.keys() {
            let name: &str = key.get_ref();
            if !known.contains(&name) {
                let expected = match suggest(name, known.iter().copied()) {
                    Some(near) => format!("a known key (did you mean `{near}`?)"),
                    None => format!("one of {}", known.join(", ")),
                };
                return Err(self.error(key.span().start, "key", format!("`{name}`"), expected));
            }
        }
        Ok(())
    }

    pub(crate) fn error(&self, at: usize, key: &str, found: String, expected: String) -> OpticsError {
        self.source.error(Some(at), &format!("{}{key}", self.prefix), found, expected)
    }

    /// A complaint about a value out of range.
    pub(crate) fn wrong<T: std::fmt::Display>(&self, key: &str, found: &At<T>, expected: &str) -> OpticsError {
        self.error(found.at, key, found.value.to_string(), expected.into())
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str) -> OpticsError {
        self.error(value.span().start, key, kind(value.get_ref()), expected.into())
    }

    pub(crate) fn get(&self, key: &str) -> Option<&'t Spanned<DeValue<'a>>> {
        self.table.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }

    pub(crate) fn missing(&self, key: &str, expected: &str) -> OpticsError {
        self.error(self.start, key, "nothing".into(), expected.into())
    }

    pub(crate) fn string(&self, key: &str) -> Result<Option<At<String>>, OpticsError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        self.as_string(key, value, "a string").map(Some)
    }

    fn as_string(&self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str) -> Result<At<String>, OpticsError> {
        match value.get_ref().as_str() {
            Some(text) => Ok(At { value: text.to_string(), at: value.span().start }),
            None => Err(self.wrong_type(key, value, expected)),
        }
    }

    /// One string or an array of them.
    pub(crate) fn strings(&self, key: &str) -> Result<Option<Strings>, OpticsError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let expected = "a string or an array of strings";
        match value.get_ref().as_array() {
            Some(array) => {
                let items = array.iter().map(|item| self.as_string(key, item, expected));
                Ok(Some(Strings { items: items.collect::<Result<_, _>>()?, is_array: true }))
            }
            None => Ok(Some(Strings { items: vec![self.as_string(key, value, expected)?], is_array: false })),
        }
    }

    pub(crate) fn number(&self, key: &str) -> Result<Option<At<f64>>, OpticsError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        self.as_number(key, value, "a number").map(Some)
    }

    fn as_number(&self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str) -> Result<At<f64>, OpticsError> {
        let number = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => {
                i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|integer| integer as f64)
            }
            _ => None,
        };
        match number {
            Some(number) => Ok(At { value: number, at: value.span().start }),
            None => Err(self.wrong_type(key, value, expected)),
        }
    }

    /// An array of numbers.
    pub(crate) fn numbers(&self, key: &str) -> Result<Option<At<Vec<At<f64>>>>, OpticsError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.wrong_type(key, value, "an array of numbers"));
        };
        let items = array.iter().map(|item| self.as_number(key, item, "a number")).collect::<Result<_, _>>()?;
        Ok(Some(At { value: items, at: value.span().start }))
    }

    /// One number for all channels, or an array of one per channel.
    pub(crate) fn per_channel(&self, key: &str, channels: usize) -> Result<Option<Vec<At<f64>>>, OpticsError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        if !value.get_ref().is_array() {
            let one = self.as_number(key, value, "a number, or an array of one per channel")?;
            return Ok(Some((0..channels).map(|_| At { value: one.value, at: one.at }).collect()));
        }
        let Some(At { value: items, at }) = self.numbers(key)? else { return Ok(None) };
        if items.len() == channels {
            Ok(Some(items))
        } else {
            let expected = format!("one number, or {channels}: one per channel");
            Err(self.error(at, key, format!("{} numbers", items.len()), expected))
        }
    }
}

/// The type of a value with its article.
pub(crate) fn kind(value: &DeValue<'_>) -> String {
    match value.type_str() {
        kind @ ("integer" | "array") => format!("an {kind}"),
        kind => format!("a {kind}"),
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
                match std::fs::read_to_string(&file) {
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
