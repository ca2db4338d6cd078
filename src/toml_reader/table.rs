//! A table and its keys.

use std::marker::PhantomData;

use toml::Spanned;
use toml::de::DeTable;

use super::fault::{Fault, Problem};
use super::range::{IntRange, Range};
use super::source::Source;
use super::value::Value;
use crate::words::excerpt;

/// A table; complaints about it are of the type `E`.
pub(crate) struct Table<'a, E> {
    pub(super) source: &'a Source<'a>,
    /// What stands before each key in complaints, as `object[0].` or `resin white: `.
    pub prefix: String,
    /// Byte at which the table starts.
    pub start: usize,
    pub(super) entries: &'a DeTable<'a>,
    pub(super) error: PhantomData<fn() -> E>,
}

/// A value that has been read, and the byte it stands at.
#[derive(Debug, Clone)]
pub(crate) struct At<T> {
    /// What was read.
    pub value: T,
    /// Where it stands.
    pub at: usize,
}

/// Texts, and whether they stood in an array.
pub(crate) struct Strings {
    /// The texts.
    pub items: Vec<At<String>>,
    /// `false`: a single text.
    pub is_array: bool,
}

impl<'a, E: From<Fault>> Table<'a, E> {
    /// The whole document.
    pub fn root(source: &'a Source<'a>, document: &'a Spanned<DeTable<'a>>) -> Self {
        Self { source, prefix: String::new(), start: 0, entries: document.get_ref(), error: PhantomData }
    }

    /// The line the table starts in, from 1.
    pub fn line(&self) -> usize {
        self.source.place(self.start).line as usize
    }

    /// The key as complaints name it.
    fn label(&self, key: &str) -> String {
        let bare = !key.is_empty() && key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
        let key = if bare { excerpt(key) } else { format!("\"{}\"", excerpt(key)) };
        format!("{}{key}", self.prefix)
    }

    fn fault(&self, at: usize, key: &str, problem: Problem) -> E {
        self.source.fault(at, self.label(key), problem).into()
    }

    /// Refuses keys that are not among `known`; the first in the file is named.
    pub fn allow_only(&self, known: &[&str]) -> Result<(), E> {
        let Some((name, at)) = self.first_not_in(known) else { return Ok(()) };
        // What several kinds of a table share is told once.
        let firsts = (0..known.len()).filter(|&at| !known[..at].contains(&known[at]));
        let (label, known) = (self.label(&name), firsts.map(|at| known[at].to_owned()).collect());
        Err(self.source.fault(at, label, Problem::UnknownKey { prefix: self.prefix.clone(), name, known }).into())
    }

    /// The first key in the file that is not among `known`, and its place.
    pub fn first_not_in(&self, known: &[&str]) -> Option<(String, usize)> {
        let unknown = self.entries.keys().filter(|key| !known.contains(&key.get_ref().as_ref()));
        let first = unknown.min_by_key(|key| key.span().start)?;
        Some((first.get_ref().to_string(), first.span().start))
    }

    /// A complaint about what stands at byte `at` and belongs to `key`.
    pub fn error(&self, at: usize, key: &str, found: impl Into<String>, expected: impl Into<String>) -> E {
        self.fault(at, key, Problem::Value { found: found.into(), expected: expected.into() })
    }

    /// A complaint about a value out of range.
    pub fn wrong<T: std::fmt::Display>(&self, key: &str, found: &At<T>, expected: &str) -> E {
        self.error(found.at, key, found.value.to_string(), expected)
    }

    /// The value of `key`, if it is there.
    pub fn get(&self, key: &str) -> Option<Value<'a, E>> {
        let value = self.entries.get(key)?;
        Some(Value::new(self.source, self.label(key), value))
    }

    /// The value of `key`, which must be there.
    pub fn require(&self, key: &str, expected: &str) -> Result<Value<'a, E>, E> {
        self.get(key).ok_or_else(|| self.missing(key, expected))
    }

    /// The complaint that `key` is not there.
    pub fn missing(&self, key: &str, expected: &str) -> E {
        self.fault(self.start, key, Problem::Missing { expected: expected.to_owned() })
    }

    /// Refuses a table that has both keys.
    pub fn exclusive(&self, a: &str, b: &str) -> Result<(), E> {
        let (Some((a, _)), Some((b, _))) = (self.entries.get_key_value(a), self.entries.get_key_value(b)) else {
            return Ok(());
        };
        let (first, later) = if a.span().start < b.span().start { (a, b) } else { (b, a) };
        let other = first.get_ref().to_string();
        Err(self.fault(later.span().start, later.get_ref(), Problem::Conflict { other }))
    }

    /// The number under `key`, or `default`.
    pub fn number_or(&self, key: &str, default: f64, range: Range) -> Result<f64, E> {
        self.get(key).map_or(Ok(default), |value| value.number(range))
    }

    /// The whole number under `key`, or `default`.
    pub fn integer_or(&self, key: &str, default: u64, range: IntRange) -> Result<u64, E> {
        self.get(key).map_or(Ok(default), |value| value.integer(range))
    }

    /// The three numbers under `key`, or `default`.
    pub fn triple_or(&self, key: &str, default: [f64; 3], range: Range) -> Result<[f64; 3], E> {
        self.get(key).map_or(Ok(default), |value| value.triple(range))
    }

    /// The name under `key`, if it is there.
    pub fn name(&self, key: &str, what: &str) -> Result<Option<String>, E> {
        self.get(key).map(|value| value.name(what)).transpose()
    }

    /// The text under `key`, if it is there.
    pub fn string(&self, key: &str) -> Result<Option<At<String>>, E> {
        self.get(key).map(|value| value.placed_text("a string")).transpose()
    }

    /// One text or an array of them.
    pub fn strings(&self, key: &str) -> Result<Option<Strings>, E> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let expected = "a string or an array of strings";
        let is_array = value.is_list();
        let values = if is_array { value.list(expected)? } else { vec![value] };
        let items = values.iter().map(|value| value.placed_text(expected)).collect::<Result<_, E>>()?;
        Ok(Some(Strings { items, is_array }))
    }

    /// The number under `key`, if it is there.
    pub fn number(&self, key: &str) -> Result<Option<At<f64>>, E> {
        self.get(key).map(|value| value.placed_number("a number")).transpose()
    }

    /// An array of numbers.
    pub fn numbers(&self, key: &str) -> Result<Option<At<Vec<At<f64>>>>, E> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let items = value.list("an array of numbers")?;
        let numbers = items.iter().map(|item| item.placed_number("a number")).collect::<Result<_, E>>()?;
        Ok(Some(At { value: numbers, at: value.start() }))
    }

    /// One number for all channels, or an array of one per channel.
    pub fn per_channel(&self, key: &str, channels: usize) -> Result<Option<Vec<At<f64>>>, E> {
        let Some(value) = self.get(key) else { return Ok(None) };
        if !value.is_list() {
            let one = value.placed_number("a number, or an array of one per channel")?;
            return Ok(Some(vec![one; channels]));
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
