//! PLY: text and binary of both byte orders.
//!
//! Read are vertices with x, y, z, u, v (also s, t or `texture_u`, `texture_v`) and colours, faces of any number of
//! corners with `vertex_indices`, MeshLab's per-corner `texcoord` and `texnumber`, or a colour of their own, and
//! triangle strips. Elements and properties of other names are stepped over.

use glam::{DVec3, Vec2};

use super::ply_header::{self, Element, Encoding, Kind, Scalar};
use super::ply_surface::{ColorProperties, Textures, dress, linear_colors};
use super::raw::{RawMesh, WHITE, finite, uv_or_zero};
use super::{Source, text};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::{counted, one_line};

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    // Only a text is UTF-16.
    let bytes = if text::is_utf_16(source.bytes) { text::decoded(source.bytes)? } else { source.bytes.into() };
    let header = ply_header::parse(&bytes)?;
    let mut body = Body { bytes: &bytes, at: header.bytes, line: header.lines + 1, encoding: header.encoding };
    let mut raw = RawMesh::new(1.0);
    let mut vertices = Vertices::default();
    let mut textures = Textures::new(header.texture_files.len());
    // Elements may come in any order, and faces ask for colours and coordinates of their corners.
    let at = |names: &[&str]| header.elements.iter().position(|element| names.contains(&element.name.as_str()));
    let vertices_last = at(&["vertex"]).zip(at(&["face", "tristrips"])).is_some_and(|(vertex, face)| face < vertex);
    if vertices_last {
        let mut ahead = Body { ..body };
        for element in &header.elements {
            ahead.check_room(element)?;
            if element.name == "vertex" {
                vertices.read(element, &mut ahead, &mut raw.positions)?;
                break;
            }
            skip(element, &mut ahead)?;
        }
    }
    for element in &header.elements {
        body.check_room(element)?;
        match element.name.as_str() {
            "vertex" if vertices_last => skip(element, &mut body)?,
            "vertex" => vertices.read(element, &mut body, &mut raw.positions)?,
            "face" => faces(element, &mut body, &mut raw, &vertices, &mut textures)?,
            "tristrips" => strips(element, &mut body, &mut raw, &vertices, &mut textures)?,
            _ => skip(element, &mut body)?,
        }
    }
    check_indices(&raw)?;
    for element in header.elements.iter().filter(|element| element.count > 0) {
        let is_splat = element.properties.iter().any(|property| property.name == "f_dc_0");
        let what = if is_splat { " (Gaussian splats)" } else { "" };
        raw.besides.push(format!("{} of the element `{}`{what}", element.count, one_line(&element.name)));
    }
    let surfaces = || header.elements.iter().filter(|element| ["vertex", "face"].contains(&element.name.as_str()));
    let has_colors = surfaces().any(|element| ColorProperties::of(&element.properties).is_some());
    let elsewhere = surfaces().flat_map(|element| &element.properties).find(|property| is_color(&property.name));
    if let (false, true, Some(property)) = (has_colors, header.texture_files.is_empty(), elsewhere) {
        raw.lose_color(format!("colours by the property `{}` are not read", property.name));
    }
    for element in &header.elements {
        let colors = ColorProperties::of(&element.properties).is_some();
        if element.name.starts_with("multi_texture") || element.name == "material" && colors {
            raw.lose_color(format!("colours by the element `{}` are not read", element.name));
        }
    }
    dress(&mut raw, source, &header.texture_files, &textures)?;
    Ok(raw)
}

/// Whether a property is known to hold a colour, or part of one, that says nothing alone.
fn is_color(name: &str) -> bool {
    const NAMES: [&str; 19] = [
        "red",
        "green",
        "blue",
        "rgb",
        "rgba",
        "color",
        "colors",
        "colour",
        "gray",
        "grey",
        "intensity",
        "luminance",
        "diffuse_red",
        "diffuse_green",
        "diffuse_blue",
        "ambient_red",
        "ambient_green",
        "ambient_blue",
        "material_index",
    ];
    NAMES.iter().any(|known| name.eq_ignore_ascii_case(known))
}

/// What a vertex has besides its position.
#[derive(Default)]
struct Vertices {
    uvs: Vec<Vec2>,
    /// Linear RGB.
    colors: Vec<[f32; 3]>,
}

impl Vertices {
    fn read(&mut self, element: &Element, body: &mut Body, positions: &mut Vec<DVec3>) -> Parsed<()> {
        let find = |names: &[&str]| element.properties.iter().position(|p| names.contains(&p.name.as_str()));
        let [Some(x), Some(y), Some(z)] = [find(&["x"]), find(&["y"]), find(&["z"])] else {
            let names: Vec<&str> = element.properties.iter().map(|p| p.name.as_str()).collect();
            return Err(Fault::new("element vertex", format!("properties `{}`", names.join(" ")), "x, y and z"));
        };
        let uv = find(&["u", "s", "texture_u"]).zip(find(&["v", "t", "texture_v"]));
        let color = ColorProperties::of(&element.properties);
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
                self.uvs.push(uv_or_zero(Vec2::new(values[u] as f32, (1.0 - values[v]) as f32)));
            }
            self.colors.extend(color.as_ref().map(|color| color.read(&values)));
        }
        linear_colors(&mut self.colors);
        Ok(())
    }

    fn color(&self, corner: u32) -> [f32; 3] {
        self.colors.get(corner as usize).copied().unwrap_or(WHITE)
    }
}

/// What is read of one face or strip.
#[derive(Default)]
struct Row {
    corners: Vec<u32>,
    texcoords: Vec<f32>,
    /// By property, where it is one number.
    values: Vec<f64>,
    texture: Option<f64>,
}

impl Row {
    /// Reads the next; `restart` is the index that ends a strip.
    fn read(&mut self, element: &Element, body: &mut Body, i: usize, restart: Option<f64>) -> Parsed<()> {
        self.corners.clear();
        self.texcoords.clear();
        self.values.clear();
        self.texture = None;
        let mut stray = None;
        for property in &element.properties {
            let mut one = 0.0;
            match (property.name.as_str(), property.kind) {
                ("vertex_indices" | "vertex_index", Kind::List { length, item }) => {
                    body.list(length, item, element, i, |value| {
                        // Text may hold −1 or 1.5 here.
                        let is_index = value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0;
                        if !is_index && restart != Some(value) {
                            stray = Some(value);
                        }
                        self.corners.push(if is_index { value as u32 } else { RESTART });
                    })?;
                }
                ("texcoord", Kind::List { length, item }) => {
                    body.list(length, item, element, i, |value| self.texcoords.push(value as f32))?;
                }
                (_, Kind::List { length, item }) => body.list(length, item, element, i, |_| {})?,
                (_, Kind::One(scalar)) => one = body.number(scalar, element, i)?,
            }
            self.values.push(one);
            if ["texnumber", "texture_number"].contains(&property.name.as_str()) {
                self.texture = Some(one);
            }
        }
        match stray {
            Some(value) => Err(Fault::new(body.place(element, i), format!("vertex index {value}"), "an index from 0")),
            None => Ok(()),
        }
    }

    fn uv(&self, corner: usize, vertices: &Vertices) -> Option<Vec2> {
        if let Some(uv) = self.texcoords.get(2 * corner..2 * corner + 2) {
            return Some(uv_or_zero(Vec2::new(uv[0], 1.0 - uv[1])));
        }
        vertices.uvs.get(self.corners[corner] as usize).copied()
    }

    fn triangle(
        &self,
        raw: &mut RawMesh,
        place: impl Fn() -> String,
        corners: [usize; 3],
        vertices: &Vertices,
    ) -> Parsed<()> {
        let uv = match corners.map(|corner| self.uv(corner, vertices)) {
            [Some(a), Some(b), Some(c)] => Some([a, b, c]),
            _ => None,
        };
        let corners = corners.map(|corner| self.corners[corner]);
        raw.push(place, corners, uv)?;
        if !vertices.colors.is_empty() {
            raw.color_last(corners.map(|corner| vertices.color(corner)));
        }
        Ok(())
    }
}

/// Stands for −1 in a strip; no mesh has as many vertices.
const RESTART: u32 = u32::MAX;

fn faces(
    element: &Element,
    body: &mut Body,
    raw: &mut RawMesh,
    vertices: &Vertices,
    textures: &mut Textures,
) -> Parsed<()> {
    let color = ColorProperties::of(&element.properties);
    let mut face_colors = Vec::new();
    let before = raw.triangles.len();
    let mut row = Row::default();
    let mut thin = 0;
    for i in 0..element.count {
        row.read(element, body, i, None)?;
        thin += usize::from(row.corners.len() < 3);
        let first = raw.triangles.len();
        raw.end_polygon(first, row.corners.len());
        for c in 2..row.corners.len() {
            row.triangle(raw, || format!("face {i}"), [0, c - 1, c], vertices)?;
            face_colors.extend(color.as_ref().map(|color| color.read(&row.values)));
        }
        let number = textures.number(row.texture, || body.place(element, i))?;
        textures.fill(raw.triangles.len(), number);
    }
    let plain = vertices.colors.iter().all(|color| *color == WHITE);
    if color.is_some() && !plain {
        let colored = face_colors.iter().any(|encoded| encoded[1..] != encoded[..1].repeat(2));
        if colored || face_colors.iter().any(|encoded| *encoded != face_colors[0]) {
            raw.warnings.push("the colours of the faces are not used, for vertices have their own".to_owned());
        }
    }
    if color.is_some() && plain {
        linear_colors(&mut face_colors);
        raw.corner_colors.truncate(before);
        raw.corner_colors.resize(before, [WHITE; 3]);
        raw.corner_colors.extend(face_colors.iter().map(|&color| [color; 3]));
    }
    if thin > 0 {
        raw.warnings.push(format!("{} with fewer than three corners skipped", counted(thin, "face")));
    }
    Ok(())
}

/// Triangle strips, one behind the other, each ended by −1: every second triangle is turned round.
fn strips(
    element: &Element,
    body: &mut Body,
    raw: &mut RawMesh,
    vertices: &Vertices,
    textures: &mut Textures,
) -> Parsed<()> {
    let mut row = Row::default();
    for i in 0..element.count {
        row.read(element, body, i, Some(-1.0))?;
        let mut start = 0;
        for end in 0..row.corners.len() {
            if row.corners[end] == RESTART {
                start = end + 1;
            } else if end >= start + 2 {
                let [a, b] = if (end - start) % 2 == 0 { [end - 2, end - 1] } else { [end - 1, end - 2] };
                row.triangle(raw, || format!("strip {i}"), [a, b, end], vertices)?;
            }
        }
        let number = textures.number(row.texture, || body.place(element, i))?;
        textures.fill(raw.triangles.len(), number);
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
            // Beyond 2^53 rounded, which no index or colour is.
            Scalar::I64 => i64::from_le_bytes(word) as f64,
            Scalar::U64 => u64::from_le_bytes(word) as f64,
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(word),
        })
    }

    /// Skips blanks, and comments up to their line's end.
    fn skip_to_word(&mut self) {
        let mut in_comment = false;
        while let Some(&b) = self.bytes.get(self.at).filter(|b| in_comment || b.is_ascii_whitespace() || **b == b'#') {
            let ends_line = b == b'\n' || b == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n');
            self.line += usize::from(ends_line);
            in_comment = !ends_line && (in_comment || b == b'#');
            self.at += 1;
        }
    }

    fn text_number(&mut self, element: &Element, i: usize) -> Parsed<f64> {
        self.skip_to_word();
        let rest = &self.bytes[self.at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || *b == b'#';
        let word = &rest[..rest.iter().position(ends).unwrap_or(rest.len())];
        let found = if word.is_empty() { "the end of the file".to_owned() } else { quote(word) };
        let value = text::number(word);
        let fault = || Fault::new(self.place(element, i), found, text::expected_number(word, "a number"));
        let value = value.ok_or_else(fault)?;
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
