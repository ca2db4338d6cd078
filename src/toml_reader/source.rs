//! The text of a file and where things stand in it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use toml::Spanned;
use toml::de::DeTable;

use super::fault::{Fault, Place, Problem};
use crate::words::path_line;

/// Where every key that was read stands, by its full path.
pub(crate) type Places = BTreeMap<String, Place>;

/// How a room's complaints name a value that was found, and an element of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    /// As the file has it, elements by their index: `output.formats[0]: found "pgn"`.
    AsWritten,
    /// By its type, elements by their array's key: `channels: found an integer`.
    ByType,
}

/// A file's text with the starts of its lines.
pub(crate) struct Source<'a> {
    path: &'a Path,
    file: Arc<str>,
    text: &'a str,
    line_starts: Vec<usize>,
    offsets: RefCell<BTreeMap<String, usize>>,
    found: Found,
    /// The folder that relative paths start from.
    pub folder: &'a Path,
}

impl<'a> Source<'a> {
    /// `path` names the file in complaints, relative paths in it start from `folder`.
    pub fn new(path: &'a Path, folder: &'a Path, text: &'a str, found: Found) -> Self {
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { path, file: path_line(path).into(), text, line_starts, offsets: RefCell::default(), found, folder }
    }

    /// How found values are named.
    pub(super) fn found(&self) -> Found {
        self.found
    }

    /// The document's top table.
    pub fn parse(&self) -> Result<Spanned<DeTable<'a>>, Fault> {
        DeTable::parse(self.text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            self.fault(at, String::new(), Problem::Syntax(error.message().to_owned()))
        })
    }

    /// A complaint about `key`, which stands at byte `at`.
    pub(super) fn fault(&self, at: usize, key: String, problem: Problem) -> Fault {
        Fault { path: self.path.to_path_buf(), place: self.place(at), key, problem }
    }

    /// What is written in bytes `span`.
    #[cfg(feature = "measure")]
    pub(super) fn written(&self, span: std::ops::Range<usize>) -> &'a str {
        &self.text[span]
    }

    /// The place of byte `offset`; past the end is the end.
    pub fn place(&self, offset: usize) -> Place {
        let line = self.line_of(offset);
        self.place_in(line, self.chars(self.line_starts[line], offset))
    }

    /// Index of the line that byte `offset` is in.
    fn line_of(&self, offset: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= offset) - 1
    }

    /// Characters that begin in bytes `from..to` and end there.
    fn chars(&self, from: usize, to: usize) -> usize {
        let mut to = to.min(self.text.len());
        while !self.text.is_char_boundary(to) {
            to -= 1;
        }
        self.text[from..to].chars().count()
    }

    fn place_in(&self, line: usize, chars_before: usize) -> Place {
        Place { file: Arc::clone(&self.file), line: line as u32 + 1, column: chars_before as u32 + 1 }
    }

    /// Remembers that `key` stands at byte `offset`.
    pub(super) fn remember(&self, key: &str, offset: usize) {
        self.offsets.borrow_mut().entry(key.to_owned()).or_insert(offset);
    }

    /// The places of all remembered keys, in one sweep of the text: a line may hold a megabyte of them.
    pub fn into_places(self) -> Places {
        let mut keys: Vec<(String, usize)> = self.offsets.take().into_iter().collect();
        keys.sort_by_key(|&(_, offset)| offset);
        let (mut line, mut at, mut chars) = (0, 0, 0);
        let mut places = Places::new();
        for (key, offset) in keys {
            if self.line_of(offset) != line {
                line = self.line_of(offset);
                (at, chars) = (self.line_starts[line], 0);
            }
            chars += self.chars(at, offset);
            at = offset;
            places.insert(key, self.place_in(line, chars));
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let source = Source::new(Path::new("j.toml"), Path::new(""), "a = 1\nä = \"é\" x\n", Found::AsWritten);
        let at = |needle: &str| source.place(source.text.find(needle).unwrap()).to_string();
        assert_eq!(at("a"), "j.toml:1:1");
        assert_eq!(at("x"), "j.toml:2:9");
        assert_eq!(source.place(10_000).to_string(), "j.toml:3:1");
        assert_eq!(source.place(7).to_string(), "j.toml:2:1", "inside a character is that character");
    }

    #[test]
    fn one_sweep_finds_what_single_questions_find() {
        let source =
            Source::new(Path::new("j.toml"), Path::new(""), "a = 1\n\nä = [\"é\", 2]\nb = 3", Found::AsWritten);
        let offsets: Vec<usize> = source.text.char_indices().map(|(at, _)| at).rev().collect();
        offsets.iter().for_each(|&at| source.remember(&at.to_string(), at));
        let expected: Places = offsets.iter().map(|&at| (at.to_string(), source.place(at))).collect();
        assert_eq!(source.into_places(), expected);
    }
}
