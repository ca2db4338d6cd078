//! The text of a job file and where things stand in it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::error::{Place, one_line_path};

/// Where every key that was read stands, by its full path.
pub(super) type Places = BTreeMap<String, Place>;

/// A job's text with the starts of its lines.
pub(super) struct Source<'a> {
    file: Arc<str>,
    text: &'a str,
    line_starts: Vec<usize>,
    places: RefCell<Places>,
    /// The folder that relative paths start from.
    pub base_dir: &'a Path,
}

impl<'a> Source<'a> {
    pub fn new(path: &Path, text: &'a str, base_dir: &'a Path) -> Self {
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { file: one_line_path(path).into(), text, line_starts, places: RefCell::default(), base_dir }
    }

    /// The place of byte `offset`; past the end is the end.
    pub fn place(&self, offset: usize) -> Place {
        let offset = self.text.floor_char_boundary(offset);
        let line = self.line_starts.partition_point(|&start| start <= offset).max(1);
        let column = self.text[self.line_starts[line - 1]..offset].chars().count() + 1;
        Place { file: Arc::clone(&self.file), line: line as u32, column: column as u32 }
    }

    /// Remembers that `key` stands at byte `offset`.
    pub fn remember(&self, key: &str, offset: usize) {
        self.places.borrow_mut().entry(key.to_owned()).or_insert_with(|| self.place(offset));
    }

    pub fn into_places(self) -> Places {
        self.places.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let source = Source::new(Path::new("j.toml"), "a = 1\nä = \"é\" x\n", Path::new(""));
        let at = |needle: &str| source.place(source.text.find(needle).unwrap()).to_string();
        assert_eq!(at("a"), "j.toml:1:1");
        assert_eq!(at("x"), "j.toml:2:9");
        assert_eq!(source.place(10_000).to_string(), "j.toml:3:1");
        assert_eq!(source.place(7).to_string(), "j.toml:2:1", "inside a character is that character");
    }
}
