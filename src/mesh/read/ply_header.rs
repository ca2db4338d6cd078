//! The header of a PLY file: which elements follow, how many, with which properties.

use super::text::line_end;
use crate::mesh::error::{Fault, Parsed, quote};

/// How the body is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// A number's type in a binary body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// One number, or a list of them behind its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { length: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes one element takes in the body, so that a count can be held against the file's size.
    pub(super) fn min_bytes(&self, encoding: Encoding) -> usize {
        match encoding {
            // A digit and a separator each.
            Encoding::Text => 2 * self.properties.len(),
            _ => self
                .properties
                .iter()
                .map(|p| match p.kind {
                    Kind::One(scalar) | Kind::List { length: scalar, .. } => scalar.bytes(),
                })
                .sum(),
        }
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Named by MeshLab's `comment TextureFile`, in the order that `texnumber` counts in.
    pub(super) texture_files: Vec<String>,
    /// Bytes and lines that the header takes.
    pub(super) bytes: usize,
    pub(super) lines: usize,
}

pub(super) fn parse(bytes: &[u8]) -> Parsed<Header> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut texture_files = Vec::new();
    // A body may begin with a line feed's byte: the first line tells whether one belongs to line ends.
    let mut return_alone = false;
    let mut at = 0;
    let mut number = 0;
    loop {
        number += 1;
        let Some((end, next)) = line_end(&bytes[at..]).map(|(end, next)| (at + end, at + next)) else {
            let found = format!("the end of the file after {}", quote(&bytes[at..]));
            return Err(Fault::new(format!("line {number}"), found, "end_header"));
        };
        let line = bytes[at..end].trim_ascii();
        return_alone |= number == 1 && next == end + 1 && bytes[end] == b'\r';
        at = if return_alone { end + 1 } else { next };
        let text = std::str::from_utf8(line).unwrap_or("");
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let fail = |expected: &str| Err(Fault::new(format!("line {number}"), quote(line), expected));
        if number == 1 {
            let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
            if line != b"ply" {
                return fail("ply");
            }
            continue;
        }
        match words[..] {
            ["end_header"] => break,
            ["format", name, _version] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return fail("format ascii, binary_little_endian or binary_big_endian"),
                });
            }
            ["element", name, count] => match count.parse() {
                Ok(count) => elements.push(Element { name: name.to_owned(), count, properties: Vec::new() }),
                Err(_) => return fail("`element name count`"),
            },
            ["property", ref words @ ..] => {
                let kind = match *words {
                    ["list", length, item, name] => Scalar::named(length)
                        .zip(Scalar::named(item))
                        .map(|(length, item)| (Kind::List { length, item }, name)),
                    [scalar, name] => Scalar::named(scalar).map(|scalar| (Kind::One(scalar), name)),
                    _ => None,
                };
                match (kind, elements.last_mut()) {
                    (Some((kind, name)), Some(element)) => {
                        element.properties.push(Property { name: name.to_owned(), kind });
                    }
                    (None, _) => return fail("`property type name` or `property list type type name`"),
                    (_, None) => return fail("an element before its properties"),
                }
            }
            ["comment" | "obj_info", word, _, ..] if word.eq_ignore_ascii_case("TextureFile") => {
                texture_files.extend(text.split_once(word).map(|(_, name)| name.trim().to_owned()));
            }
            ["comment" | "obj_info", ..] | [] if line.is_empty() || !words.is_empty() => {}
            // A comment in another encoding than UTF-8.
            _ if line.starts_with(b"comment") || line.starts_with(b"obj_info") => {}
            _ => return fail("format, element, property, comment or end_header"),
        }
    }
    let Some(encoding) = encoding else {
        return Err(Fault::new(
            "the header",
            "no format line",
            "format ascii, binary_little_endian or binary_big_endian",
        ));
    };
    Ok(Header { encoding, elements, texture_files, bytes: at, lines: number })
}
