//! What glTF's alpha cuts out, or leaves wholly transparent: colours there are no viewer's.
//!
//! Alpha is the product of the base colour's factor, its texture and COLOR_0 (glTF 2.0, section 3.9.2). The surface
//! stays, in the colour of the nearest texel or corner that is left, and it is said.

use std::collections::{BTreeMap, HashMap};
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

/// What is known of the alpha of vertices.
pub(super) struct Alphas {
    /// The least and the greatest by material, of those whose alpha counts.
    ranges: BTreeMap<usize, [f32; 2]>,
    /// By the material's name.
    cut: BTreeMap<String, Cut>,
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
        let mut ranges: BTreeMap<usize, [f32; 2]> = BTreeMap::new();
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()) {
            let material = primitive.material();
            let Some(index) = material.index().filter(|_| cutoff(&material).is_some()) else { continue };
            // What is wrong with an accessor is said where it is read for good.
            let values = primitive.get(&Semantic::Colors(0)).and_then(|c| accessor::alphas(&c, buffers).ok()?);
            let [least, greatest] = ranges.entry(index).or_insert([f32::INFINITY, f32::NEG_INFINITY]);
            for alpha in values.as_deref().unwrap_or(&[1.0]) {
                (*least, *greatest) = (least.min(*alpha), greatest.max(*alpha));
            }
        }
        Self { ranges, cut: BTreeMap::new() }
    }

    /// The least and the greatest alpha of a material without its texture.
    fn range(&self, material: &Material) -> [f32; 2] {
        let known = material.index().and_then(|index| self.ranges.get(&index));
        let vertices = known.copied().filter(|[least, greatest]| least <= greatest).unwrap_or([1.0; 2]);
        vertices.map(|alpha| alpha * BaseColor::of(material).factor[3])
    }

    fn is_unseen(&self, material: &Material) -> bool {
        cutoff(material).is_some_and(|cutoff| self.range(material)[1] < cutoff)
    }

    /// Says so of a material without texture that is not seen anywhere.
    pub(super) fn note_unseen(&self, material: &Material, raw: &mut RawMesh) {
        if !self.is_unseen(material) {
            return;
        }
        let name = name_of(material);
        if material.alpha_mode() == AlphaMode::Mask {
            raw.lose_color(format!("the alpha of material `{name}` cuts out all of it"));
        } else {
            raw.warnings.push(format!("material `{name}` is wholly transparent; its surface is printed all the same"));
        }
    }

    /// The texture where it shows.
    pub(super) fn without_holes(&self, texture: Arc<Texture>, material: &Material, raw: &mut RawMesh) -> Arc<Texture> {
        let Some(cutoff) = cutoff(material) else { return texture };
        let [least, greatest] = self.range(material);
        let is_seen = |texel: &[u8; 4], alpha: f32| f32::from(texel[3]) / 255.0 * alpha >= cutoff;
        let cut: Vec<bool> = texture.texels.iter().map(|texel| !is_seen(texel, greatest)).collect();
        let count = cut.iter().filter(|&&cut| cut).count();
        let name = name_of(material);
        if count == cut.len() {
            raw.lose_color(format!("the alpha of material `{name}` cuts out its whole texture"));
            return texture;
        }
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
        // Corners at one place are one.
        let mut node_at: HashMap<[u64; 3], usize> = HashMap::new();
        let node_of: Vec<usize> = corners
            .iter()
            .map(|&corner| {
                let next = node_at.len();
                *node_at.entry(points[corner as usize].to_array().map(f64::to_bits)).or_insert(next)
            })
            .collect();
        let mut known: Vec<Option<[f32; 3]>> = vec![None; node_at.len()];
        let mut beside: Vec<Vec<usize>> = vec![Vec::new(); node_at.len()];
        for (&node, corner) in node_of.iter().zip(corners).filter(|(_, corner)| !is_cut(corner)) {
            known[node].get_or_insert(colors[*corner as usize]);
        }
        for t in 0..triangle_count(primitive.mode(), corners.len()) {
            let [a, b, c] = triangle(primitive.mode(), t).map(|corner| node_of[corner]);
            for (node, others) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                beside[node].extend(others);
            }
        }
        let mut front: Vec<usize> = (0..known.len()).filter(|&node| known[node].is_some()).collect();
        while !front.is_empty() {
            let mut next = Vec::new();
            for node in front {
                for &other in &beside[node] {
                    if known[other].is_none() {
                        known[other] = known[node];
                        next.push(other);
                    }
                }
            }
            front = next;
        }
        let cut = self.cut.entry(name_of(&material)).or_default();
        let mut is_done = vec![false; colors.len()];
        for (corner, node) in corners.iter().zip(node_of).filter(|(corner, _)| is_cut(corner)) {
            if !std::mem::replace(&mut is_done[*corner as usize], true) {
                match known[node] {
                    Some(color) => {
                        colors[*corner as usize] = color;
                        cut.filled += 1;
                    }
                    None if material.alpha_mode() == AlphaMode::Mask => cut.lost += 1,
                    None => cut.clear += 1,
                }
            }
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
