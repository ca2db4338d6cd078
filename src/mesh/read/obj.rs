//! Wavefront OBJ: `v`, `vt`, `f`, `usemtl`, `mtllib`, vertex colours; what else there is does not concern a surface, or
//! is warned of.
//!
//! v is turned to grow downwards. Homogeneous weights are ignored.
//!
//! Vertex colours (`v x y z r g b`, and ZBrush's `#MRGB` comments) are taken for sRGB, as Blender, Godot and Obj2Tiles
//! take them. Where a material has no texture they stand in place of its Kd, which programs that write them leave at
//! their default; where it has one the texture counts alone: scanners write the same colours twice, coarsely by vertex
//! and finely as a texture.

use std::collections::HashMap;
use std::path::PathBuf;

use glam::{DVec2, DVec3, Vec2};

use super::Source;
use super::mtl::{self, Definition};
use super::raw::{NO_UV as NO_COORDINATE, RawMesh, WHITE, finite, plain, uv_or_zero};
use super::support::{self, Fate};
use super::surface::full_value;
use super::text::{POLYPAINT, Statements, decoded, expected_number, has_comma, number, or_latin_1, without_comment};
use crate::colour::srgb_to_linear;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

/// Marks a corner without texture coordinate.
const NO_UV: u32 = u32::MAX;

/// Statements whose argument is a name, which may hold a `#`.
const NAMED: [&str; 5] = ["usemtl", "mtllib", "usemap", "maplib", "call"];

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let mut reader = Reader::new(source);
    for (number, line) in Statements::new(&decoded(source.bytes)?, &NAMED) {
        reader.line(number, &line)?;
    }
    reader.finish()
}

/// A corner as the file names it: indices from 0.
#[derive(Clone, Copy)]
struct Corner {
    position: u32,
    uv: u32,
}

/// Vertices of seven numbers: `x y z r g b a`, or `x y z w r g b`.
#[derive(Default)]
struct Sevens {
    /// The seventh of each.
    last: Vec<f32>,
    /// Whether the fourth, or the seventh, is ever another number than 1.
    varies: [bool; 2],
}

impl Sevens {
    fn note(&mut self, [fourth, ..]: [f64; 3], last: f64) {
        self.last.push(last as f32);
        self.varies[0] |= fourth != 1.0;
        self.varies[1] |= last != 1.0;
    }

    /// A fourth number that is 1 everywhere, beside a seventh that is not, was a weight: colours begin one later.
    fn settle(&self, colors: &mut [[f32; 3]]) {
        let colored = colors.iter_mut().filter(|color| color.iter().all(|value| !value.is_nan()));
        let colored: Vec<_> = colored.collect();
        if self.varies == [false, true] && colored.len() == self.last.len() {
            colored.into_iter().zip(&self.last).for_each(|(color, last)| *color = [color[1], color[2], *last]);
        }
    }
}

struct Reader<'a> {
    source: &'a Source<'a>,
    raw: RawMesh,
    texture_coordinates: Vec<Vec2>,
    corner_uvs: Vec<[u32; 3]>,
    /// Line of every triangle, for complaints about indices that only the end of the file proves wrong.
    lines: Vec<usize>,
    library: Vec<Definition>,
    /// Encoded RGB of every position so far, NaN for those without; shorter where none follows.
    colors: Vec<[f32; 3]>,
    /// Vertices of seven numbers.
    sevens: Sevens,
    /// Positions that ZBrush's comments have coloured.
    painted: usize,
    /// What was met and is not read.
    unread: Vec<(String, Fate)>,
    /// Index into `raw.materials` by name.
    used: HashMap<String, u16>,
    current: Option<u16>,
    polygon: Vec<Corner>,
    thin_faces: usize,
    /// Line of the first number that no texture coordinate may have: 0, or one that counts back beyond the first.
    nowhere: Option<usize>,
    /// `l` and `p`.
    lines_and_points: [usize; 2],
}

impl<'a> Reader<'a> {
    fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            raw: RawMesh::new(1.0),
            texture_coordinates: Vec::new(),
            corner_uvs: Vec::new(),
            lines: Vec::new(),
            library: Vec::new(),
            colors: Vec::new(),
            sevens: Sevens::default(),
            painted: 0,
            unread: Vec::new(),
            used: HashMap::new(),
            current: None,
            polygon: Vec::new(),
            thin_faces: 0,
            nowhere: None,
            lines_and_points: [0; 2],
        }
    }

    fn line(&mut self, number: usize, line: &[u8]) -> Parsed<()> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword.to_ascii_lowercase().as_slice() {
            b"v" => {
                let fault =
                    |expected| Fault::new(format!("line {number}"), quote(line), expected_number(line, expected));
                let p = numbers::<3>(&mut words).ok_or_else(|| fault("`v x y z` with three numbers"))?;
                if words.clone().any(has_comma) {
                    return Err(fault("`v x y z r g b` with numbers"));
                }
                self.raw.positions.push(finite(DVec3::from_array(p), || format!("line {number}"))?);
                // A fourth number alone is a weight.
                if let Some(rgb) = numbers::<3>(&mut words) {
                    self.colors.resize(self.raw.positions.len() - 1, [f32::NAN; 3]);
                    self.colors.push(rgb.map(|c| c as f32));
                    if let Some([last]) = numbers::<1>(&mut words) {
                        self.sevens.note(rgb, last);
                    }
                }
            }
            b"vt" => {
                let fault = || {
                    let expected = expected_number(line, "`vt u v` with two numbers");
                    Fault::new(format!("line {number}"), quote(line), expected)
                };
                let [u] = numbers::<1>(&mut words).ok_or_else(fault)?;
                if words.clone().any(has_comma) {
                    return Err(fault());
                }
                let [v] = numbers::<1>(&mut words).unwrap_or([0.0]);
                self.texture_coordinates.push(uv_or_zero(Vec2::new(u as f32, (1.0 - v) as f32)));
            }
            b"f" | b"fo" => self.face(number, line, words)?,
            b"l" => self.lines_and_points[0] += 1,
            b"p" => self.lines_and_points[1] += 1,
            b"usemtl" => self.use_material(number, &argument(line))?,
            b"mtllib" => self.libraries(&argument(line)),
            b"usemap" if argument(line).eq_ignore_ascii_case("off") => {}
            keyword if keyword.eq_ignore_ascii_case(POLYPAINT) => self.paint(words.next().unwrap_or_default()),
            keyword => {
                let name = std::str::from_utf8(keyword).unwrap_or("");
                let fate = support::fate("OBJ", name).filter(|fate| matches!(fate, Fate::Warned | Fate::Lost));
                if let Some(fate) = fate
                    && !self.unread.iter().any(|(known, _)| known == name)
                {
                    self.unread.push((name.to_owned(), fate));
                }
            }
        }
        Ok(())
    }

    /// The next colours of ZBrush's paint: eight digits each, mask, red, green, blue, in the order of the positions.
    fn paint(&mut self, digits: &[u8]) {
        for color in digits.chunks_exact(8) {
            let text = std::str::from_utf8(color).ok();
            let Some(value) = text.and_then(|text| u32::from_str_radix(text, 16).ok()) else { return };
            let [_, r, g, b] = value.to_be_bytes().map(|byte| f32::from(byte) / 255.0);
            if self.painted >= self.raw.positions.len() {
                return;
            }
            self.colors.resize(self.colors.len().max(self.painted + 1), [f32::NAN; 3]);
            self.colors[self.painted] = [r, g, b];
            self.painted += 1;
        }
    }

    fn face<'w>(&mut self, number: usize, line: &[u8], words: impl Iterator<Item = &'w [u8]>) -> Parsed<()> {
        self.polygon.clear();
        for word in words {
            let mut parts = word.split(|&b| b == b'/');
            let position = parts.next().and_then(|w| index(w, self.raw.positions.len()));
            let uv = match parts.next() {
                None | Some(b"") => Some(NO_UV),
                Some(w) => {
                    let found = index(w, self.texture_coordinates.len());
                    // Some writers number texture coordinates that they do not write.
                    let is_number = std::str::from_utf8(w).is_ok_and(|w| w.parse::<i64>().is_ok());
                    if found.is_none() && is_number {
                        self.nowhere.get_or_insert(number);
                    }
                    found.or(is_number.then_some(NO_UV))
                }
            };
            let (Some(position), Some(uv)) = (position, uv) else {
                let found = format!("corner {} in {}", quote(word), quote(line));
                let expected = "`position/uv/normal` as indices from 1, or below 0 and counted back";
                return Err(Fault::new(format!("line {number}"), found, expected));
            };
            self.polygon.push(Corner { position, uv });
        }
        if self.polygon.len() < 3 {
            self.thin_faces += 1;
        }
        self.raw.end_polygon(self.raw.triangles.len(), self.polygon.len());
        for i in 2..self.polygon.len() {
            let [a, b, c] = [self.polygon[0], self.polygon[i - 1], self.polygon[i]];
            self.raw.push(|| format!("line {number}"), [a, b, c].map(|corner| corner.position), None)?;
            self.corner_uvs.push([a, b, c].map(|corner| corner.uv));
            self.lines.push(number);
            if let Some(material) = self.current {
                self.raw.material_of.push(material);
            }
        }
        Ok(())
    }

    fn use_material(&mut self, number: usize, name: &str) -> Parsed<()> {
        let index = match self.used.get(name) {
            Some(&index) => index,
            None => {
                if self.used.is_empty() && !self.raw.triangles.is_empty() {
                    // Faces before the first `usemtl` are white.
                    self.raw.add_material(|| format!("line {number}"), plain("", [1.0; 4]))?;
                    self.raw.material_of = vec![0; self.raw.triangles.len()];
                }
                let index = self.raw.add_material(|| format!("line {number}"), plain(name, [1.0; 4]))?;
                self.used.insert(name.to_owned(), index);
                index
            }
        };
        self.current = Some(index);
        Ok(())
    }

    /// One name with spaces, or several: without, or with as far as each ends in `.mtl`.
    fn libraries(&mut self, names: &str) {
        let bare = without_comment(names);
        let names = if self.source.companion(names).exists() { names } else { bare };
        let words: Vec<&str> = names.split_whitespace().collect();
        let ends = |word: &&str| word.to_ascii_lowercase().ends_with(".mtl");
        let by_ending: Vec<String> = words.split_inclusive(ends).map(|words| words.join(" ")).collect();
        let whole = self.source.companion(names);
        let mut paths = vec![whole];
        if words.len() > 1 && !paths[0].exists() {
            let found = |names: Vec<PathBuf>| (names.iter().filter(|path| path.exists()).count(), names);
            let by_word = found(words.iter().map(|name| self.source.companion(name)).collect());
            let by_ending = found(by_ending.iter().map(|name| self.source.companion(name)).collect());
            let is_whole = |(found, paths): &(usize, Vec<PathBuf>)| *found == paths.len();
            match if is_whole(&by_ending) { by_ending } else { by_word } {
                (0, _) => {}
                (_, several) => paths = several,
            }
        }
        for path in paths {
            mtl::read(self.source, &path, &mut self.library, &mut self.raw);
        }
    }

    fn finish(mut self) -> Parsed<RawMesh> {
        self.resolve_corners()?;
        let [lines, points] = self.lines_and_points;
        self.raw.note_besides(lines, "line");
        self.raw.note_besides(points, "row of points");
        self.raw.note_besides(self.thin_faces, "face with fewer than three corners");
        self.raw.besides.extend(self.unread.iter().map(|(what, _)| format!("`{what}`")));
        self.raw.note_besides(self.raw.positions.len(), "point");
        self.define_materials();
        self.apply_colors()?;
        for (what, fate) in std::mem::take(&mut self.unread) {
            match fate {
                Fate::Lost => self.raw.lose_color(format!("textures set by `{what}` are not read")),
                _ => self.raw.warnings.push(format!("`{what}` is not read: its surface is missing")),
            }
        }
        if self.thin_faces > 0 {
            self.raw
                .warnings
                .push(format!("{} with fewer than three corners skipped", counted(self.thin_faces, "face")));
        }
        Ok(self.raw)
    }

    /// Replaces the materials' names by what the libraries say of them.
    fn define_materials(&mut self) {
        let (mut missing, mut colorless, mut emissive) = (Vec::new(), Vec::new(), Vec::new());
        let mut placements = Vec::new();
        let named: HashMap<&str, &Definition> =
            self.library.iter().map(|defined| (without_comment(&defined.material.name), defined)).collect();
        for material in &mut self.raw.materials {
            placements.push(None);
            if material.name.is_empty() {
                continue;
            }
            // The last definition of a name counts, as for a renderer that reads from the top.
            let exact = self.library.iter().rev().find(|defined| defined.material.name == material.name);
            match exact.or_else(|| named.get(without_comment(&material.name)).copied()) {
                Some(defined) => {
                    if !defined.has_color {
                        colorless.push(material.name.clone());
                    }
                    let [r, rest @ ..] = [0, 1, 2].map(|c| defined.material.base_color[c]);
                    // A texture of ambient light alone is the colour of any grey; what glows may well be grey besides.
                    let is_plain = |elsewhere: &&str| {
                        rest == [r; 2]
                            && (r == 0.0 || r == 1.0 || *elsewhere == "map_Ka")
                            && defined.material.base_color_texture.is_none()
                    };
                    if let Some(elsewhere) = defined.elsewhere.filter(is_plain) {
                        emissive.push(format!("`{}` ({elsewhere})", material.name));
                    }
                    *material = defined.material.clone();
                    placements.pop();
                    placements.push(Some((defined.scale, defined.offset)).filter(|p| *p != (DVec2::ONE, DVec2::ZERO)));
                }
                None => missing.push(material.name.clone()),
            }
        }
        if placements.iter().any(Option::is_some) {
            for (uvs, &material) in self.raw.uvs.iter_mut().zip(&self.raw.material_of) {
                let Some((scale, offset)) = placements[usize::from(material)] else { continue };
                // MTL counts v upwards.
                let place = |uv: Vec2| {
                    let up = DVec2::new(uv.x.into(), 1.0 - f64::from(uv.y)) * scale + offset;
                    if uv.is_nan() { uv } else { uv_or_zero(Vec2::new(up.x as f32, (1.0 - up.y) as f32)) }
                };
                *uvs = uvs.map(place);
            }
        }
        if self.colors.is_empty() && !emissive.is_empty() {
            let emissive = emissive.join(", ");
            self.raw.lose_color(format!("colours that stand elsewhere than in Kd and map_Kd are not read: {emissive}"));
        }
        // Vertex colours stand in for what a material leaves open.
        if self.colors.is_empty() && !colorless.is_empty() {
            let colorless = format!("materials without Kd or map_Kd stay white: `{}`", colorless.join("`, `"));
            self.raw.lose_color(colorless);
        }
        let nameless =
            self.raw.material_of.iter().filter(|&&m| self.raw.materials[usize::from(m)].name.is_empty()).count();
        if nameless > 0 && self.colors.is_empty() {
            self.raw.warnings.push(format!("{} without a material: white", counted(nameless, "triangle")));
        }
        if !missing.is_empty() {
            let missing = format!("materials nowhere defined stay white: `{}`", missing.join("`, `"));
            self.raw.lose_color(missing);
        }
    }

    /// Gives the vertices' colours to the corners.
    fn apply_colors(&mut self) -> Parsed<()> {
        self.sevens.settle(&mut self.colors);
        let full = full_value(self.colors.iter().flatten().copied());
        if self.colors.iter().flatten().all(|&c| c == full || c.is_nan()) {
            return Ok(());
        }
        let linear_of = |position: u32| match self.colors.get(position as usize) {
            Some(rgb) if rgb.iter().all(|c| c.is_finite()) => {
                Some(rgb.map(|c| srgb_to_linear(c.clamp(0.0, full) / full)))
            }
            _ => None,
        };
        if self.raw.materials.is_empty() {
            self.raw.add_material(|| "the vertices".to_owned(), plain("vertex colours", [1.0; 4]))?;
        }
        let (mut textured, mut bare) = (0, 0);
        let mut colors = Vec::with_capacity(self.raw.triangles.len());
        let mut replaced = vec![false; self.raw.materials.len()];
        for (t, triangle) in self.raw.triangles.iter().enumerate() {
            let material = self.raw.material(t);
            if self.raw.materials[material].base_color_texture.is_some() {
                textured += 1;
                colors.push([WHITE; 3]);
                continue;
            }
            let found = triangle.map(linear_of);
            bare += usize::from(found.contains(&None));
            replaced[material] = true;
            colors.push(found.map(|color| color.unwrap_or(WHITE)));
        }
        for (material, _) in self.raw.materials.iter_mut().zip(replaced).filter(|(_, replaced)| *replaced) {
            material.base_color = [1.0, 1.0, 1.0, material.base_color[3]];
        }
        self.raw.corner_colors = colors;
        if textured > 0 {
            let triangles = counted(textured, "triangle");
            self.raw.warnings.push(format!("the vertex colours of {triangles} with a texture are not used"));
        }
        if bare > 0 {
            let triangles = counted(bare, "triangle");
            self.raw
                .lose_color(format!("corners of {triangles} have no vertex colour as others have: they stay white"));
        }
        Ok(())
    }

    fn resolve_corners(&mut self) -> Parsed<()> {
        let positions = self.raw.positions.len();
        let uvs = self.texture_coordinates.len();
        for ((triangle, uv), line) in self.raw.triangles.iter().zip(&self.corner_uvs).zip(&self.lines) {
            if let Some(i) = triangle.iter().find(|&&i| i as usize >= positions) {
                let found = format!("position {}", u64::from(*i) + 1);
                return Err(Fault::new(format!("line {line}"), found, format!("an index from 1 to {positions}")));
            }
            if let Some(i) = uv.iter().find(|&&i| uvs > 0 && i != NO_UV && i as usize >= uvs) {
                let found = format!("texture coordinate {}", u64::from(*i) + 1);
                return Err(Fault::new(format!("line {line}"), found, format!("an index from 1 to {uvs}")));
            }
        }
        if let (Some(line), true) = (self.nowhere, uvs > 0) {
            let found = "a number that no texture coordinate has";
            return Err(Fault::new(format!("line {line}"), found, format!("an index from 1 to {uvs}")));
        }
        if uvs == 0 && self.corner_uvs.iter().flatten().any(|&i| i != NO_UV) || self.nowhere.is_some() {
            let warning = "faces number texture coordinates, and the file has none: it is read without".to_owned();
            self.raw.warnings.push(warning);
            return Ok(());
        }
        let bare = self.corner_uvs.iter().filter(|uv| uv.contains(&NO_UV)).count();
        if bare == self.corner_uvs.len() {
            return Ok(());
        }
        let look_up = |i: u32| if i == NO_UV { NO_COORDINATE } else { self.texture_coordinates[i as usize] };
        self.raw.uvs = self.corner_uvs.iter().map(|uv| uv.map(look_up)).collect();
        if bare > 0 {
            self.raw
                .warnings
                .push(format!("{bare} of {} triangles have no texture coordinates", self.corner_uvs.len()));
        }
        Ok(())
    }
}

/// The next `N` words as numbers.
fn numbers<'w, const N: usize>(words: &mut impl Iterator<Item = &'w [u8]>) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = number(words.next()?)?;
    }
    Some(values)
}

/// Index from 0 of a word that counts from 1 or, below 0, back from the latest of `count`.
fn index(word: &[u8], count: usize) -> Option<u32> {
    let value: i64 = std::str::from_utf8(word).ok()?.parse().ok()?;
    let zero_based = if value < 0 { count as i64 + value } else { value - 1 };
    u32::try_from(zero_based).ok().filter(|&i| i != NO_UV)
}

/// Everything after the keyword.
fn argument(line: &[u8]) -> String {
    let line = or_latin_1(line);
    let line = line.trim();
    line.split_once(char::is_whitespace).map_or("", |(_, rest)| rest).trim().to_owned()
}
