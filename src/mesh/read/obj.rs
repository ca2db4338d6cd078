//! Wavefront OBJ: `v`, `vt`, `f`, `usemtl`, `mtllib`; everything else does not concern a surface.
//!
//! Polygons become fans around their first corner, which is right for convex ones. Homogeneous weights and vertex colours
//! after x y z are ignored. v is turned to grow downwards.

use std::collections::HashMap;
use std::path::PathBuf;

use glam::{DVec3, Vec2};

use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::{Source, mtl};
use crate::mesh::SurfaceMaterial;
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

/// Marks a corner without texture coordinate.
const NO_UV: u32 = u32::MAX;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let mut reader = Reader::new(source);
    for (number, line) in Lines::new(source.bytes) {
        reader.line(number, &line)?;
    }
    reader.finish()
}

/// Lines with their numbers, a backslash at the end joining the next.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }

    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        self.rest = &self.rest[(end + 1).min(self.rest.len())..];
        Some(line.trim_ascii_end())
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, std::borrow::Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut line = std::borrow::Cow::Borrowed(self.physical()?);
        let number = self.number;
        while line.last() == Some(&b'\\') {
            let joined = line.to_mut();
            joined.pop();
            joined.push(b' ');
            match self.physical() {
                Some(next) => joined.extend_from_slice(next),
                None => break,
            }
        }
        Some((number, line))
    }
}

/// A corner as the file names it: indices from 0.
#[derive(Clone, Copy)]
struct Corner {
    position: u32,
    uv: u32,
}

struct Reader<'a> {
    source: &'a Source<'a>,
    raw: RawMesh,
    texture_coordinates: Vec<Vec2>,
    corner_uvs: Vec<[u32; 3]>,
    /// Line of every triangle, for complaints about indices that only the end of the file proves wrong.
    lines: Vec<usize>,
    library: Vec<SurfaceMaterial>,
    /// Index into `raw.materials` by name.
    used: HashMap<String, u16>,
    current: Option<u16>,
    polygon: Vec<Corner>,
    thin_faces: usize,
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
            used: HashMap::new(),
            current: None,
            polygon: Vec::new(),
            thin_faces: 0,
        }
    }

    fn line(&mut self, number: usize, line: &[u8]) -> Parsed<()> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => {
                let p = numbers::<3>(&mut words)
                    .ok_or_else(|| Fault::new(format!("line {number}"), quote(line), "`v x y z` with three numbers"))?;
                self.raw.positions.push(finite(DVec3::from_array(p), || format!("line {number}"))?);
            }
            Some(b"vt") => {
                let [u] = numbers::<1>(&mut words)
                    .ok_or_else(|| Fault::new(format!("line {number}"), quote(line), "`vt u v` with two numbers"))?;
                let [v] = numbers::<1>(&mut words).unwrap_or([0.0]);
                self.texture_coordinates.push(uv_or_zero(Vec2::new(u as f32, (1.0 - v) as f32)));
            }
            Some(b"f" | b"fo") => self.face(number, line, words)?,
            Some(b"usemtl") => self.use_material(number, &argument(line))?,
            Some(b"mtllib") => self.libraries(&argument(line)),
            _ => {}
        }
        Ok(())
    }

    fn face<'w>(&mut self, number: usize, line: &[u8], words: impl Iterator<Item = &'w [u8]>) -> Parsed<()> {
        self.polygon.clear();
        for word in words {
            let mut parts = word.split(|&b| b == b'/');
            let position = parts.next().and_then(|w| index(w, self.raw.positions.len()));
            let uv = match parts.next() {
                None | Some(b"") => Some(NO_UV),
                Some(w) => index(w, self.texture_coordinates.len()),
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

    /// One name with spaces, or several without.
    fn libraries(&mut self, names: &str) {
        let whole = self.source.companion(names);
        let paths = match names.split_whitespace().count() {
            2.. if !whole.exists() => names.split_whitespace().map(|name| self.source.companion(name)).collect(),
            _ => Vec::new(),
        };
        let several = paths.iter().any(|path: &PathBuf| path.exists());
        for path in if several { paths } else { vec![whole] } {
            mtl::read(self.source, &path, &mut self.library, &mut self.raw);
        }
    }

    fn finish(mut self) -> Parsed<RawMesh> {
        self.resolve_corners()?;
        let mut missing = Vec::new();
        for material in self.raw.materials.iter_mut().filter(|m| !m.name.is_empty()) {
            // The last definition of a name counts, as for a renderer that reads from the top.
            match self.library.iter().rev().find(|defined| defined.name == material.name) {
                Some(defined) => *material = defined.clone(),
                None => missing.push(material.name.as_str()),
            }
        }
        if !missing.is_empty() {
            let missing = format!("materials nowhere defined stay white: `{}`", missing.join("`, `"));
            self.raw.lose_color(missing);
        }
        if self.thin_faces > 0 {
            self.raw
                .warnings
                .push(format!("{} with fewer than three corners skipped", counted(self.thin_faces, "face")));
        }
        Ok(self.raw)
    }

    fn resolve_corners(&mut self) -> Parsed<()> {
        let positions = self.raw.positions.len();
        let uvs = self.texture_coordinates.len();
        for ((triangle, uv), line) in self.raw.triangles.iter().zip(&self.corner_uvs).zip(&self.lines) {
            if let Some(i) = triangle.iter().find(|&&i| i as usize >= positions) {
                let found = format!("position {}", u64::from(*i) + 1);
                return Err(Fault::new(format!("line {line}"), found, format!("an index from 1 to {positions}")));
            }
            if let Some(i) = uv.iter().find(|&&i| i != NO_UV && i as usize >= uvs) {
                let found = format!("texture coordinate {}", u64::from(*i) + 1);
                return Err(Fault::new(format!("line {line}"), found, format!("an index from 1 to {uvs}")));
            }
        }
        let bare = self.corner_uvs.iter().filter(|uv| uv.contains(&NO_UV)).count();
        if bare == self.corner_uvs.len() {
            return Ok(());
        }
        let look_up = |i: u32| if i == NO_UV { Vec2::ZERO } else { self.texture_coordinates[i as usize] };
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
        *value = std::str::from_utf8(words.next()?).ok()?.parse().ok()?;
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
    let line = String::from_utf8_lossy(line);
    let line = line.trim();
    line.split_once(char::is_whitespace).map_or("", |(_, rest)| rest).trim().to_owned()
}
