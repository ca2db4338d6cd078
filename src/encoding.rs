//! What text is written in: UTF-8 or UTF-16, with a byte order mark or without.

use std::borrow::Cow;

const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// A unit of UTF-16 from its two bytes.
type Unit = fn([u8; 2]) -> u16;

/// The text without byte order mark; UTF-16 becomes UTF-8, what is none of it U+FFFD.
pub(crate) fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    match utf_16(bytes) {
        Some((unit, text)) => Cow::Owned(from_utf16(text, unit)),
        None => Cow::Borrowed(bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)),
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

fn from_utf16(bytes: &[u8], unit: Unit) -> Vec<u8> {
    let mut text = Vec::with_capacity(bytes.len() / 2);
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    for c in char::decode_utf16(units) {
        let c = c.unwrap_or(char::REPLACEMENT_CHARACTER);
        text.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
    }
    text
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
            assert_eq!(*decoded(&bytes), *text.as_bytes());
        }
    }

    #[test]
    fn other_bytes_stay() {
        for bytes in [&b"v 1"[..], b"", b"v", b"v\0", b"\0\0v\0", b"v\0\0\0", b"\x89\0P\0", b"ply\n"] {
            assert_eq!(*decoded(bytes), *bytes);
        }
    }
}
