//! glTF's materials, as far as they say what colour a surface has.

use std::collections::BTreeMap;
use std::sync::Arc;

use gltf::material::AlphaMode;
use gltf::texture::{Info, WrappingMode};
use gltf::{Document, Material};

use super::gltf_container::resolve;
use super::raw::{RawMesh, plain};
use super::support::{self, Fate};
use super::{Source, texture};
use crate::mesh::{SurfaceMaterial, Texture, Wrap};
use crate::words::counted;

/// Factor and texture of a base colour: the diffuse one where a material has KHR_materials_pbrSpecularGlossiness, which
/// goes before.
pub(super) struct BaseColor<'a> {
    pub(super) factor: [f32; 4],
    pub(super) texture: Option<Info<'a>>,
}

impl<'a> BaseColor<'a> {
    pub(super) fn of(material: &Material<'a>) -> Self {
        match material.pbr_specular_glossiness() {
            Some(pbr) => Self { factor: pbr.diffuse_factor(), texture: pbr.diffuse_texture() },
            None => {
                let pbr = material.pbr_metallic_roughness();
                Self { factor: pbr.base_color_factor(), texture: pbr.base_color_texture() }
            }
        }
    }
}

/// Reads materials, and each of their images once.
pub(super) struct Materials<'a> {
    source: &'a Source<'a>,
    document: &'a Document,
    buffers: &'a [Vec<u8>],
    images: BTreeMap<usize, Option<Arc<Texture>>>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(source: &'a Source<'a>, document: &'a Document, buffers: &'a [Vec<u8>]) -> Self {
        Self { source, document, buffers, images: BTreeMap::new() }
    }

    pub(super) fn read(&mut self, material: &Material, raw: &mut RawMesh) -> SurfaceMaterial {
        let base = BaseColor::of(material);
        let name = material.name().unwrap_or("").to_owned();
        let others = material.extensions().into_iter().flat_map(|others| others.keys());
        for unread in others.filter(|name| support::fate("glTF", name) == Some(Fate::Lost)) {
            raw.lose_color(format!("the colour of material `{name}` is given by {unread}, which is not read"));
        }
        let mut looks = plain(name, base.factor);
        let Some(info) = base.texture else { return looks };
        let name = &looks.name;
        let Some(image) = info.texture().source() else {
            raw.lose_color(format!("the texture of material `{name}` is in a codec other than PNG and JPEG"));
            return looks;
        };
        let sampler = info.texture().sampler();
        looks.wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::Repeat => Wrap::Repeat,
        });
        let texture = self.image(image.index(), raw);
        if texture.is_none() {
            let lost = || format!("image {}, the base colour of material `{name}`, cannot be read", image.index());
            raw.lost_color.get_or_insert_with(lost);
        }
        looks.base_color_texture = texture.map(|texture| without_holes(texture, material, base.factor[3], raw));
        looks
    }

    /// Decodes an image, or warns why it cannot.
    fn image(&mut self, index: usize, raw: &mut RawMesh) -> Option<Arc<Texture>> {
        if let Some(known) = self.images.get(&index) {
            return known.clone();
        }
        let texture = self.decode(index);
        if let Err(reason) = &texture {
            raw.warnings.push(format!("image {index} cannot be read ({reason}): its materials stay plain"));
        }
        let texture = texture.ok();
        self.images.insert(index, texture.clone());
        texture
    }

    /// By the JSON: gltf 1.4.1 panics on an image in a buffer view that states no type, which we need not know.
    fn decode(&self, index: usize) -> Result<Arc<Texture>, String> {
        let image = self.document.as_json().images.get(index).ok_or("there is no such image")?;
        if let Some(uri) = &image.uri {
            return texture::decode(&resolve(self.source, uri)?);
        }
        let view = image.buffer_view.and_then(|view| self.document.views().nth(view.value()));
        let view = view.ok_or("it has neither URI nor buffer view")?;
        let bytes = self.buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        let end = view.offset().checked_add(view.length());
        texture::decode(end.and_then(|end| bytes.get(view.offset()..end)).ok_or("its bytes lie outside the buffer")?)
    }
}

/// The texture where it shows: texels that a mask cuts out, or that are wholly transparent, have colours that no viewer
/// shows.
fn without_holes(texture: Arc<Texture>, material: &Material, alpha: f32, raw: &mut RawMesh) -> Arc<Texture> {
    let cutoff = match material.alpha_mode() {
        AlphaMode::Opaque => return texture,
        AlphaMode::Mask => material.alpha_cutoff().unwrap_or(0.5),
        // Only what cannot be seen at all.
        AlphaMode::Blend => f32::MIN_POSITIVE,
    };
    let cut: Vec<bool> = texture.texels.iter().map(|texel| f32::from(texel[3]) / 255.0 * alpha < cutoff).collect();
    let count = cut.iter().filter(|&&cut| cut).count();
    let name = material.name().unwrap_or("");
    if count == 0 {
        return texture;
    }
    if count == cut.len() {
        raw.lose_color(format!("the alpha of material `{name}` cuts out its whole texture"));
        return texture;
    }
    raw.warnings.push(format!(
        "the alpha of material `{name}` cuts {} out of its texture: the surface stays, in the colour of the nearest \
            texel \
         left",
        counted(count, "texel")
    ));
    Arc::new(texture::filled(&texture, &cut))
}
