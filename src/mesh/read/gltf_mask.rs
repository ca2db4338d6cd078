//! What glTF's alpha cuts out, or leaves wholly transparent: colours there are no viewer's.
//!
//! Alpha is the product of the base colour's factor, its texture and COLOR_0 (glTF 2.0, section 3.9.2). The surface
//! stays, in the colour of the nearest texel or corner that is left, and it is said.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use glam::DVec3;
use gltf::material::AlphaMode;
use gltf::mesh::Primitive;
use gltf::{Document, Material, Semantic};

use super::gltf::{triangle, triangle_count};
use super::gltf_material::{BaseColor, name_of};
use super::raw::RawMesh;
use super::{accessor, texture};
use crate::mesh::Texture;
use crate::mesh::error::Parsed;
use crate::words::counted;

/// Alpha below which nothing is seen; `None` where it does not count.
fn cutoff(material: &Material) -> Option<f32> {
    match material.alpha_mode() {
        AlphaMode::Opaque => None,
        AlphaMode::Mask => Some(material.alpha_cutoff().unwrap_or(0.5)),
        // Only what cannot be seen at all.
        AlphaMode::Blend => Some(f32::MIN_POSITIVE),
    }
}

/// Says of a material that none of it is seen: what a mask cuts out has no colour, what is transparent is printed in
/// the one it has.
fn say_unseen(material: &Material, cut: &str, raw: &mut RawMesh) {
    let name = name_of(material);
    if material.alpha_mode() == AlphaMode::Mask {
        raw.lose_color(format!("the alpha of material `{name}` {cut}"));
    } else {
        raw.warnings.push(format!("material `{name}` is wholly transparent; its surface is printed all the same"));
    }
}

/// What is known of the alpha of vertices.
pub(super) struct Alphas {
    /// By material, of those whose alpha counts.
    ranges: BTreeMap<usize, Range>,
    /// By the material's name.
    cut: BTreeMap<String, Cut>,
    /// Accessors of positions, indices and colours, and materials, whose corners are in `cut`.
    counted: BTreeSet<([Option<usize>; 3], Option<usize>)>,
}

/// The alpha of a material without its texture: its factor's times its vertices'.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    /// Of vertices that are not cut out by themselves.
    least: f32,
    greatest: f32,
}

impl Range {
    const NOTHING: Self = Self { least: f32::INFINITY, greatest: f32::NEG_INFINITY };

    fn with(self, alpha: f32, cutoff: f32) -> Self {
        let least = if alpha < cutoff { self.least } else { self.least.min(alpha) };
        Self { least, greatest: self.greatest.max(alpha) }
    }
}

/// Corners of a material that cannot be seen.
#[derive(Default)]
struct Cut {
    /// Those that took another's colour.
    filled: usize,
    /// Those of whole pieces that a mask cuts out.
    lost: usize,
    /// Those of whole pieces that are wholly transparent.
    clear: usize,
}

impl Alphas {
    pub(super) fn of(document: &Document, buffers: &[Vec<u8>]) -> Self {
        let mut ranges: BTreeMap<usize, Range> = BTreeMap::new();
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()) {
            let material = primitive.material();
            let (Some(index), Some(cutoff)) = (material.index(), cutoff(&material)) else { continue };
            let factor = BaseColor::of(&material).factor[3];
            // What is wrong with an accessor is said where it is read for good.
            let values = primitive.get(&Semantic::Colors(0)).and_then(|c| accessor::alphas(&c, buffers).ok()?);
            let range = ranges.entry(index).or_insert(Range::NOTHING);
            for alpha in values.as_deref().unwrap_or(&[1.0]) {
                *range = range.with(factor * alpha, cutoff);
            }
        }
        Self { ranges, cut: BTreeMap::new(), counted: BTreeSet::new() }
    }

    /// What vertices there are says; the factor, where there are none.
    fn range(&self, material: &Material) -> Range {
        let known = material.index().and_then(|index| self.ranges.get(&index)).copied();
        let factor = BaseColor::of(material).factor[3];
        known.filter(|range| *range != Range::NOTHING).unwrap_or(Range { least: factor, greatest: factor })
    }

    fn is_unseen(&self, material: &Material) -> bool {
        cutoff(material).is_some_and(|cutoff| self.range(material).greatest < cutoff)
    }

    /// Says so of a material without texture that is not seen anywhere.
    pub(super) fn note_unseen(&self, material: &Material, raw: &mut RawMesh) {
        if self.is_unseen(material) {
            say_unseen(material, "cuts out all of it", raw);
        }
    }

    /// The texture where it shows.
    pub(super) fn without_holes(&self, texture: Arc<Texture>, material: &Material, raw: &mut RawMesh) -> Arc<Texture> {
        let Some(cutoff) = cutoff(material) else { return texture };
        let Range { least, greatest } = self.range(material);
        let is_seen = |texel: &[u8; 4], alpha: f32| f32::from(texel[3]) / 255.0 * alpha >= cutoff;
        let cut: Vec<bool> = texture.texels.iter().map(|texel| !is_seen(texel, greatest)).collect();
        let count = cut.iter().filter(|&&cut| cut).count();
        if count == cut.len() {
            say_unseen(material, "cuts out its whole texture", raw);
            return texture;
        }
        let name = name_of(material);
        // Where corners do not hide everything alone, they hide more of the texture than is known here.
        let is_mixed = |texel: &[u8; 4]| texel[3] < 255 && is_seen(texel, greatest) && !is_seen(texel, least);
        if texture.texels.iter().any(is_mixed) {
            raw.warnings.push(format!(
                "the alpha of vertices and texture together cuts more out of material `{name}` than either: there the \
                 surface stays in the texture's colours"
            ));
        }
        if count == 0 {
            return texture;
        }
        raw.warnings.push(format!(
            "the alpha of material `{name}` cuts {} out of its texture: the surface stays, in the colour of the \
             nearest texel left",
            counted(count, "texel")
        ));
        Arc::new(texture::filled(&texture, &cut))
    }

    /// Gives corners that are cut out the colour of the nearest one left, in steps over edges.
    pub(super) fn fill(
        &mut self,
        primitive: &Primitive,
        buffers: &[Vec<u8>],
        points: &[DVec3],
        corners: &[u32],
        colors: &mut [[f32; 3]],
    ) -> Parsed<()> {
        let material = primitive.material();
        let Some(accessor) = primitive.get(&Semantic::Colors(0)) else { return Ok(()) };
        let Some(cutoff) = cutoff(&material) else { return Ok(()) };
        let Some(alphas) = accessor::alphas(&accessor, buffers)? else { return Ok(()) };
        let factor = BaseColor::of(&material).factor[3];
        let is_cut = |corner: &u32| factor * alphas[*corner as usize] < cutoff;
        // What is cut out all over, by whatever, is said of the material.
        if !corners.iter().any(is_cut) || self.is_unseen(&material) {
            return Ok(());
        }
        let places = places(corners.iter().map(|&corner| points[corner as usize]));
        let mut known = vec![None; places.iter().max().map_or(0, |last| last + 1)];
        for (&place, corner) in places.iter().zip(corners).filter(|(_, corner)| !is_cut(corner)) {
            known[place].get_or_insert(colors[*corner as usize]);
        }
        let triangles = 0..triangle_count(primitive.mode(), corners.len());
        spread(&mut known, triangles.map(|t| triangle(primitive.mode(), t).map(|corner| places[corner])));
        // However often these corners are placed, they are counted once.
        let of = [primitive.get(&Semantic::Positions), primitive.indices(), Some(accessor)];
        let is_new = self.counted.insert((of.map(|values| Some(values?.index())), material.index()));
        let cut = self.cut.entry(name_of(&material)).or_default();
        let mut is_done = vec![false; colors.len()];
        for (corner, place) in corners.iter().zip(places).filter(|(corner, _)| is_cut(corner)) {
            if std::mem::replace(&mut is_done[*corner as usize], true) {
                continue;
            }
            let count = match known[place] {
                Some(color) => {
                    colors[*corner as usize] = color;
                    &mut cut.filled
                }
                None if material.alpha_mode() == AlphaMode::Mask => &mut cut.lost,
                None => &mut cut.clear,
            };
            *count += usize::from(is_new);
        }
        Ok(())
    }

    /// Says what was cut out.
    pub(super) fn tell(&self, raw: &mut RawMesh) {
        for (name, cut) in &self.cut {
            if cut.filled > 0 {
                raw.warnings.push(format!(
                    "the alpha of vertices cuts {} out of material `{name}`: the surface stays, in the colour of the \
                     nearest corner left",
                    counted(cut.filled, "corner")
                ));
            }
            if cut.lost > 0 {
                raw.lose_color(format!(
                    "the alpha of vertices cuts whole pieces of material `{name}` out, {}: what colour they have is \
                     not said",
                    counted(cut.lost, "corner")
                ));
            }
            if cut.clear > 0 {
                raw.warnings.push(format!(
                    "whole pieces of material `{name}`, {}, are wholly transparent; their surface is printed all the \
                     same",
                    counted(cut.clear, "corner")
                ));
            }
        }
    }
}

/// Numbers the places of points, in the order in which they come: points at one place have one number.
fn places(points: impl Iterator<Item = DVec3>) -> Vec<usize> {
    let mut known: HashMap<[u64; 3], usize> = HashMap::new();
    let number = |point: DVec3| {
        let next = known.len();
        // Zeros of both signs are one place.
        *known.entry(point.to_array().map(|x| (x + 0.0).to_bits())).or_insert(next)
    };
    points.map(number).collect()
}

/// Gives every node the value of the nearest one that has any, in steps over the edges of triangles; what no edges
/// connect to any stays without.
fn spread<V: Copy>(values: &mut [Option<V>], triangles: impl Iterator<Item = [usize; 3]>) {
    let mut beside: Vec<Vec<usize>> = vec![Vec::new(); values.len()];
    for [a, b, c] in triangles {
        for (node, others) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            beside[node].extend(others);
        }
    }
    let mut front: Vec<usize> = (0..values.len()).filter(|&node| values[node].is_some()).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for node in front {
            for &other in &beside[node] {
                if values[other].is_none() {
                    values[other] = values[node];
                    next.push(other);
                }
            }
        }
        front = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_spread_over_edges_to_what_is_connected() {
        // A strip of six nodes with a value at either end, and a triangle apart.
        let strip = [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]];
        let mut values = [Some('a'), None, None, None, None, Some('b'), None, None, None];
        spread(&mut values, strip.into_iter().chain([[6, 7, 8]]));
        assert_eq!(values[..6], ['a', 'a', 'a', 'b', 'b', 'b'].map(Some));
        assert_eq!(values[6..], [None; 3]);
    }

    #[test]
    fn zeros_of_both_signs_are_one_place() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(-0.0, 0.0, -0.0), DVec3::X];
        assert_eq!(places(points.into_iter()), [0, 1, 0, 1]);
    }

    #[test]
    fn what_is_cut_out_by_itself_is_not_the_least() {
        let range = [1.0, 0.0, 0.7].into_iter().fold(Range::NOTHING, |range, alpha| range.with(alpha, 0.5));
        assert_eq!(range, Range { least: 0.7, greatest: 1.0 });
    }
}
