//! Typed reading of TOML that remembers where everything stands, so that every refusal can say so.

use std::ops::Range as Span;

use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue};

use super::error::JobError;
use super::ranges::{IntRange, Range};
use super::source::Source;
use crate::words::{counted, excerpt, hint, quoted_list, suggest};

pub(super) type Result<T> = std::result::Result<T, JobError>;

/// A table of the job, known by its full path.
pub(super) struct Table<'a> {
    source: &'a Source<'a>,
    path: String,
    span: Span<usize>,
    entries: &'a DeTable<'a>,
}

/// A value of the job, known by its full path.
pub(super) struct Value<'a> {
    pub source: &'a Source<'a>,
    path: String,
    span: Span<usize>,
    value: &'a DeValue<'a>,
}

impl<'a> Table<'a> {
    /// The whole document.
    pub fn root(source: &'a Source<'a>, document: &'a Spanned<DeTable<'a>>) -> Self {
        Self { source, path: String::new(), span: 0..0, entries: document.get_ref() }
    }

    fn path_of(&self, key: &str) -> String {
        let bare = !key.is_empty() && key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
        let key = if bare { excerpt(key) } else { format!("\"{}\"", excerpt(key)) };
        if self.path.is_empty() { key } else { format!("{}.{key}", self.path) }
    }

    /// Refuses keys that are not among `known`; the first in the file is named.
    pub fn allow_only(&self, known: &[&str]) -> Result<()> {
        self.first_not_in(known).map_or(Ok(()), |(key, at)| {
            let hint = hint(&key, known.iter().copied());
            Err(JobError::UnknownKey { place: self.source.place(at), key: self.path_of(&key), hint })
        })
    }

    /// The first key in the file that is not among `known`, and its place.
    pub fn first_not_in(&self, known: &[&str]) -> Option<(String, usize)> {
        let unknown = self.entries.keys().filter(|key| !known.contains(&key.get_ref().as_ref()));
        let first = unknown.min_by_key(|key| key.span().start)?;
        Some((first.get_ref().to_string(), first.span().start))
    }

    /// An error about the key at `at`.
    pub fn misplaced(&self, key: &str, at: usize, found: String, expected: String) -> JobError {
        JobError::Value { place: self.source.place(at), key: self.path_of(key), found, expected }
    }

    /// The value of `key`, if it is there.
    pub fn get(&self, key: &str) -> Option<Value<'a>> {
        let value = self.entries.get(key)?;
        Some(Value::new(self.source, self.path_of(key), value))
    }

    /// The value of `key`, which must be there.
    pub fn require(&self, key: &str, expected: &str) -> Result<Value<'a>> {
        self.get(key).ok_or_else(|| self.missing(key, expected))
    }

    /// The error that `key` is not there.
    pub fn missing(&self, key: &str, expected: &str) -> JobError {
        JobError::Missing {
            place: self.source.place(self.span.start),
            key: self.path_of(key),
            expected: expected.to_owned(),
        }
    }

    /// Refuses a table that has both keys.
    pub fn exclusive(&self, a: &str, b: &str) -> Result<()> {
        let (Some((a, _)), Some((b, _))) = (self.entries.get_key_value(a), self.entries.get_key_value(b)) else {
            return Ok(());
        };
        let (first, later) = if a.span().start < b.span().start { (a, b) } else { (b, a) };
        Err(JobError::Conflict {
            place: self.source.place(later.span().start),
            key: self.path_of(later.get_ref()),
            other: first.get_ref().to_string(),
        })
    }

    /// The number under `key`, or `default`.
    pub fn number_or(&self, key: &str, default: f64, range: Range) -> Result<f64> {
        self.get(key).map_or(Ok(default), |value| value.number(range))
    }

    /// The whole number under `key`, or `default`.
    pub fn integer_or(&self, key: &str, default: u64, range: IntRange) -> Result<u64> {
        self.get(key).map_or(Ok(default), |value| value.integer(range))
    }

    /// The three numbers under `key`, or `default`.
    pub fn triple_or(&self, key: &str, default: [f64; 3], range: Range) -> Result<[f64; 3]> {
        self.get(key).map_or(Ok(default), |value| value.triple(range))
    }

    /// The name under `key`, if it is there.
    pub fn name(&self, key: &str, what: &str) -> Result<Option<String>> {
        self.get(key).map(|value| value.name(what)).transpose()
    }
}

impl<'a> Value<'a> {
    fn new(source: &'a Source<'a>, path: String, value: &'a Spanned<DeValue<'a>>) -> Self {
        source.remember(&path, value.span().start);
        Self { source, path, span: value.span(), value: value.get_ref() }
    }

    pub fn path(&self) -> &str {
        &self.path
    }

    pub fn place(&self) -> super::Place {
        self.source.place(self.span.start)
    }

    /// The refusal of this value: what it is, and what was expected.
    pub fn refuse(&self, expected: impl Into<String>) -> JobError {
        self.refuse_as(describe(self.value), expected)
    }

    /// The refusal of this value in the caller's words.
    pub fn refuse_as(&self, found: impl Into<String>, expected: impl Into<String>) -> JobError {
        JobError::Value { place: self.place(), key: self.path.clone(), found: found.into(), expected: expected.into() }
    }

    /// The refusal of a name that nothing bears.
    pub fn unknown(&self, kind: &'static str, found: &str, hint: String) -> JobError {
        let found = excerpt(found);
        JobError::UnknownName { place: self.place(), key: self.path.clone(), kind, found, hint }
    }

    pub fn table(&self) -> Result<Table<'a>> {
        match self.value {
            DeValue::Table(entries) => {
                Ok(Table { source: self.source, path: self.path.clone(), span: self.span.clone(), entries })
            }
            _ => Err(self.refuse("a table")),
        }
    }

    /// The elements of an array; `expected` says what it should hold.
    pub fn list(&self, expected: &str) -> Result<Vec<Value<'a>>> {
        match self.value {
            DeValue::Array(array) => Ok(array
                .iter()
                .enumerate()
                .map(|(i, element)| Value::new(self.source, format!("{}[{i}]", self.path), element))
                .collect()),
            _ => Err(self.refuse(expected)),
        }
    }

    /// A finite number in `range`; whole numbers are numbers.
    pub fn number(&self, range: Range) -> Result<f64> {
        let number = match self.value {
            DeValue::Integer(integer) => i128_of(integer).map(|number| number as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => None,
        };
        // Adding 0 turns −0 into 0, which a manifest would otherwise show as another job.
        number
            .filter(|&number| range.contains(number))
            .map(|number| number + 0.0)
            .ok_or_else(|| self.refuse(range.to_string()))
    }

    /// A whole number in `range`, written without a point.
    pub fn integer(&self, range: IntRange) -> Result<u64> {
        let number = match self.value {
            DeValue::Integer(integer) => i128_of(integer).and_then(|number| u64::try_from(number).ok()),
            _ => None,
        };
        number.filter(|number| (range.min..=range.max).contains(number)).ok_or_else(|| self.refuse(range.to_string()))
    }

    /// `[x, y, z]`, each in `range`.
    pub fn triple(&self, range: Range) -> Result<[f64; 3]> {
        let expected = format!("three numbers [x, y, z], each {range}");
        let list = self.list(&expected)?;
        let [x, y, z] = list.as_slice() else { return Err(self.refuse(expected)) };
        Ok([x.number(range)?, y.number(range)?, z.number(range)?])
    }

    /// `true` or `false`.
    pub fn truth(&self) -> Result<bool> {
        match self.value {
            DeValue::Boolean(truth) => Ok(*truth),
            _ => Err(self.refuse("true or false")),
        }
    }

    /// Any text.
    pub fn text(&self, expected: &str) -> Result<&'a str> {
        match self.value {
            DeValue::String(text) => Ok(text.as_ref()),
            _ => Err(self.refuse(expected)),
        }
    }

    /// Text that is not blank, without blanks around it; `what` says what it names.
    pub fn name(&self, what: &str) -> Result<String> {
        let expected = format!("the name of {what}");
        let name = self.text(&expected)?.trim();
        if name.is_empty() { Err(self.refuse(expected)) } else { Ok(name.to_owned()) }
    }

    /// One of the words in `choices`, as the value beside it.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T> {
        let words = choices.iter().map(|&(word, _)| word);
        let expected = || format!("one of {}", quoted_list(words.clone()));
        let found = match self.value {
            DeValue::String(text) => text.as_ref(),
            _ => return Err(self.refuse(expected())),
        };
        choices.iter().find(|(word, _)| *word == found).map(|&(_, choice)| choice).ok_or_else(|| {
            match suggest(found, words.clone()) {
                Some(near) => self.refuse(format!("{}; did you mean `{near}`?", expected())),
                None => self.refuse(expected()),
            }
        })
    }
}

fn i128_of(integer: &DeInteger<'_>) -> Option<i128> {
    i128::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A value as an error message names it.
fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("\"{}\"", excerpt(text)),
        DeValue::Integer(integer) => excerpt(&integer.to_string()),
        DeValue::Float(float) => excerpt(float.as_str()),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(time) => format!("the date or time {time}"),
        DeValue::Array(array) => match array.iter().len() {
            0 => "an empty array".to_owned(),
            n => format!("an array of {}", counted(n, "value")),
        },
        DeValue::Table(_) => "a table".to_owned(),
    }
}
