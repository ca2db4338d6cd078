//! What a PLY's faces look like: textures by number, colours of vertices or faces.
//!
//! Colours are taken for sRGB. Faces with a texture show that alone: scanners write the same colours coarsely by vertex
//! and finely as a texture.

use super::ply_header::{Kind, Property, Scalar};
use super::raw::{RawMesh, WHITE, plain};
use super::surface::full_value;
use super::{Source, texture};
use crate::colour::srgb_to_linear;
use crate::mesh::error::{Fault, Parsed};
use crate::words::counted;

/// Materials: one a texture, or one for the colours.
pub(super) fn dress(raw: &mut RawMesh, source: &Source, files: &[String], textures: &Textures) -> Parsed<()> {
    for name in files {
        let mut material = plain(if files.len() > 1 { name } else { "texture" }, [1.0; 4]);
        match source.read(&source.companion(name)).and_then(|bytes| texture::decode(&bytes)) {
            Ok(texture) => {
                let (texture, told) = texture::without_holes(texture, &format!("texture `{name}`"));
                raw.warnings.extend(told);
                material.base_color_texture = Some(texture);
            }
            Err(reason) => {
                raw.lose_color(format!("texture `{name}` cannot be read ({reason}): the surface stays plain"))
            }
        }
        raw.add_material(|| "the header".to_owned(), material)?;
    }
    let is_bare = textures.of.contains(&Textures::NONE);
    if files.len() > 1 || is_bare && !files.is_empty() {
        let bare = match is_bare {
            true => raw.add_material(|| "the header".to_owned(), plain("without texture", [1.0; 4]))?,
            false => 0,
        };
        let is_plain = |t: usize| raw.corner_colors.get(t).is_none_or(|colors| *colors == [WHITE; 3]);
        let white = (0..textures.of.len()).filter(|&t| textures.of[t] == Textures::NONE && is_plain(t)).count();
        if white > 0 {
            raw.warnings.push(format!("{} without a texture: white", counted(white, "triangle")));
        }
        raw.material_of =
            textures.of.iter().map(|&number| if number == Textures::NONE { bare } else { number }).collect();
    }
    raw.corner_colors.truncate(raw.triangles.len());
    let colored = raw.corner_colors.iter().any(|colors| *colors != [WHITE; 3]);
    if files.is_empty() {
        if !raw.corner_colors.is_empty() {
            raw.add_material(|| "the header".to_owned(), plain("vertex colours", [1.0; 4]))?;
        }
    } else if colored {
        let mut unused = 0;
        for t in 0..raw.corner_colors.len() {
            // A texture that cannot be read is lost, whatever the vertices' colours.
            if textures.of.get(t) != Some(&Textures::NONE) && raw.corner_colors[t] != [WHITE; 3] {
                raw.corner_colors[t] = [WHITE; 3];
                unused += 1;
            }
        }
        if unused > 0 {
            let triangles = counted(unused, "triangle");
            raw.warnings.push(format!("the vertex colours of {triangles} with a texture are not used"));
        }
    }
    if files.len() > 1 && !textures.numbered {
        raw.lose_color(format!("which of {} textures a face has is not said by a texnumber", files.len()));
    }
    if files.is_empty() && textures.of.iter().any(|&number| number != Textures::NONE) && textures.numbered {
        raw.lose_color("faces name textures by number, but no comment names a TextureFile".to_owned());
    }
    Ok(())
}

/// Which texture every triangle has.
pub(super) struct Textures {
    /// Parallel to the triangles.
    of: Vec<u16>,
    count: usize,
    /// Whether faces name any.
    numbered: bool,
}

impl Textures {
    const NONE: u16 = u16::MAX;

    /// For faces that may name so many.
    pub(super) fn new(count: usize) -> Self {
        Self { of: Vec::new(), count, numbered: false }
    }

    /// Texture of a face that names one, or none.
    pub(super) fn number(&mut self, named: Option<f64>, place: impl Fn() -> String) -> Parsed<u16> {
        self.numbered |= named.is_some();
        match named {
            None => Ok(0),
            // Without a texture, by MeshLab's custom.
            Some(number) if number < 0.0 => Ok(Self::NONE),
            Some(number) if self.count == 0 || number < self.count.min(usize::from(Self::NONE)) as f64 => {
                Ok(number as u16)
            }
            Some(number) => {
                let found = format!("texnumber {number}");
                Err(Fault::new(place(), found, format!("a number below {}, the TextureFile comments", self.count)))
            }
        }
    }

    /// Gives the triangles added since to a texture.
    pub(super) fn fill(&mut self, triangles: usize, number: u16) {
        self.of.resize(triangles, number);
    }
}

/// Where an element's colour stands, and what its full value is.
pub(super) struct ColorProperties {
    at: [usize; 3],
    full: [f64; 3],
}

impl ColorProperties {
    pub(super) fn of(properties: &[Property]) -> Option<Self> {
        let find = |names: [&str; 3]| {
            let at = names.map(|name| properties.iter().position(|p| p.name.eq_ignore_ascii_case(name)));
            let [Some(r), Some(g), Some(b)] = at else { return None };
            Some([r, g, b])
        };
        let at = find(["red", "green", "blue"])
            .or_else(|| find(["diffuse_red", "diffuse_green", "diffuse_blue"]))
            .or_else(|| find(["r", "g", "b"]))?;
        let full = at.map(|i| match properties[i].kind {
            Kind::One(Scalar::I8) => 127.0,
            Kind::One(Scalar::U8) => 255.0,
            Kind::One(Scalar::I16) => 32_767.0,
            Kind::One(Scalar::U16) => 65_535.0,
            // Whole numbers of unmeasured width are bytes.
            Kind::One(Scalar::I32 | Scalar::U32 | Scalar::I64 | Scalar::U64) => 255.0,
            _ => 1.0,
        });
        Some(Self { at, full })
    }

    /// Encoded RGB.
    pub(super) fn read(&self, values: &[f64]) -> [f32; 3] {
        std::array::from_fn(|c| (values[self.at[c]] / self.full[c]) as f32)
    }
}

/// Encoded colours to linear.
pub(super) fn linear_colors(colors: &mut [[f32; 3]]) {
    let full = full_value(colors.iter().flatten().copied());
    for c in colors.iter_mut().flatten() {
        *c = if c.is_finite() { srgb_to_linear(c.clamp(0.0, full) / full) } else { 0.0 };
    }
}
