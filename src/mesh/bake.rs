//! Base colours that one repeating texture a material cannot show, made into textures that can.
//!
//! Who lays colours on a surface knows materials, textures that repeat, and texture coordinates. Colours of corners,
//! and textures that are mirrored or end at their edges, become that here: triangles of one colour all over get a
//! material of their own, all others a block of texels in new textures. The corners of a triangle lie on the centres of
//! its block's texels, so that interpolating between texels interpolates over the triangle; blocks keep two texels
//! apart, so that no lookup reaches another's.
//!
//! ```text
//!   . . . . . .      a . corner 0 on texel (1, 1) of its place
//!   . a * * b .      b . corner 1 as many texels away as side 0-1 needs
//!   . * * * . .      c . corner 2 as side 0-2 needs
//!   . c * . . .      . . not under the triangle: its own nearest colour, or nothing
//!   . . . . . .
//! ```
//!
//! A block has two texels for each texel of the texture under it (one where that is too many), and as many as colours
//! differ in steps of [`STEP`]. Triangles that need none of this keep materials and coordinates bit for bit.

mod page;

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};

use self::page::{Block, Page, pack};
use super::{SurfaceMaterial, TriangleMesh, Wrap, project::Projector};
use crate::colour::{byte_to_linear, linear_to_byte, linear_to_srgb};

/// Difference of encoded colours between neighbouring texels: 8 of 255 levels, a quarter of what the texels of a
/// stacking's cluster differ by.
const STEP: f32 = 1.0 / 32.0;
/// Encoded colours closer than this are one: half a level of 8 bits.
const SAME: f32 = 0.5 / 255.0;
/// Most colours that become materials; each is a page of the target, drawn by a pass over all triangles.
const MAX_PLAIN: usize = 256;
/// Longest side of a block; shorter where blocks have fewer texels than the texture, so that all fit in the end.
const MAX_SIDE: f32 = 1024.0;
/// Texels that all blocks together may have: some 40 bytes each while targets are made, a third of a GiB.
const MAX_TEXELS: usize = 1 << 23;
/// How far beyond [0, 1], in texels, coordinates may lie by rounding.
const EDGE: f32 = 0.01;

impl TriangleMesh {
    /// Rewrites materials and texture coordinates so that [`Self::corner_colors`] are empty and every texture repeats,
    /// whatever the colours were. `detail` is the size of another texture over the coordinates as they are: blocks are
    /// fine enough for it too, and say where their texels were ([`SurfaceMaterial::baked_from`]).
    ///
    /// Says whether anything had to be done.
    pub fn bake_base_color(&mut self, detail: Option<(u32, u32)>) -> bool {
        let plan: Vec<Look> = (0..self.triangles.len()).map(|t| self.look(t)).collect();
        if plan.iter().all(|look| *look == Look::AsItIs) {
            self.corner_colors.clear();
            return false;
        }
        // Parts of a triangle may get texels of their own.
        self.patch_of.clear();
        self.uvs.resize(self.triangles.len(), [Vec2::ZERO; 3]);
        self.material_of.resize(self.triangles.len(), 0);
        let mut plain: BTreeMap<(u16, [u32; 3]), Vec<usize>> = BTreeMap::new();
        let mut blocks = Vec::new();
        for (t, look) in plan.iter().enumerate() {
            match look {
                Look::AsItIs => {}
                Look::OneColor => {
                    let key = (self.material_of[t], self.corner_colors[t][0].map(f32::to_bits));
                    plain.entry(key).or_default().push(t);
                }
                Look::Varied => blocks.push(t),
            }
        }
        let room = (usize::from(u16::MAX) + 1).saturating_sub(self.materials.len() + 64);
        if plain.len() <= MAX_PLAIN.min(room) {
            for ((material, color), triangles) in plain {
                let index = self.materials.len() as u16;
                self.materials.push(tinted(&self.materials[usize::from(material)], color.map(f32::from_bits)));
                triangles.into_iter().for_each(|t| self.material_of[t] = index);
            }
        } else {
            blocks.extend(plain.into_values().flatten());
            blocks.sort_unstable();
        }
        self.bake_by_path(&blocks, Detail::of(detail));
        self.corner_colors.clear();
        self.drop_unused_materials();
        true
    }

    fn look(&self, t: usize) -> Look {
        let material = self.materials.get(self.material_index(t));
        let texture = material.and_then(|material| Some((material.base_color_texture.as_ref()?, material.wrap)));
        let leaves = |axis: usize, size: u32| {
            let edge = EDGE / size as f32;
            self.uvs.get(t).is_some_and(|uvs| uvs.iter().any(|uv| !(-edge..=1.0 + edge).contains(&uv[axis])))
        };
        if texture.is_some_and(|(texture, wrap)| {
            let sizes = [texture.width, texture.height];
            (0..2).any(|axis| wrap[axis] != Wrap::Repeat && leaves(axis, sizes[axis]))
        }) {
            return Look::Varied;
        }
        match self.corner_colors.get(t) {
            None => Look::AsItIs,
            Some(colors) if *colors == [[1.0; 3]; 3] => Look::AsItIs,
            Some([a, b, c]) if a == b && b == c => Look::OneColor,
            Some(_) => Look::Varied,
        }
    }

    fn material_index(&self, t: usize) -> usize {
        self.material_of.get(t).copied().unwrap_or(0).into()
    }

    /// Lays all triangles out anew, fine enough for images that are projected onto them: every texel gets its colour
    /// and says where the images lie there ([`SurfaceMaterial::projected`]). An image is `tile_mm` wide;
    /// `texels_per_mm` are those of the finest.
    pub fn bake_projection(&mut self, tile_mm: f64, texels_per_mm: f64) {
        let projector = Projector::new(self, tile_mm, texels_per_mm);
        if self.materials.is_empty() {
            self.materials.push(SurfaceMaterial::plain("projected", [1.0; 4]));
        }
        self.patch_of.clear();
        self.uvs.resize(self.triangles.len(), [Vec2::ZERO; 3]);
        self.material_of.resize(self.triangles.len(), 0);
        self.bake_by_path(&(0..self.triangles.len()).collect::<Vec<_>>(), Detail::Projected(&projector));
        self.corner_colors.clear();
        self.drop_unused_materials();
    }

    /// Bakes triangles, those with the same mean free path on pages of their own.
    fn bake_by_path(&mut self, triangles: &[usize], detail: Detail) {
        let mut groups: BTreeMap<Option<[u64; 3]>, Vec<usize>> = BTreeMap::new();
        for &t in triangles {
            let material = self.materials.get(self.material_index(t));
            let path = material.and_then(|material| material.mean_free_path_mm);
            groups.entry(path.map(|path| path.map(f64::to_bits))).or_default().push(t);
        }
        for (path, triangles) in groups {
            let first = self.materials.len();
            self.bake_blocks(&triangles, detail);
            let path = path.map(|path| path.map(f64::from_bits));
            self.materials[first..].iter_mut().for_each(|material| material.mean_free_path_mm = path);
        }
    }

    fn bake_blocks(&mut self, triangles: &[usize], detail: Detail) {
        if triangles.is_empty() {
            return;
        }
        let mut blocks: Vec<Block> = Vec::new();
        // Two texels a texel, or one, or fewer until all fit.
        for fineness in (0..12).map(|halvings| 2.0 / (1 << halvings) as f32) {
            blocks = triangles.iter().map(|&t| self.block(t, detail, fineness)).collect();
            if blocks.iter().map(Block::room).sum::<usize>() <= MAX_TEXELS {
                break;
            }
        }
        let sizes = pack(&mut blocks);
        let mut pages: Vec<Page> = sizes.into_iter().map(|size| Page::new(size, detail)).collect();
        let first = self.materials.len();
        for block in &blocks {
            self.paint(block, detail, &mut pages[block.page]);
        }
        for block in &blocks {
            self.uvs[block.triangle] = block.uvs(&pages[block.page]);
            self.material_of[block.triangle] = (first + block.page) as u16;
        }
        self.materials.extend(pages.into_iter().map(Page::finished));
    }

    /// How large a triangle's block is.
    fn block(&self, t: usize, detail: Detail, fineness: f32) -> Block {
        let uvs = self.uvs[t];
        let texture = self.materials.get(self.material_index(t)).and_then(|m| m.base_color_texture.as_ref());
        let texels = texture.map(|texture| Vec2::new(texture.width as f32, texture.height as f32));
        let over = if let Detail::Coordinates(texels) = detail { Some(texels) } else { None };
        let fine = texels.into_iter().chain(over).reduce(Vec2::max).unwrap_or(Vec2::ZERO);
        let projected = |a: usize, b: usize| match detail {
            Detail::Projected(projector) => projector.texels(self, t, [a, b]),
            _ => 0.0,
        };
        let colors = self.corner_colors.get(t).copied().unwrap_or([[1.0; 3]; 3]);
        let encoded = colors.map(|color| Vec3::from(color.map(encoded)));
        let difference = |a: usize, b: usize| (encoded[a] - encoded[b]).abs().max_element();
        let length = |a: usize, b: usize| ((uvs[a] - uvs[b]) * fine).length().max(projected(a, b));
        // The longest side lies across the block.
        let needs = |a: usize, b: usize| length(a, b) * fineness + difference(a, b) / STEP * fineness.min(1.0);
        let sides = [needs(1, 2), needs(2, 0), needs(0, 1)];
        let apex = (0..3).fold(0, |best, i| if sides[i] > sides[best] { i } else { best });
        let order = [apex, (apex + 1) % 3, (apex + 2) % 3];
        let side = |a: usize, b: usize| {
            let is_even = difference(a, b) <= SAME && !(length(a, b) > 0.0);
            let needed = if is_even { 0.0 } else { needs(a, b).ceil().max(1.0) };
            // What is no number takes no room.
            needed.min(MAX_SIDE * fineness.min(1.0)) as usize + 1
        };
        let mut size = [side(order[0], order[1]), side(order[0], order[2])];
        if size[0].max(size[1]) == 1 && difference(order[1], order[2]) > SAME {
            size = [2, 2];
        }
        Block { triangle: t, order, size, page: 0, corner: [0; 2] }
    }

    /// Colours a block's texels, and those around it like the nearest inside.
    fn paint(&self, block: &Block, detail: Detail, page: &mut Page) {
        let t = block.triangle;
        let material = self.materials.get(self.material_index(t));
        let [r, g, b, _] = material.map_or([1.0; 4], |material| material.base_color);
        let factor = Vec3::new(r, g, b);
        let colors = self.corner_colors.get(t).copied().unwrap_or([[1.0; 3]; 3]).map(Vec3::from);
        let uvs = self.uvs[t];
        for y in 0..block.size[1] {
            for x in 0..block.size[0] {
                let share = |at: usize, size: usize| if size > 1 { at as f32 / (size - 1) as f32 } else { 0.0 };
                let [mut second, mut third] = [share(x, block.size[0]), share(y, block.size[1])];
                let sum = second + third;
                if sum > 1.0 {
                    (second, third) = (second / sum, third / sum);
                }
                let weights = [1.0 - second - third, second, third];
                let mut corner_weights = [0.0; 3];
                block.order.iter().zip(weights).for_each(|(&corner, weight)| corner_weights[corner] = weight);
                let [wa, wb, wc] = corner_weights;
                let uv = uvs[0] * wa + uvs[1] * wb + uvs[2] * wc;
                let color = colors[0] * wa + colors[1] * wb + colors[2] * wc;
                let color = color * factor * material.map_or(Vec3::ONE, |material| sample(material, uv));
                let index = block.corner[0] + x + page.size[0] * (block.corner[1] + y);
                let [r, g, b] = color.to_array().map(byte);
                page.texels[index] = [r, g, b, 255];
                if let Some(from) = page.from.get_mut(index) {
                    *from = uv;
                }
                if let (Some(at), Detail::Projected(projector)) = (page.projected.get_mut(index), detail) {
                    *at = projector.at(self, t, corner_weights);
                }
            }
        }
    }

    /// Materials that no triangle has any more would be pages for nothing.
    fn drop_unused_materials(&mut self) {
        let mut is_used = vec![false; self.materials.len()];
        self.material_of.iter().for_each(|&material| is_used[usize::from(material)] = true);
        let mut next = 0;
        let renamed: Vec<u16> = is_used
            .iter()
            .map(|&used| {
                next += u16::from(used);
                next.saturating_sub(1)
            })
            .collect();
        self.material_of.iter_mut().for_each(|material| *material = renamed[usize::from(*material)]);
        let mut used = is_used.into_iter();
        self.materials.retain(|_| used.next() == Some(true));
    }
}

/// What blocks are to be fine enough for besides colours.
#[derive(Clone, Copy)]
enum Detail<'a> {
    Nothing,
    /// An image of so many texels over the texture coordinates.
    Coordinates(Vec2),
    /// Images that are projected.
    Projected(&'a Projector),
}

impl Detail<'_> {
    fn of(size: Option<(u32, u32)>) -> Self {
        size.map_or(Self::Nothing, |(width, height)| Self::Coordinates(Vec2::new(width as f32, height as f32)))
    }
}

/// What a triangle needs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Look {
    AsItIs,
    /// Its material, tinted.
    OneColor,
    /// Texels of its own.
    Varied,
}

/// A material in another colour.
fn tinted(material: &SurfaceMaterial, color: [f32; 3]) -> SurfaceMaterial {
    let [r, g, b, alpha] = material.base_color;
    let base_color = [r * color[0], g * color[1], b * color[2], alpha];
    SurfaceMaterial { base_color, ..material.clone() }
}

/// Linear RGB of a material's texture at `uv`, wherever that is: of the texel that it falls into.
fn sample(material: &SurfaceMaterial, uv: Vec2) -> Vec3 {
    let Some(texture) = &material.base_color_texture else { return Vec3::ONE };
    let texel = |at: f32, size: u32, wrap: Wrap| {
        let at = if at.is_finite() { at } else { 0.0 };
        let within = match wrap {
            Wrap::Repeat => at.rem_euclid(1.0),
            Wrap::Mirror => 1.0 - (at.rem_euclid(2.0) - 1.0).abs(),
            Wrap::Clamp => at.clamp(0.0, 1.0),
        };
        ((within * size as f32) as u32).min(size - 1) as usize
    };
    let (x, y) = (texel(uv.x, texture.width, material.wrap[0]), texel(uv.y, texture.height, material.wrap[1]));
    let [r, g, b, _] = texture.texels[x + texture.width as usize * y];
    Vec3::new(byte_to_linear(r), byte_to_linear(g), byte_to_linear(b))
}

/// What cannot be told apart in bytes need not be told apart here: light encoded, cut off at both ends.
fn encoded(linear: f32) -> f32 {
    linear_to_srgb(f64::from(finite(linear)).clamp(0.0, 1.0)) as f32
}

fn byte(linear: f32) -> u8 {
    linear_to_byte(finite(linear).into())
}

/// What is no number is no light.
fn finite(linear: f32) -> f32 {
    if linear.is_nan() { 0.0 } else { linear }
}

#[cfg(test)]
mod tests;
