//! What holds glTF's bytes together: the GLB container and URIs.

use super::Source;
use crate::mesh::error::{Fault, Parsed};

/// What a GLB begins with.
pub(super) const MAGIC: &[u8] = b"glTF";

/// What is expected in place of files of the first version, which is another format.
pub(super) const CONVERTED: &str = "glTF 2.0: `gltf-pipeline -i OLD -o NEW.glb` converts it";

/// JSON and binary chunk of a .glb; a .gltf is all JSON.
pub(super) fn split(bytes: &[u8]) -> Parsed<(&[u8], Option<&[u8]>)> {
    if !bytes.starts_with(MAGIC) {
        return Ok((bytes, None));
    }
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    match word(4) {
        Some(2) => {}
        Some(1) => return Err(Fault::new("byte 4", "a GLB of version 1, for glTF 1.0", CONVERTED)),
        version => {
            let found = format!("a GLB of version {}", version.unwrap_or(0));
            return Err(Fault::new("byte 4", found, "version 2: export it as glTF 2.0"));
        }
    }
    let chunk = |at: usize, kind: &[u8; 4]| {
        let length = word(at)? as usize;
        if bytes.get(at + 4..at + 8)? != kind {
            return None;
        }
        bytes.get(at + 8..at + 8 + length)
    };
    let json = chunk(12, b"JSON").ok_or_else(|| {
        let found = format!("{:?} bytes claimed in a file of {}", word(12).unwrap_or(0), bytes.len());
        Fault::new("byte 12", found, "a whole JSON chunk")
    })?;
    // Chunks begin at multiples of 4; where a writer padded none, the next follows at once.
    let end = 20 + json.len();
    let next = if bytes.get(end + 4..end + 8) == Some(b"BIN\0") { end } else { end.next_multiple_of(4) };
    let json = &json[..json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1)];
    let bin = chunk(next, b"BIN\0");
    if bin.is_none() && bytes.get(next + 4..next + 8) == Some(b"BIN\0") {
        let found = format!("{} bytes claimed in a file of {}", word(next).unwrap_or(0), bytes.len());
        return Err(Fault::new(format!("byte {next}"), found, "a whole BIN chunk"));
    }
    Ok((json, bin))
}

/// The bytes behind a URI: embedded, or a file beside this one.
pub(super) fn resolve(source: &Source, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:")).map(|_| &uri[5..]) {
        let (kind, payload) = data.split_once(',').ok_or("a data URI without comma")?;
        if !kind.to_ascii_lowercase().ends_with(";base64") {
            return Ok(percent_decode(payload));
        }
        return base64(payload.as_bytes()).ok_or_else(|| "bad base64".to_owned());
    }
    if uri.contains("://") {
        return Err("only files beside the mesh are read".to_owned());
    }
    source.read(&source.companion(&String::from_utf8_lossy(&percent_decode(uri))))
}

/// Undoes a URI's escapes.
pub(super) fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let hex = |b: u8| (b as char).to_digit(16);
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match bytes[i..] {
            [b'%', high, low, ..] if hex(high).is_some() && hex(low).is_some() => {
                out.push((hex(high).unwrap_or(0) * 16 + hex(low).unwrap_or(0)) as u8);
                i += 3;
            }
            _ => {
                out.push(bytes[i]);
                i += 1;
            }
        }
    }
    out
}

/// Standard alphabet, padding optional (RFC 4648, section 4); lines may be broken (RFC 2045, section 6.8).
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect();
    let text = text.as_slice();
    let digits = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut out = Vec::with_capacity(digits.len() / 4 * 3 + 3);
    for group in digits.chunks(4) {
        let mut bits = 0u32;
        for &b in group {
            let digit = match b {
                b'A'..=b'Z' => b - b'A',
                b'a'..=b'z' => b - b'a' + 26,
                b'0'..=b'9' => b - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(digit);
        }
        bits <<= 6 * (4 - group.len());
        out.extend_from_slice(&bits.to_be_bytes()[1..group.len().max(1)]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_rfc() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmE", "fooba")] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes.as_bytes()), "{text}");
        }
        assert_eq!(base64(b"Zm9v\r\n YmFy\n").as_deref(), Some(&b"foobar"[..]));
        assert_eq!(base64(b"Z!=="), None);
    }

    #[test]
    fn percent_escapes_are_undone() {
        assert_eq!(percent_decode("a%20b%2"), b"a b%2");
    }
}
