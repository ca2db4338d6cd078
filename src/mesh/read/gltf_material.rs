//! glTF's materials, as far as they say what colour a surface has.

use std::collections::BTreeMap;
use std::sync::Arc;

use gltf::texture::{Info, Sampler, WrappingMode};
use gltf::{Document, Material};

use super::gltf_container::resolve;
use super::gltf_interior::{Interior, Slot, image_of, leading};
use super::gltf_mask::Alphas;
use super::raw::{RawMesh, plain};
use super::support::{self, Fate};
use super::{Source, texture};
use crate::colour::{byte_to_linear, linear_to_byte};
use crate::mesh::{SurfaceMaterial, Texture, Wrap};

/// Factor and texture of a base colour: the diffuse one where a material has KHR_materials_pbrSpecularGlossiness, which
/// goes before.
pub(super) struct BaseColor<'a> {
    /// Cut to the range of 0 to 1 that glTF gives it.
    pub(super) factor: [f32; 4],
    pub(super) texture: Option<Info<'a>>,
    /// The factor as it stands in the file, where it leaves that range by more than rounding.
    beyond: Option<[f32; 4]>,
}

impl<'a> BaseColor<'a> {
    pub(super) fn of(material: &Material<'a>) -> Self {
        let (stated, texture) = match material.pbr_specular_glossiness() {
            Some(pbr) => (pbr.diffuse_factor(), pbr.diffuse_texture()),
            None => {
                let pbr = material.pbr_metallic_roughness();
                (pbr.base_color_factor(), pbr.base_color_texture())
            }
        };
        let is_beyond = stated.iter().any(|value| !(-ROUNDING..=1.0 + ROUNDING).contains(value));
        let factor = stated.map(|value| value.clamp(0.0, 1.0));
        Self { factor, texture, beyond: is_beyond.then_some(stated) }
    }
}

/// How far beyond its range a factor may lie by rounding, as in an MTL.
const ROUNDING: f32 = 0.01;

/// Reads materials, and each of their images once.
pub(super) struct Materials<'a> {
    source: &'a Source<'a>,
    document: &'a Document,
    buffers: &'a [Vec<u8>],
    images: BTreeMap<usize, Option<Arc<Texture>>>,
    /// Why images cannot be read.
    lost: BTreeMap<usize, String>,
    pub(super) alphas: Alphas,
}

impl<'a> Materials<'a> {
    pub(super) fn new(source: &'a Source<'a>, document: &'a Document, buffers: &'a [Vec<u8>]) -> Self {
        let alphas = Alphas::of(document, buffers);
        Self { source, document, buffers, images: BTreeMap::new(), lost: BTreeMap::new(), alphas }
    }

    pub(super) fn read(&mut self, material: &Material, raw: &mut RawMesh) -> SurfaceMaterial {
        let base = BaseColor::of(material);
        let name = name_of(material);
        let others = material.extensions().into_iter().flat_map(|others| others.keys());
        for unread in others.filter(|name| support::fate("glTF", name) == Some(Fate::Lost)) {
            raw.lose_color(format!("the colour of material `{name}` is given by {unread}, which is not read"));
        }
        if let Some([r, g, b, a]) = base.beyond {
            raw.lose_color(format!(
                "material `{name}`: found base colour factor ({r}, {g}, {b}, {a}), expected numbers of 0 to 1: they \
                 are cut"
            ));
        }
        let mut looks = plain(name, base.factor);
        let interior = Interior::of(material).filter(|_| material.pbr_specular_glossiness().is_none());
        looks.mean_free_path_mm = interior.as_ref().and_then(Interior::mean_free_path);
        let inside = interior.as_ref().filter(|interior| !interior.keeps_base_colour());
        if base.texture.is_none() {
            self.alphas.note_unseen(material, raw);
        }
        self.read_base(material, base, &mut looks, raw);
        if let Some(interior) = inside {
            if interior.is_clear() {
                raw.warnings.push(format!(
                    "material `{}` is clear: nothing below its surface sends light back; it becomes one that does, in \
                     its attenuationColor",
                    looks.name
                ));
            }
            self.lay_interior(material, interior, &mut looks, raw);
        }
        looks
    }

    /// The base colour's texture.
    fn read_base(&mut self, material: &Material, base: BaseColor, looks: &mut SurfaceMaterial, raw: &mut RawMesh) {
        let Some(info) = base.texture else { return };
        let name = &looks.name;
        let Some(image) = info.texture().source() else {
            raw.lose_color(format!("the texture of material `{name}` is in a codec other than PNG and JPEG"));
            return;
        };
        let sampler = info.texture().sampler();
        looks.wrap = wrap(&sampler);
        let texture = self.image(image.index(), raw);
        if texture.is_none() {
            let why = self.lost.get(&image.index()).map_or("", String::as_str);
            let lost =
                || format!("image {}, the base colour of material `{name}`, cannot be read ({why})", image.index());
            raw.lost_color.get_or_insert_with(lost);
        }
        looks.base_color_texture = texture.map(|texture| self.alphas.without_holes(texture, material, raw));
    }

    /// Turns the base colour into the albedo, texel by texel where textures go into it.
    fn lay_interior(
        &mut self,
        material: &Material,
        interior: &Interior,
        looks: &mut SurfaceMaterial,
        raw: &mut RawMesh,
    ) {
        let base = BaseColor::of(material).texture;
        let leading = leading(material, base.as_ref());
        let mut layers: Vec<(Slot, Arc<Texture>)> = Vec::new();
        for (slot, used) in &interior.textures {
            let alike = leading.as_ref().is_some_and(|leading| leading.lies_like(used));
            let image = image_of(self.document, used).filter(|_| alike);
            match image.and_then(|image| self.image(image, raw)) {
                Some(texture) => layers.push((*slot, texture)),
                None => raw.warnings.push(format!(
                    "texture {} of material `{}` is not read: it lies on other texture coordinates than its first, or \
                     is no PNG or JPEG; its factor holds everywhere",
                    used.index, looks.name
                )),
            }
        }
        let [r, g, b, alpha] = looks.base_color;
        let own = looks.base_color_texture.clone();
        if own.is_none()
            && let (Some(leading), false) = (&leading, layers.is_empty())
            && let Some(texture) = self.document.textures().nth(leading.index)
        {
            looks.wrap = wrap(&texture.sampler());
        }
        let all = own.iter().chain(layers.iter().map(|(_, texture)| texture));
        let size = all.map(|texture| (texture.width, texture.height)).reduce(|a, b| (a.0.max(b.0), a.1.max(b.1)));
        let Some((width, height)) = size else {
            let [r, g, b] = interior.albedo([r, g, b]);
            looks.base_color = [r, g, b, alpha];
            return;
        };
        let sample = |texture: &Texture, x: u32, y: u32| {
            let at = |at: u32, of: u32, size: u32| (u64::from(at) * u64::from(size) / u64::from(of)) as usize;
            texture.texels[at(x, width, texture.width) + texture.width as usize * at(y, height, texture.height)]
        };
        let data = |byte: u8| f32::from(byte) / 255.0;
        let mut texels = Vec::with_capacity(width as usize * height as usize);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let [tr, tg, tb, a] = own.as_ref().map_or([255; 4], |texture| sample(texture, x, y));
            let base = [tr, tg, tb].map(byte_to_linear);
            let here = interior.at(layers.iter().map(|(slot, texture)| {
                let [tr, tg, tb, a] = sample(texture, x, y);
                let light: fn(u8) -> f32 = if *slot == Slot::Transmission { data } else { byte_to_linear };
                (*slot, [light(tr), light(tg), light(tb), data(a)])
            }));
            let albedo = here.albedo([base[0] * r, base[1] * g, base[2] * b]);
            let [tr, tg, tb] = albedo.map(|value| linear_to_byte(value.into()));
            texels.push([tr, tg, tb, a]);
        }
        looks.base_color = [1.0, 1.0, 1.0, alpha];
        looks.base_color_texture = Some(Arc::new(Texture { width, height, texels }));
    }

    /// Decodes an image, or warns why it cannot.
    fn image(&mut self, index: usize, raw: &mut RawMesh) -> Option<Arc<Texture>> {
        if let Some(known) = self.images.get(&index) {
            return known.clone();
        }
        let texture = self.decode(index);
        if let Err(reason) = &texture {
            raw.warnings.push(format!("image {index} cannot be read ({reason}): its materials stay plain"));
            self.lost.insert(index, reason.clone());
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

/// The name of a material, or its number.
pub(super) fn name_of(material: &Material) -> String {
    let number = || material.index().map_or_else(|| "default".to_owned(), |index| index.to_string());
    material.name().filter(|name| !name.is_empty()).map_or_else(number, str::to_owned)
}

/// How a texture goes on beyond its edges, along u and v.
fn wrap(sampler: &Sampler) -> [Wrap; 2] {
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::Repeat => Wrap::Repeat,
    })
}
