//! PLY: text and binary of both byte orders.
//!
//! Read are vertices with x, y, z and u, v (also s, t or `texture_u`, `texture_v`), faces of any number of corners as fans
//! with `vertex_indices` and MeshLab's per-corner `texcoord`. Elements and properties of other names are stepped over.

use glam::{DVec3, Vec2};

use super::ply_header::{self, Element, Encoding, Kind, Scalar};
use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::{Source, texture};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let header = ply_header::parse(source.bytes)?;
    let mut body = Body { bytes: source.bytes, at: header.bytes, line: header.lines + 1, encoding: header.encoding };
    let mut raw = RawMesh::new(1.0);
    let mut uvs = Vec::new();
    for element in &header.elements {
        body.check_room(element)?;
        match element.name.as_str() {
            "vertex" => vertices(element, &mut body, &mut raw.positions, &mut uvs)?,
            "face" => faces(element, &mut body, &mut raw, &uvs)?,
            _ => skip(element, &mut body)?,
        }
    }
    check_indices(&raw)?;
    if let Some(name) = header.texture_file {
        let mut material = plain("texture", [1.0; 4]);
        match source.read(&source.companion(&name)).and_then(|bytes| texture::decode(&bytes)) {
            Ok(texture) => material.base_color_texture = Some(texture),
            Err(reason) => {
                raw.lose_color(format!("texture `{name}` cannot be read ({reason}): the surface stays plain"))
            }
        }
        raw.add_material(|| "the header".to_owned(), material)?;
    }
    Ok(raw)
}

fn vertices(element: &Element, body: &mut Body, positions: &mut Vec<DVec3>, uvs: &mut Vec<Vec2>) -> Parsed<()> {
    let find = |names: &[&str]| element.properties.iter().position(|p| names.contains(&p.name.as_str()));
    let [Some(x), Some(y), Some(z)] = [find(&["x"]), find(&["y"]), find(&["z"])] else {
        let names: Vec<&str> = element.properties.iter().map(|p| p.name.as_str()).collect();
        return Err(Fault::new("element vertex", format!("properties `{}`", names.join(" ")), "x, y and z"));
    };
    let uv = find(&["u", "s", "texture_u"]).zip(find(&["v", "t", "texture_v"]));
    positions.reserve(element.count);
    let mut values = vec![0.0; element.properties.len()];
    for i in 0..element.count {
        for (property, value) in element.properties.iter().zip(&mut values) {
            match property.kind {
                Kind::One(scalar) => *value = body.number(scalar, element, i)?,
                Kind::List { length, item } => body.list(length, item, element, i, |_| {})?,
            }
        }
        let p = DVec3::new(values[x], values[y], values[z]);
        positions.push(finite(p, || body.place(element, i))?);
        if let Some((u, v)) = uv {
            uvs.push(uv_or_zero(Vec2::new(values[u] as f32, (1.0 - values[v]) as f32)));
        }
    }
    Ok(())
}

fn faces(element: &Element, body: &mut Body, raw: &mut RawMesh, vertex_uvs: &[Vec2]) -> Parsed<()> {
    let mut corners: Vec<u32> = Vec::new();
    let mut texcoords: Vec<f32> = Vec::new();
    let mut thin = 0;
    for i in 0..element.count {
        corners.clear();
        texcoords.clear();
        let mut stray = None;
        for property in &element.properties {
            match (property.name.as_str(), property.kind) {
                ("vertex_indices" | "vertex_index", Kind::List { length, item }) => {
                    body.list(length, item, element, i, |value| {
                        // Text may hold −1 or 1.5 here.
                        if value < 0.0 || value > f64::from(u32::MAX) || value.fract() != 0.0 {
                            stray = Some(value);
                        }
                        corners.push(value as u32);
                    })?;
                }
                ("texcoord", Kind::List { length, item }) => {
                    body.list(length, item, element, i, |value| texcoords.push(value as f32))?;
                }
                (_, Kind::List { length, item }) => body.list(length, item, element, i, |_| {})?,
                (_, Kind::One(scalar)) => {
                    body.number(scalar, element, i)?;
                }
            }
        }
        if let Some(value) = stray {
            return Err(Fault::new(body.place(element, i), format!("vertex index {value}"), "an index from 0"));
        }
        thin += usize::from(corners.len() < 3);
        let uv_of = |corner: usize| -> Option<Vec2> {
            if let Some(uv) = texcoords.get(2 * corner..2 * corner + 2) {
                return Some(uv_or_zero(Vec2::new(uv[0], 1.0 - uv[1])));
            }
            vertex_uvs.get(corners[corner] as usize).copied()
        };
        for c in 2..corners.len() {
            let uv = match [uv_of(0), uv_of(c - 1), uv_of(c)] {
                [Some(a), Some(b), Some(c)] => Some([a, b, c]),
                _ => None,
            };
            raw.push(|| format!("face {i}"), [corners[0], corners[c - 1], corners[c]], uv)?;
        }
    }
    if thin > 0 {
        raw.warnings.push(format!("{} with fewer than three corners skipped", counted(thin, "face")));
    }
    Ok(())
}

fn skip(element: &Element, body: &mut Body) -> Parsed<()> {
    for i in 0..element.count {
        for property in &element.properties {
            match property.kind {
                Kind::One(scalar) => {
                    body.number(scalar, element, i)?;
                }
                Kind::List { length, item } => body.list(length, item, element, i, |_| {})?,
            }
        }
    }
    Ok(())
}

fn check_indices(raw: &RawMesh) -> Parsed<()> {
    let vertices = raw.positions.len();
    for (t, triangle) in raw.triangles.iter().enumerate() {
        if let Some(i) = triangle.iter().find(|&&i| i as usize >= vertices) {
            let place = format!("triangle {t} of the faces");
            return Err(Fault::new(place, format!("vertex index {i}"), format!("an index below {vertices}")));
        }
    }
    Ok(())
}

/// The bytes after the header and how far they are read.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    encoding: Encoding,
}

impl Body<'_> {
    fn place(&self, element: &Element, i: usize) -> String {
        match self.encoding {
            Encoding::Text => format!("line {}, {} {i}", self.line, element.name),
            _ => format!("byte {}, {} {i}", self.at, element.name),
        }
    }

    /// Holds the header's count against the bytes left, before any memory is reserved by it.
    fn check_room(&self, element: &Element) -> Parsed<()> {
        if element.properties.is_empty() && element.count > 0 {
            let found = format!("{} elements without properties", element.count);
            return Err(Fault::new(format!("element {}", element.name), found, "at least one property"));
        }
        // The last text number needs no separator.
        let left = self.bytes.len() - self.at + 1;
        let needed = element.count.checked_mul(element.min_bytes(self.encoding));
        if needed.is_some_and(|needed| needed <= left) {
            return Ok(());
        }
        let found = format!("{} elements claimed and {} bytes left", element.count, left - 1);
        let expected = format!("at least {} bytes each", element.min_bytes(self.encoding));
        Err(Fault::new(format!("element {}", element.name), found, expected))
    }

    fn number(&mut self, scalar: Scalar, element: &Element, i: usize) -> Parsed<f64> {
        if self.encoding == Encoding::Text {
            return self.text_number(element, i);
        }
        let mut word = [0; 8];
        let size = scalar.bytes();
        let Some(bytes) = self.bytes.get(self.at..self.at + size) else {
            return Err(Fault::new(self.place(element, i), "the end of the file", "another number"));
        };
        word[..size].copy_from_slice(bytes);
        self.at += size;
        if self.encoding == Encoding::BigEndian {
            word[..size].reverse();
        }
        let [a, b, c, d, ..] = word;
        Ok(match scalar {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(word),
        })
    }

    fn text_number(&mut self, element: &Element, i: usize) -> Parsed<f64> {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += usize::from(*b == b'\n');
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        let found = if word.is_empty() { "the end of the file".to_owned() } else { quote(word) };
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        let value = value.ok_or_else(|| Fault::new(self.place(element, i), found, "a number"))?;
        self.at += word.len();
        Ok(value)
    }

    fn list(
        &mut self,
        length: Scalar,
        item: Scalar,
        element: &Element,
        i: usize,
        mut each: impl FnMut(f64),
    ) -> Parsed<()> {
        let count = self.number(length, element, i)?;
        let item_bytes = if self.encoding == Encoding::Text { 2 } else { item.bytes() };
        let room = (self.bytes.len() - self.at).div_ceil(item_bytes);
        if !(0.0..=room as f64).contains(&count) || count.fract() != 0.0 {
            let found = format!("a list of {count} items");
            return Err(Fault::new(self.place(element, i), found, format!("0 to {room}, what the file has room for")));
        }
        for _ in 0..count as usize {
            each(self.number(item, element, i)?);
        }
        Ok(())
    }
}
