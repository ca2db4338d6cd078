//! Text as files hold it: line ends of three kinds, comments and continued lines.

use std::borrow::Cow;

use crate::encoding::{self, HalfCharacter};
pub(super) use crate::encoding::{is_utf_16, or_latin_1};
use crate::mesh::error::{Fault, Parsed};

/// The text of a file.
pub(super) fn decoded(bytes: &[u8]) -> Parsed<Cow<'_, [u8]>> {
    encoding::decoded(bytes).map_err(broken)
}

/// What is said of text that cannot be decoded.
pub(super) fn broken(HalfCharacter { offset }: HalfCharacter) -> Fault {
    Fault::new(format!("byte {offset}"), "half a character of UTF-16", "whole ones")
}

/// Where the first line ends, and where the next begins: at LF, CR or both together.
pub(super) fn line_end(bytes: &[u8]) -> Option<(usize, usize)> {
    let end = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'))?;
    Some((end, end + if bytes[end..].starts_with(b"\r\n") { 2 } else { 1 }))
}

/// Lines with their numbers from 1, without their ends.
#[derive(Debug, Clone)]
pub(super) struct Lines<'a> {
    rest: Option<&'a [u8]>,
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: Some(text).filter(|text| !text.is_empty()), number: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let text = self.rest?;
        self.number += 1;
        let (end, next) = line_end(text).unwrap_or((text.len(), text.len()));
        self.rest = text.get(next..).filter(|rest| !rest.is_empty());
        Some((self.number, &text[..end]))
    }
}

/// Statements of Wavefront's formats: a backslash at the end of a line joins the next, `#` begins a comment, which goes
/// to the end of its line and joins nothing.
///
/// A name may hold a `#`; lines with one of `names` keep what looks like a comment (see [`without_comment`]).
pub(super) struct Statements<'a> {
    lines: Lines<'a>,
    names: &'static [&'static str],
}

impl<'a> Statements<'a> {
    pub(super) fn new(text: &'a [u8], names: &'static [&'static str]) -> Self {
        Self { lines: Lines::new(text), names }
    }

    fn holds_name(&self, line: &[u8]) -> bool {
        let word = line.trim_ascii_start().split(u8::is_ascii_whitespace).next().unwrap_or(&[]);
        self.names.iter().any(|name| word.eq_ignore_ascii_case(name.as_bytes()))
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let (number, line) = self.lines.next()?;
        let named = self.holds_name(line);
        let mut statement = Cow::Borrowed(b"".as_slice());
        let mut next = Some(line);
        while let Some(line) = next.take() {
            let hash = line.iter().position(|&b| b == b'#');
            let line = match hash {
                Some(at) if !named && !line.trim_ascii_start().starts_with(POLYPAINT) => &line[..at],
                _ => line,
            };
            let line = line.trim_ascii_end();
            let (line, goes_on) = match line {
                [line @ .., b'\\'] if hash.is_none() => (line, true),
                _ => (line, false),
            };
            if statement.is_empty() && !goes_on {
                statement = Cow::Borrowed(line);
            } else {
                statement.to_mut().extend_from_slice(line);
            }
            if goes_on {
                statement.to_mut().push(b' ');
                next = self.lines.next().map(|(_, line)| line);
            }
        }
        Some((number, statement))
    }
}

/// ZBrush's vertex colours stand in comments of OBJ files.
pub(super) const POLYPAINT: &[u8] = b"#MRGB";

/// A name without what may be a comment behind it.
pub(super) fn without_comment(name: &str) -> &str {
    let starts = |&(at, _): &(usize, &str)| name[..at].ends_with(char::is_whitespace);
    name.match_indices('#').find(starts).map_or(name, |(at, _)| name[..at].trim_end())
}

/// A number, with an exponent as C or as Fortran writes it (`1.5D+01`); what C libraries write in place of one
/// (`-nan(ind)`, `1.#QNAN`) is none, and no fault of the text.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let word = std::str::from_utf8(word).ok()?;
    word.parse().ok().or_else(|| of_fortran(word)).or_else(|| is_c_nan(word).then_some(f64::NAN))
}

/// A number of double precision as Fortran writes it.
fn of_fortran(word: &str) -> Option<f64> {
    let (digits, exponent) = word.split_once(['d', 'D'])?;
    let exponent: i32 = exponent.parse().ok()?;
    let is_number = digits.ends_with(|c: char| c.is_ascii_digit() || c == '.');
    format!("{digits}e{exponent}").parse().ok().filter(|_| is_number)
}

/// Whether a word is C's `nan(…)`, or what Microsoft's library wrote before 2015: `1.#` and a name, filled up with
/// zeros, or cut to as many decimals as were asked for and its last letter rounded up like a digit (`1.#J`).
fn is_c_nan(word: &str) -> bool {
    const NAMES: [&str; 8] = ["ind", "qnan", "snan", "inf", "io", "qo", "j", "r"];
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word).to_ascii_lowercase();
    match unsigned.strip_prefix("1.#") {
        Some(name) => NAMES.contains(&name.trim_end_matches('0')),
        None => unsigned.starts_with("nan(") && unsigned.ends_with(')'),
    }
}

/// Whether a word is made of numbers and commas: a number with a decimal comma, as programs write that take their
/// user's for a German or French one, or a list's.
pub(super) fn has_comma(word: &[u8]) -> bool {
    let word = std::str::from_utf8(word).unwrap_or("");
    let parts = || word.split(',').filter(|part| !part.is_empty());
    let is_number = |part: &str| part == "+" || part == "-" || part.parse::<f64>().is_ok();
    word.contains(',') && parts().next().is_some() && parts().all(is_number)
}

/// Whether the comma of such a word is a decimal one, and not one that parts it from the next.
fn is_decimal(word: &[u8]) -> bool {
    let dotted = std::str::from_utf8(word).ok().filter(|word| word.matches(',').count() == 1 && !word.ends_with(','));
    dotted.is_some_and(|word| word.replace(',', ".").parse::<f64>().is_ok())
}

/// What was expected in place of this text, with a hint where it has commas.
pub(super) fn expected_number(text: &[u8], expected: &str) -> String {
    let words = || text.split(u8::is_ascii_whitespace).filter(|word| has_comma(word));
    match words().next() {
        None => expected.to_owned(),
        Some(_) if words().all(is_decimal) => {
            format!("{expected} (decimal commas are not read: export it with points)")
        }
        Some(_) => format!("{expected} (commas between numbers are not read: export it with blanks)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_for_no_number_is_none() {
        for word in
            ["nan", "-nan(ind)", "NaN", "NAN(snan)", "1.#QNAN", "-1.#IND00", "1.#SNAN0", "1.#INF", "1.#J", "1.#IO"]
        {
            assert!(number(word.as_bytes()).is_some_and(f64::is_nan), "{word}");
        }
        for word in ["nancy", "nan(", "nano)", "1.#house", "1.#", "1.#000", "1.#INDIA", "2.#IND"] {
            assert_eq!(number(word.as_bytes()), None, "{word}");
        }
        assert_eq!(
            ["1", "-.5e1", "+2", "x", "", "1,5"].map(|word| number(word.as_bytes())),
            [Some(1.0), Some(-5.0), Some(2.0), None, None, None]
        );
        assert_eq!(
            ["1.5D+01", "-2d-1", "1.d0", "d5", "1e2d3", "1D", "0x1d2", "d"].map(|word| number(word.as_bytes())),
            [Some(15.0), Some(-0.2), Some(1.0), None, None, None, None, None]
        );
    }

    #[test]
    fn numbers_with_commas_are_told() {
        for word in ["1,5", "-0,25", "+,5", "1,5e-3"] {
            assert!(has_comma(word.as_bytes()) && is_decimal(word.as_bytes()), "{word}");
        }
        for word in ["2,", "1.5,", "1,5,2", "1,5,", "1,234.5"] {
            assert!(has_comma(word.as_bytes()) && !is_decimal(word.as_bytes()), "{word}");
        }
        for word in ["1.5", "a,b", ",", "wood,1.png", ""] {
            assert!(!has_comma(word.as_bytes()), "{word}");
        }
        assert_eq!(expected_number(b"v 1.5 x", "numbers"), "numbers");
        for decimal in ["v 1,5 2", "0,5 0,25 0"] {
            assert!(expected_number(decimal.as_bytes(), "numbers").starts_with("numbers (decimal commas"), "{decimal}");
        }
        for list in ["v 1, 2, 3", "1, 0, 0", "v 1,2,3", "1,5, 2,5, 3", "1.5, 2"] {
            assert!(expected_number(list.as_bytes(), "numbers").starts_with("numbers (commas between"), "{list}");
        }
    }

    fn statements(text: &str) -> Vec<(usize, String)> {
        let statements = Statements::new(text.as_bytes(), &["usemtl"]);
        statements.map(|(number, line)| (number, String::from_utf8_lossy(&line).into_owned())).collect()
    }

    #[test]
    fn lines_end_in_three_ways() {
        for text in ["a\n\nb", "a\r\rb\r", "a\r\n\r\nb\r\n"] {
            let lines: Vec<_> = Lines::new(text.as_bytes()).collect();
            assert_eq!(lines, [(1, &b"a"[..]), (2, b""), (3, b"b")], "{text:?}");
        }
    }

    #[test]
    fn comments_end_statements_and_join_nothing() {
        assert_eq!(
            statements("f 1 2 \\\r\n 3 # quad \\\nv 1\n# C:\\\nf 2\\"),
            [(1, "f 1 2   3".into()), (3, "v 1".into()), (4, "".into()), (5, "f 2 ".into())]
        );
        assert_eq!(
            statements("usemtl red #1 # x\\\n#MRGB ff"),
            [(1, "usemtl red #1 # x\\".into()), (2, "#MRGB ff".into())]
        );
        assert_eq!(without_comment("red#1 # the door"), "red#1");
        assert_eq!(without_comment("red"), "red");
    }
}
