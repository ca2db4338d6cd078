//! One value, as a type and in a range.

use std::marker::PhantomData;
use std::ops::Range as Span;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeInteger, DeValue};

use super::fault::{Fault, Place, Problem};
use super::range::{IntRange, Range};
use super::source::{Found, Source};
use super::table::{At, Table};
use crate::words::{counted, excerpt, quoted_list, suggest};

/// A value; complaints about it are of the type `E`.
pub(crate) struct Value<'a, E> {
    source: &'a Source<'a>,
    key: String,
    span: Span<usize>,
    value: &'a DeValue<'a>,
    error: PhantomData<fn() -> E>,
}

impl<'a, E: From<Fault>> Value<'a, E> {
    pub(super) fn new(source: &'a Source<'a>, key: String, value: &'a Spanned<DeValue<'a>>) -> Self {
        source.remember(&key, value.span().start);
        Self { source, key, span: value.span(), value: value.get_ref(), error: PhantomData }
    }

    /// Its key with what stands before it, as complaints name it.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Where it stands.
    pub fn place(&self) -> Place {
        self.source.place(self.span.start)
    }

    /// The folder that relative paths start from.
    pub fn base(&self) -> &'a Path {
        self.source.folder
    }

    /// The byte it stands at.
    pub fn start(&self) -> usize {
        self.span.start
    }

    /// Its text in the file.
    #[cfg(feature = "measure")]
    pub fn written(&self) -> &'a str {
        self.source.written(self.span.clone())
    }

    /// The refusal of this value: what it is, and what was expected.
    pub fn refuse(&self, expected: impl Into<String>) -> E {
        let found = match self.source.found() {
            Found::AsWritten => describe(self.value),
            Found::ByType => kind(self.value),
        };
        self.refuse_as(found, expected)
    }

    /// The refusal of this value in the caller's words.
    pub fn refuse_as(&self, found: impl Into<String>, expected: impl Into<String>) -> E {
        let problem = Problem::Value { found: found.into(), expected: expected.into() };
        self.source.fault(self.span.start, self.key.clone(), problem).into()
    }

    /// The table it is; its keys are named by their path.
    pub fn table(&self) -> Result<Table<'a, E>, E> {
        self.table_as(format!("{}.", self.key), "a table")
    }

    /// The table it is, with what stands before its keys in complaints; `expected` says what it should be.
    pub fn table_as(&self, prefix: String, expected: &str) -> Result<Table<'a, E>, E> {
        match self.value {
            DeValue::Table(entries) => {
                Ok(Table { source: self.source, prefix, start: self.span.start, entries, error: PhantomData })
            }
            _ => Err(self.refuse(expected)),
        }
    }

    /// Whether it is an array.
    pub fn is_list(&self) -> bool {
        self.value.is_array()
    }

    /// The elements of an array; `expected` says what it should hold.
    pub fn list(&self, expected: &str) -> Result<Vec<Self>, E> {
        let key = |i: usize| match self.source.found() {
            Found::AsWritten => format!("{}[{i}]", self.key),
            Found::ByType => self.key.clone(),
        };
        match self.value {
            DeValue::Array(array) => {
                Ok(array.iter().enumerate().map(|(i, element)| Self::new(self.source, key(i), element)).collect())
            }
            _ => Err(self.refuse(expected)),
        }
    }

    /// The number it is, if it is one.
    pub fn as_number(&self) -> Option<f64> {
        match self.value {
            DeValue::Integer(integer) => i128_of(integer).map(|number| number as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => None,
        }
    }

    /// Any number, infinities and NaN too, and where it stands.
    pub fn placed_number(&self, expected: &str) -> Result<At<f64>, E> {
        let number = self.as_number().ok_or_else(|| self.refuse(expected))?;
        Ok(At { value: number, at: self.span.start })
    }

    /// Any text, and where it stands.
    pub fn placed_text(&self, expected: &str) -> Result<At<String>, E> {
        Ok(At { value: self.text(expected)?.to_owned(), at: self.span.start })
    }

    /// A finite number in `range`; whole numbers are numbers.
    pub fn number(&self, range: Range) -> Result<f64, E> {
        // Adding 0 turns −0 into 0, which a manifest would otherwise show as another job.
        self.as_number()
            .filter(|&number| range.contains(number))
            .map(|number| number + 0.0)
            .ok_or_else(|| self.refuse(range.to_string()))
    }

    /// A whole number in `range`, written without a point.
    pub fn integer(&self, range: IntRange) -> Result<u64, E> {
        let number = match self.value {
            DeValue::Integer(integer) => i128_of(integer).and_then(|number| u64::try_from(number).ok()),
            _ => None,
        };
        number.filter(|number| (range.min..=range.max).contains(number)).ok_or_else(|| self.refuse(range.to_string()))
    }

    /// `[x, y, z]`, each in `range`.
    pub fn triple(&self, range: Range) -> Result<[f64; 3], E> {
        let expected = format!("three numbers [x, y, z], each {range}");
        let list = self.list(&expected)?;
        let [x, y, z] = list.as_slice() else { return Err(self.refuse(expected)) };
        Ok([x.number(range)?, y.number(range)?, z.number(range)?])
    }

    /// `true` or `false`.
    pub fn truth(&self) -> Result<bool, E> {
        match self.value {
            DeValue::Boolean(truth) => Ok(*truth),
            _ => Err(self.refuse("true or false")),
        }
    }

    /// Any text.
    pub fn text(&self, expected: &str) -> Result<&'a str, E> {
        match self.value {
            DeValue::String(text) => Ok(text.as_ref()),
            _ => Err(self.refuse(expected)),
        }
    }

    /// Text that is not blank, without blanks around it; `what` says what it names.
    pub fn name(&self, what: &str) -> Result<String, E> {
        let expected = format!("the name of {what}");
        let name = self.text(&expected)?.trim();
        if name.is_empty() { Err(self.refuse(expected)) } else { Ok(name.to_owned()) }
    }

    /// One of the words in `choices`, as the value beside it.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, E> {
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

/// The type of a value with its article.
fn kind(value: &DeValue<'_>) -> String {
    match value.type_str() {
        kind @ ("integer" | "array") => format!("an {kind}"),
        kind => format!("a {kind}"),
    }
}
