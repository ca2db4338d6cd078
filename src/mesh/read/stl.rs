//! STL, binary and text.
//!
//! The two are told apart by size and content, not by the word "solid" alone: binary files begin with it too, and a
//! binary file's length follows from its count (84 + 50·n). Of a text file the words count, not its lines. It may hold
//! several solids. Normals are ignored: they follow from the order of corners. Colours that Magics and VisCAM keep in a
//! binary file are told of and not read.

use glam::DVec3;

use super::Source;
use super::raw::{RawMesh, finite};
use super::text::{self, Lines, expected_number};
use crate::encoding::decoded;
use crate::mesh::bounds;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

const HEADER: usize = 84;
const RECORD: usize = 50;
/// Where a text must have come to a facet, or to its end: names and comments before it are shorter.
const TEXT_PROBE: usize = 1 << 16;
/// How far from the triangles that the header counts others may lie, in diagonals of the box around them: the first
/// triangle of a mesh may be a thousandth of it. Of random bits about 1 triangle in 200 lies within.
const REACH: f64 = 1e3;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let bytes = source.bytes;
    let count = bytes.get(80..HEADER).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let exact = count.is_some_and(|n| bytes.len() == HEADER + RECORD * n && n > 0);
    if !exact {
        match decoded(bytes) {
            Ok(decoded) if is_text(&decoded) => return text(&decoded),
            // The text before the place is whole.
            Err(broken) if decoded(&bytes[..broken.offset]).is_ok_and(|start| is_text(&start)) => {
                return Err(text::broken(broken));
            }
            _ => {}
        }
    }
    let Some(count) = count else {
        let found = format!("{} bytes that begin with {}", bytes.len(), quote(bytes));
        return Err(Fault::new("the header", found, "`solid` or a header of 84 bytes"));
    };
    binary(bytes, count)
}

/// Whether the file's first words are a text's: `solid` or a facet, and then one that only a text has. A binary header
/// may say the same, but no binary file goes on in characters alone.
fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(TEXT_PROBE)];
    let mut words = Words::new(head);
    let Some((_, first)) = words.next() else { return false };
    if !["solid", "facet", "facetnormal"].iter().any(|word| first.eq_ignore_ascii_case(word.as_bytes())) {
        return false;
    }
    let has_text_word = words.any(|(_, word)| {
        ["facet", "facetnormal", "normal", "vertex", "endsolid", "end"]
            .iter()
            .any(|other| word.eq_ignore_ascii_case(other.as_bytes()))
    });
    // Records of floats are full of control characters; a text may be padded with zeros at its end.
    let body = head.get(..head.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1)).unwrap_or(head);
    let odd = body.iter().filter(|&&b| b < 32 && !b.is_ascii_whitespace() && b != 0x1a).count();
    (has_text_word || !bytes.contains(&0)) && odd * 50 <= body.len()
}

fn binary(bytes: &[u8], claimed: usize) -> Parsed<RawMesh> {
    let body = &bytes[HEADER..];
    let mut raw = RawMesh::new(1.0);
    let mut count = claimed;
    // Writers that stream cannot go back to fill in the count, and others count before they are done.
    let room = body.len() / RECORD;
    let goes_on = || claimed == 0 || are_triangles(body, claimed);
    if claimed < room && body.len().is_multiple_of(RECORD) && goes_on() {
        count = room;
        let counts = counted(claimed, "triangle");
        raw.warnings.push(format!("the header counts {counts}; all {count} that the file has room for are read"));
    }
    if body.len() / RECORD < count {
        let found = format!("{} bytes after a header that claims {count} triangles", body.len());
        return Err(Fault::new("byte 80", found, format!("{} bytes", RECORD * count)));
    }
    if body.len() > RECORD * count {
        raw.warnings.push(format!("{} after the last triangle ignored", counted(body.len() - RECORD * count, "byte")));
    }
    raw.positions.reserve(3 * count);
    raw.triangles.reserve(count);
    for (t, record) in body.chunks_exact(RECORD).take(count).enumerate() {
        for i in 0..3 {
            raw.positions.push(finite(corner(record, i), || format!("triangle {t}"))?);
        }
        push_last_three(&mut raw, || format!("triangle {t}"))?;
    }
    if let Some(whose) = colors_of(&bytes[..80], body.chunks_exact(RECORD).take(count)) {
        raw.lose_color(format!("the colours of faces, as {whose} keeps them in an STL, are not read"));
    }
    Ok(raw)
}

/// Whose way of keeping colours a binary file follows, 15 bits in the last two bytes of a record: Magics names a colour
/// for all in the header, and clears the highest bit where a face has its own; VisCAM sets that bit. White is no
/// colour.
fn colors_of<'r>(header: &[u8], mut records: impl Iterator<Item = &'r [u8]>) -> Option<&'static str> {
    const WHITE: u16 = 0x7fff;
    const VALID: u16 = 0x8000;
    let attribute = |record: &[u8]| u16::from_le_bytes([record[RECORD - 2], record[RECORD - 1]]);
    if let Some(at) = header.windows(6).position(|word| word == b"COLOR=") {
        let all_are_white = header[at + 6..].iter().take(3).all(|&byte| byte == 255);
        let has_its_own = |record: &[u8]| attribute(record) & VALID == 0 && attribute(record) != WHITE;
        return (!all_are_white || records.any(has_its_own)).then_some("Magics");
    }
    records.any(|record| attribute(record) & VALID != 0 && attribute(record) != VALID | WHITE).then_some("VisCAM")
}

/// Corner `i` of a record.
fn corner(record: &[u8], i: usize) -> DVec3 {
    let at = |axis: usize| {
        let from = 12 + 12 * i + 4 * axis;
        f64::from(f32::from_le_bytes([record[from], record[from + 1], record[from + 2], record[from + 3]]))
    };
    DVec3::new(at(0), at(1), at(2))
}

/// Whether records that the header does not count hold triangles of the same mesh, up to the last, and not what a
/// writer or a disk filled up with, or a text.
fn are_triangles(body: &[u8], claimed: usize) -> bool {
    let records = || body.chunks_exact(RECORD);
    let corners = |record: &[u8]| [0, 1, 2].map(|i| corner(record, i));
    let (low, high) = bounds(&records().take(claimed).flat_map(corners).collect::<Vec<_>>());
    let reach = DVec3::splat(REACH * (high - low).length());
    let is_near = |p: DVec3| p.cmpge(low - reach).all() && p.cmple(high + reach).all();
    let is_text = |record: &[u8]| record.iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace());
    let is_triangle = |record: &[u8]| !is_text(record) && corners(record).into_iter().all(is_near);
    let ends = |[a, b, c]: [DVec3; 3]| a != b && b != c && c != a;
    records().last().map(corners).is_some_and(ends) && records().skip(claimed).all(is_triangle)
}

/// Words with the numbers of their lines; `#` begins a comment, `solid` and `endsolid` take a name up to the end of
/// their line.
#[derive(Clone)]
struct Words<'a> {
    lines: Lines<'a>,
    number: usize,
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self { lines: Lines::new(text), number: 1, rest: &[] }
    }

    /// Skips a solid's name. A line that goes on with a facet holds no more of it.
    fn skip_name(&mut self) {
        let mut ahead = self.clone();
        ahead.lines = Lines::new(&[]);
        let mut before = ahead.clone();
        while let Some((_, word)) = ahead.next() {
            let mut follow = ahead.clone().map(|(_, word)| word.to_ascii_lowercase());
            let begins = match word.to_ascii_lowercase().as_slice() {
                b"facet" => follow.next().as_deref() == Some(b"normal"),
                other => other == b"facetnormal",
            };
            // A number, or one that is none, or nothing more on the line.
            let goes_on = |word: Vec<u8>| !word[0].is_ascii_alphabetic() || is_number_or_loop(&word);
            let starts = begins && follow.next().is_none_or(goes_on);
            if starts || word.eq_ignore_ascii_case(b"endsolid") {
                self.rest = before.rest;
                return;
            }
            before = ahead.clone();
        }
        self.rest = &[];
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let is_blank = |b: &u8| b.is_ascii_whitespace() || *b == 0 || *b == 0x1a;
        loop {
            let start = self.rest.iter().position(|b| !is_blank(b)).unwrap_or(self.rest.len());
            let rest = &self.rest[start..];
            if rest.is_empty() || rest[0] == b'#' {
                (self.number, self.rest) = self.lines.next()?;
                continue;
            }
            let end = rest.iter().position(|b| is_blank(b) || *b == b'#').unwrap_or(rest.len());
            self.rest = &rest[end..];
            return Some((self.number, &rest[..end]));
        }
    }
}

fn text(bytes: &[u8]) -> Parsed<RawMesh> {
    let mut raw = RawMesh::new(1.0);
    // Line of the facet being read.
    let mut facet: Option<usize> = None;
    let mut corners = 0;
    let mut solid_open = false;
    let mut solids = 0;
    let mut words = Words::new(bytes);
    while let Some((number, word)) = words.next() {
        let place = || format!("line {number}");
        let mut keyword = word.to_ascii_lowercase();
        if keyword == b"end" {
            // `end solid` and its like, in two words.
            keyword.extend(words.next().map(|(_, word)| word.to_ascii_lowercase()).unwrap_or_default());
        }
        match (keyword.as_slice(), facet) {
            (b"solid", None) => {
                solid_open = true;
                solids += 1;
                words.skip_name();
            }
            (b"endsolid", None) => {
                solid_open = false;
                words.skip_name();
            }
            (b"facet" | b"facetnormal", before) if before.is_none() || corners == 3 => {
                // An endfacet says nothing that three corners do not.
                if before.is_some() {
                    push_last_three(&mut raw, place)?;
                }
                (facet, corners) = (Some(number), 0);
                skip_normal(&mut words, keyword == b"facetnormal");
            }
            (b"outer" | b"loop" | b"outerloop" | b"endloop", Some(_)) => {}
            (b"vertex", Some(_)) if corners < 3 => {
                let mut p = [0.0; 3];
                let mut said = word.to_vec();
                for value in &mut p {
                    let word = words.next().map(|(_, word)| word);
                    said.extend([b" ", word.unwrap_or_default()].concat());
                    *value = word.and_then(text::number).ok_or_else(|| {
                        let expected = expected_number(&said, "`vertex x y z` with three numbers");
                        Fault::new(place(), quote(&said), expected)
                    })?;
                }
                raw.positions.push(finite(DVec3::from_array(p), place)?);
                corners += 1;
            }
            (b"endfacet", Some(_)) if corners == 3 => {
                push_last_three(&mut raw, place)?;
                facet = None;
            }
            (_, Some(start)) => {
                let expected = format!("corner {} of the facet begun in line {start}", (corners + 1).min(3));
                let expected = if corners == 3 { "endloop and endfacet".to_owned() } else { expected };
                return Err(Fault::new(place(), quote(word), expected));
            }
            (_, None) => return Err(Fault::new(place(), quote(word), "solid, facet or endsolid")),
        }
    }
    raw.note_besides(solids, "solid");
    if facet.is_some() {
        return Err(Fault::new(format!("line {}", words.number), "the end of the file", "endfacet and endsolid"));
    }
    if solid_open && !raw.triangles.is_empty() {
        raw.warnings.push("there is no endsolid: the file may be cut off".to_owned());
    }
    Ok(raw)
}

/// Whether a word that begins with a letter stands for a number, or begins a loop.
fn is_number_or_loop(word: &[u8]) -> bool {
    [&b"nan"[..], b"inf", b"outer", b"vertex"].iter().any(|start| word.starts_with(start))
}

/// Skips `normal` (unless `is_begun`) and what stands for its numbers, which some writers make of words, up to the
/// loop.
fn skip_normal(words: &mut Words, is_begun: bool) {
    let mut ahead = words.clone();
    if !is_begun {
        if !ahead.next().is_some_and(|(_, word)| word.eq_ignore_ascii_case(b"normal")) {
            return;
        }
        *words = ahead.clone();
    }
    let ends =
        |word: &[u8]| ["outer", "outerloop", "vertex"].iter().any(|end| word.eq_ignore_ascii_case(end.as_bytes()));
    for _ in 0..3 {
        match ahead.next() {
            Some((_, word)) if !ends(word) => *words = ahead.clone(),
            _ => return,
        }
    }
}

fn push_last_three(raw: &mut RawMesh, place: impl Fn() -> String) -> Parsed<()> {
    // Positions stay below 3 · MAX_TRIANGLES, far from u32's limit.
    let end = raw.positions.len() as u32;
    raw.push(place, [end - 3, end - 2, end - 1], None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of triangles in steps of 1 along x, each 1 mm wide but for the first.
    fn records(first: f32, count: usize) -> Vec<u8> {
        let mut body = Vec::new();
        for t in 0..count {
            let (x, side) = (t as f32, if t == 0 { first } else { 1.0 });
            let numbers = [0.0, 0.0, 1.0, x, 0.0, 0.0, x + side, 0.0, 0.0, x, side, 0.0];
            body.extend(numbers.iter().flat_map(|n: &f32| n.to_le_bytes()));
            body.extend([0; 2]);
        }
        body
    }

    #[test]
    fn what_follows_the_counted_triangles_is_triangles_or_not() {
        // The rest of a mesh, though the header counts a small triangle alone, and others are far away.
        assert!(are_triangles(&records(1.0, 12), 11) && are_triangles(&records(0.01, 12), 1));
        let tail = |bytes: &[u8]| are_triangles(&[records(1.0, 12), bytes.to_vec()].concat(), 12);
        let text = b"Exported with a program that signs what it writes.";
        assert_eq!(text.len(), RECORD);
        assert!(!tail(text) && !tail(&[b'7'; 50]) && !tail(&text.repeat(3)));
        // The first 50 letters and a zero at the end are no triangle either: they would be 1e20 mm away.
        let ended: Vec<u8> = text[..49].iter().copied().chain([0]).collect();
        assert!(corner(&ended, 0).abs().max_element() > 1e15);
        assert!(!tail(&ended) && !tail(&[0; 50]) && !tail(&[0xff; 50]));
        assert!(tail(&records(2.0, 1)));
    }
}
