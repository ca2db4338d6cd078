//! What messages are made of: counts, foreign text made fit for a line, and "did you mean …?".
//!
//! Every room words its own messages; what all of them need stands here, below all rooms.

use std::{fmt::Display, path::Path};

/// `1 hole`, `5 holes`.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// `512 voxels`, `8.000 k voxels`, `1.770 G voxels`.
pub fn voxels(count: u64) -> String {
    match count as f64 {
        count if count < 1e3 => counted(count as usize, "voxel"),
        count if count < 1e6 => format!("{:.3} k voxels", count * 1e-3),
        count if count < 1e9 => format!("{:.3} M voxels", count * 1e-6),
        count if count < 1e12 => format!("{:.3} G voxels", count * 1e-9),
        count => format!("{:.3} T voxels", count * 1e-12),
    }
}

/// A number for people, as short as nine digits allow: what rounding left behind them is no news. Very large and very
/// small ones have an exponent.
pub fn short(value: f64) -> String {
    let value = format!("{value:.8e}").parse().unwrap_or(value);
    // What rounds to zero has no sign.
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e9).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Lengths along x, y and z: `0.1 × 0.1 × 0.027`.
pub fn dimensions(lengths: [f64; 3]) -> String {
    lengths.map(short).join(" × ")
}

/// A time in the unit that it is told in: `under 1 s`, `40 s`, `5 min`, `2.5 h`.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "under 1 s".to_owned(),
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// `1 edge is`, `2 edges are`.
pub(crate) fn is_are(count: usize, noun: &str) -> String {
    format!("{} {}", counted(count, noun), if count == 1 { "is" } else { "are" })
}

/// `1 shell was`, `2 shells were`.
pub(crate) fn was_were(count: usize, noun: &str) -> String {
    format!("{} {}", counted(count, noun), if count == 1 { "was" } else { "were" })
}

/// A number with its sign and so many decimals; what rounds to zero has none.
pub fn signed(value: f64, decimals: usize) -> String {
    without_sign_of_zero(format!("{value:+.decimals$}"))
}

/// A number's text; what rounded to zero loses its sign.
pub fn without_sign_of_zero(text: String) -> String {
    match text.strip_prefix(['+', '-']) {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

/// The text with control characters written out (`\n`, `\u{1b}`), which would break a line or steer a terminal.
pub fn escaped(text: &str) -> String {
    escaped_but(text, |_| false)
}

/// Lines of text for a terminal: [`escaped`], but for the ends of its lines and tabulators.
pub fn escaped_lines(text: &str) -> String {
    escaped_but(text, |c| matches!(c, '\n' | '\t'))
}

fn escaped_but(text: &str, kept: impl Fn(char) -> bool) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if (c.is_control() || turns_the_line(c)) && !kept(c) { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

/// Marks that turn the direction of what follows, or break a line: what is shown is not what stands there.
fn turns_the_line(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Most characters of a found text that a message repeats.
const MAX_QUOTED: usize = 60;

/// What a message repeats of a found text: one line, cut where it grows long, without quotes.
pub(crate) fn excerpt(text: &str) -> String {
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => escaped(&text[..end]) + "…",
        None => escaped(text),
    }
}

/// A path on one line, never cut.
pub(crate) fn path_line(path: &Path) -> String {
    escaped(&path.to_string_lossy())
}

/// A foreign error's message on one line, blanks folded.
pub(crate) fn one_line(error: impl Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Longest part of a file's name that users choose, bytes: leaves room for prefixes and suffixes in the 255 bytes that
/// file systems give a name.
pub(crate) const MAX_FILE_NAME: usize = 200;

/// Whether Windows takes a file of this name for a device, whatever follows its first dot.
pub(crate) fn is_device_name(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_lowercase();
    match stem.strip_prefix("com").or(stem.strip_prefix("lpt")) {
        Some(digit) => digit.len() == 1 && digit.bytes().all(|byte| (b'1'..=b'9').contains(&byte)),
        None => ["con", "prn", "aux", "nul"].contains(&stem.as_str()),
    }
}

/// A text as TOML has it, in quotes.
pub(crate) fn toml_string(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// `"a", "b", "c"`.
pub(crate) fn quoted_list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    format!("\"{}\"", names.into_iter().collect::<Vec<_>>().join("\", \""))
}

/// Names at most this share of the longer one's length apart (in edits) count as a slip of the pen: `heigth-mm`,
/// `j750-27`. One edit is always allowed, so that two-letter names can be mistyped too.
const MAX_EDITS_PER_CHAR: f64 = 0.34;

/// The name in `known` nearest to `word` by Damerau–Levenshtein distance, case ignored; the first one on a tie,
/// `None` when nothing is near.
pub(crate) fn suggest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Far longer words cannot be near; measuring them would cost the product of the lengths.
    const LONGEST: usize = 64;
    if word.len() > LONGEST {
        return None;
    }
    let word = word.to_lowercase();
    let mut best: Option<(usize, &str)> = None;
    for name in known {
        let edits = strsim::damerau_levenshtein(&word, &name.to_lowercase());
        let length = word.chars().count().max(name.chars().count());
        let allowed = ((length as f64 * MAX_EDITS_PER_CHAR) as usize).max(1);
        if edits <= allowed && best.is_none_or(|(fewest, _)| edits < fewest) {
            best = Some((edits, name));
        }
    }
    best.map(|(_, name)| name)
}

/// Units of length that names may end in, with their mm; ours all end in `-mm`.
const UNITS: [(&str, f64); 9] = [
    ("in", 25.4),
    ("inch", 25.4),
    ("inches", 25.4),
    ("ft", 304.8),
    ("cm", 10.0),
    ("dm", 100.0),
    ("m", 1000.0),
    ("um", 0.001),
    ("micron", 0.001),
];

/// Of `height-in` the name in mm, `height-mm`, and what 1 of its own unit is: "1 in is 25.4 mm". `None` of a name that
/// ends in no other unit of length.
pub fn in_mm(word: &str) -> Option<(String, String)> {
    let (stem, unit) = word.rsplit_once(['-', '_'])?;
    let (unit, mm) = UNITS.iter().find(|known| known.0.eq_ignore_ascii_case(unit))?;
    let unit = if unit.starts_with("in") { "in" } else { unit };
    Some((format!("{stem}-mm"), format!("1 {unit} is {mm} mm")))
}

/// A hint for an unknown name: "did you mean `x`?", or else the list of what is known.
pub(crate) fn hint<'a>(word: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some((name, rate)) = in_mm(word)
        && known.clone().into_iter().any(|known| known == name)
    {
        return format!("lengths are in mm: `{name}`, {rate}");
    }
    match suggest(word, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => {
            let names: Vec<&str> = known.into_iter().collect();
            if names.is_empty() { "none is known".to_owned() } else { format!("expected one of {}", names.join(", ")) }
        }
    }
}

/// A digest as files have it: two small hexadecimal digits a byte.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        let words = [0.0004, -0.0004, -0.0006, 1.5].map(|value| signed(value, 3));
        assert_eq!(words, ["0.000", "0.000", "-0.001", "+1.500"]);
    }

    #[test]
    fn numbers_have_no_rounding_behind_them() {
        let told = [
            (6000.0 * 25.4 - 3e-11, "152400"),
            (0.1 + 0.2, "0.3"),
            (25.4 / 300.0, "0.0846666667"),
            (-0.0, "0"),
            (1.5e-7, "1.5e-7"),
            (1e300, "1e300"),
            (-4.0, "-4"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ];
        told.into_iter().for_each(|(value, words)| assert_eq!(short(value), words));
        assert_eq!(dimensions([0.1, 0.3 - 0.2, 0.027]), "0.1 × 0.1 × 0.027");
    }

    #[test]
    fn times_are_told_in_their_unit() {
        let words = [0.2, 41.6, 89.4, 299.0, 9000.0].map(duration);
        assert_eq!(words, ["under 1 s", "42 s", "89 s", "5 min", "2.5 h"]);
    }

    #[test]
    fn one_is_not_many() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "hole")), ["0 holes", "1 hole", "2 holes"]);
        assert_eq!([is_are(1, "edge"), was_were(2, "shell")], ["1 edge is", "2 shells were"]);
    }

    #[test]
    fn found_text_stays_on_its_line() {
        assert_eq!(escaped("a\u{1b}[31m\nµ"), "a\\u{1b}[31m\\nµ");
        assert_eq!(escaped_lines("a\u{1b}[31m\n\tµ"), "a\\u{1b}[31m\n\tµ");
        assert_eq!(escaped("a\u{202e}b"), "a\\u{202e}b");
        assert!(is_device_name("NUL") && is_device_name("com1.a.b") && !is_device_name("com10"));
        assert_eq!(one_line("a\n  b\t c"), "a b c");
        assert_eq!(excerpt(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(excerpt(&"é".repeat(61)), "é".repeat(60) + "…");
        assert_eq!(excerpt(&"\n".repeat(61)), "\\n".repeat(60) + "…");
    }

    #[test]
    fn slips_are_understood_and_strangers_are_not() {
        let known = ["mesh", "height-mm", "scale", "unit"];
        assert_eq!(suggest("heigth-mm", known), Some("height-mm"));
        assert_eq!(suggest("height_mm", known), Some("height-mm"));
        assert_eq!(suggest("Unit", known), Some("unit"));
        assert_eq!(suggest("inches", ["mm", "inch"]), Some("inch"));
        assert_eq!(suggest("colour", known), None);
        assert_eq!(suggest(&"mesh".repeat(100), known), None);
        assert_eq!(hint("colour", ["a", "b"]), "expected one of a, b");
    }

    #[test]
    fn another_unit_is_named_with_its_length_in_ours() {
        let known = ["mesh", "height-mm", "height-in-rows"];
        assert_eq!(hint("height-in", known), "lengths are in mm: `height-mm`, 1 in is 25.4 mm");
        assert_eq!(hint("height_inches", known), "lengths are in mm: `height-mm`, 1 in is 25.4 mm");
        assert_eq!(hint("heigth-mm", known), "did you mean `height-mm`?");
        assert_eq!(in_mm("height-mm"), None);
        // Of what has no length in mm the unit is not spoken of.
        assert_eq!(hint("width-in", ["width-on"]), "did you mean `width-on`?");
    }

    #[test]
    fn the_first_name_wins_a_tie() {
        assert_eq!(suggest("bat", ["cat", "rat"]), Some("cat"));
    }
}
