//! What text is written in: UTF-8 or UTF-16, with a byte order mark or without.

use std::borrow::Cow;

const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// A unit of UTF-16 from its two bytes.
type Unit = fn([u8; 2]) -> u16;

/// UTF-16 that is cut short, or holds half a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("half a character of UTF-16 at offset {offset}")]
pub(crate) struct HalfCharacter {
    /// Where, bytes from the start.
    pub offset: usize,
}

/// The text without byte order mark; UTF-16 becomes UTF-8, and what is neither stays.
///
/// # Errors
/// UTF-16 that is broken.
pub(crate) fn decoded(bytes: &[u8]) -> Result<Cow<'_, [u8]>, HalfCharacter> {
    match utf_16(bytes) {
        Some((unit, text)) => {
            let read = from_utf16(text, unit);
            let mark = bytes.len() - text.len();
            read.map(|text| Cow::Owned(text.into_bytes())).map_err(|offset| HalfCharacter { offset: mark + offset })
        }
        None => Ok(Cow::Borrowed(bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes))),
    }
}

/// The text of bytes that must be one.
///
/// # Errors
/// What is found in its place, and where.
pub(crate) fn text(bytes: &[u8]) -> Result<String, String> {
    let decoded = decoded(bytes).map_err(|broken| broken.to_string())?;
    String::from_utf8(decoded.into_owned()).map_err(|error| {
        let mark = if bytes.starts_with(UTF8_MARK) { UTF8_MARK.len() } else { 0 };
        format!("bytes that are not UTF-8 at offset {}", mark + error.utf8_error().valid_up_to())
    })
}

/// Text that may be of an older encoding: what is no UTF-8 is read as Latin-1, in which every byte is a character of
/// its own, so that names which differ stay apart.
pub(crate) fn or_latin_1(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
    }
}

/// Whether the bytes are UTF-16.
pub(crate) fn is_utf_16(bytes: &[u8]) -> bool {
    utf_16(bytes).is_some()
}

/// How two bytes make a unit of UTF-16, and the text behind its mark. Without a mark it is known by the zeros beside
/// its first two characters, which in every format read here are of ASCII.
fn utf_16(bytes: &[u8]) -> Option<(Unit, &[u8])> {
    match bytes {
        [0xff, 0xfe, rest @ ..] => Some((u16::from_le_bytes, rest)),
        [0xfe, 0xff, rest @ ..] => Some((u16::from_be_bytes, rest)),
        [1..0x80, 0, 1..0x80, 0, ..] => Some((u16::from_le_bytes, bytes)),
        [0, 1..0x80, 0, 1..0x80, ..] => Some((u16::from_be_bytes, bytes)),
        _ => None,
    }
}

/// The text, or the offset of what is no whole character.
fn from_utf16(bytes: &[u8], unit: Unit) -> Result<String, usize> {
    let mut text = String::with_capacity(bytes.len() / 2);
    let mut read = 0;
    for c in char::decode_utf16(bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]))) {
        let c = c.map_err(|_| read)?;
        read += 2 * c.len_utf16();
        text.push(c);
    }
    if read < bytes.len() { Err(read) } else { Ok(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_skipped_and_utf_16_is_read() {
        let text = "v é\u{1f407}";
        let units: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [UTF8_MARK, text.as_bytes()].concat(),
            [&[0xff, 0xfe][..], &little].concat(),
            [&[0xfe, 0xff][..], &big].concat(),
            little,
            big,
        ] {
            assert_eq!(*decoded(&bytes).unwrap(), *text.as_bytes());
            assert_eq!(super::text(&bytes).unwrap(), text);
        }
    }

    #[test]
    fn other_bytes_stay() {
        for bytes in [&b"v 1"[..], b"", b"v", b"v\0", b"\0\0v\0", b"v\0\0\0", b"\x89\0P\0", b"ply\n"] {
            assert_eq!(*decoded(bytes).unwrap(), *bytes);
        }
    }

    #[test]
    fn half_a_character_is_refused_with_its_place() {
        for (bytes, offset) in [
            // Cut within a unit; after a high surrogate; a low one alone; behind a mark.
            (&b"v\0 \x001"[..], 4),
            (b"v\0 \0\x3d\xd8", 4),
            (b"\0v\0 \xdc\x07\0 ", 4),
            (b"\xff\xfev\0\x3d\xd8v\0", 4),
        ] {
            assert_eq!(decoded(bytes), Err(HalfCharacter { offset }));
            assert_eq!(text(bytes).unwrap_err(), format!("half a character of UTF-16 at offset {offset}"));
        }
        assert_eq!(text(b"wh\xff").unwrap_err(), "bytes that are not UTF-8 at offset 2");
        assert_eq!(text(b"\xef\xbb\xbfwh\xff").unwrap_err(), "bytes that are not UTF-8 at offset 5");
    }

    #[test]
    fn names_of_an_older_encoding_stay_apart() {
        assert_eq!(or_latin_1("grün".as_bytes()), "grün");
        assert_eq!([or_latin_1(b"gr\xfcn"), or_latin_1(b"gr\xf6n")], ["grün", "grön"]);
    }
}
