//! glTF 2.0, as .glb or .gltf with its buffers.
//!
//! The default scene's nodes are walked and their transforms applied; strips and fans become triangles, points and lines
//! are skipped. Skins and morph targets stay in their rest shape. A material keeps base colour factor and texture;
//! KHR_texture_transform is applied to the coordinates. Draco and meshopt compression are refused by name.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec2};
use gltf::json::validation::Checked;
use gltf::mesh::{Mode, Primitive};
use gltf::{Document, Node, Semantic};

use super::accessor;
use super::gltf_container::{resolve, split};
use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::{Source, texture};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::mesh::{SurfaceMaterial, Texture};
use crate::words::{counted, one_line};

/// Required extensions that do not change a shape we could not read: the accessors here read quantised
/// positions, and a texture in another codec is warned about where it is missed.
const HARMLESS: [&str; 4] = ["KHR_mesh_quantization", "EXT_texture_webp", "KHR_texture_basisu", "EXT_texture_avif"];

/// Deepest nesting of nodes: well beyond any model, well within the thread's stack.
const MAX_DEPTH: usize = 512;

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let (json, blob) = split(source.bytes)?;
    let mut root = gltf::json::deserialize::from_slice::<gltf::json::Root>(json)
        .map_err(|error| Fault::new("the JSON part", one_line(error), "a glTF 2.0 document"))?;
    root.extensions_required.retain(|name| !HARMLESS.contains(&name.as_str()) && !name.starts_with("KHR_materials_"));
    check_position_accessors(&root)?;
    let document = Document::from_json(root).map_err(|error| {
        Fault::new("the JSON part", one_line(error), "a valid glTF 2.0 document without other extensions")
    })?;
    let buffers = document
        .buffers()
        .map(|buffer| {
            let place = || format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.map(<[u8]>::to_vec).ok_or_else(|| Fault::new(place(), "no BIN chunk", "the buffer's bytes"))?
                }
                gltf::buffer::Source::Uri(uri) => resolve(source, uri).map_err(|reason| {
                    Fault::new(place(), format!("{} ({reason})", quote(uri.as_bytes())), "its bytes")
                })?,
            };
            if bytes.len() < buffer.length() {
                return Err(Fault::new(
                    place(),
                    format!("{} bytes", bytes.len()),
                    format!("{} bytes", buffer.length()),
                ));
            }
            Ok(bytes)
        })
        .collect::<Parsed<Vec<_>>>()?;
    let mut walk = Walk::new(source, &document, buffers)?;
    let scene = document.default_scene().or_else(|| document.scenes().next());
    match scene {
        Some(scene) => scene.nodes().try_for_each(|node| walk.node(&node, DMat4::IDENTITY, 0))?,
        None => {
            for mesh in document.meshes() {
                mesh.primitives().try_for_each(|primitive| walk.primitive(&primitive, DMat4::IDENTITY))?;
            }
        }
    }
    Ok(walk.finish())
}

/// gltf-json 1.4.1 validates everything but looks positions up before it has checked their index, and panics.
fn check_position_accessors(root: &gltf::json::Root) -> Parsed<()> {
    let count = root.accessors.len();
    for (m, mesh) in root.meshes.iter().enumerate() {
        for attributes in mesh.primitives.iter().map(|primitive| &primitive.attributes) {
            if let Some(index) = attributes.get(&Checked::Valid(Semantic::Positions)).filter(|i| i.value() >= count) {
                let found = format!("POSITION accessor {}", index.value());
                return Err(Fault::new(format!("mesh {m}"), found, format!("an index below {count}")));
            }
        }
    }
    Ok(())
}

struct Walk<'a> {
    buffers: Vec<Vec<u8>>,
    raw: RawMesh,
    /// Index into `raw.materials` of the file's materials, and of its default one.
    default_material: Option<u16>,
    visited: Vec<bool>,
    skipped: [usize; 3],
    source: &'a Source<'a>,
}

/// Slots of `Walk::skipped`.
const POINTS_OR_LINES: usize = 0;
const SKINS: usize = 1;
const MORPHS: usize = 2;

impl<'a> Walk<'a> {
    fn new(source: &'a Source<'a>, document: &Document, buffers: Vec<Vec<u8>>) -> Parsed<Self> {
        let mut raw = RawMesh::new(1000.0);
        raw.y_up = true;
        let visited = vec![false; document.nodes().len()];
        let mut walk = Self { buffers, raw, default_material: None, visited, skipped: [0; 3], source };
        let mut textures: Vec<Option<Arc<Texture>>> = Vec::new();
        for (i, image) in document.as_json().images.iter().enumerate() {
            let texture = walk.image(document, image);
            if let Err(reason) = &texture {
                walk.raw.warnings.push(format!("image {i} cannot be read ({reason}): its materials stay plain"));
            }
            textures.push(texture.ok());
        }
        for material in document.materials() {
            let pbr = material.pbr_metallic_roughness();
            let name = material.name().unwrap_or("");
            let image = pbr.base_color_texture().map(|info| info.texture().source().map(|image| image.index()));
            if image == Some(None) {
                walk.raw.lose_color(format!("the texture of material `{name}` is in a codec other than PNG and JPEG"));
            }
            if let Some(i) = image.flatten().filter(|&i| matches!(textures.get(i), Some(None))) {
                let lost = || format!("image {i}, the base colour of material `{name}`, cannot be read");
                walk.raw.lost_color.get_or_insert_with(lost);
            }
            let base_color_texture = image.flatten().and_then(|i| textures.get(i).cloned().flatten());
            let material =
                SurfaceMaterial { name: name.to_owned(), base_color: pbr.base_color_factor(), base_color_texture };
            walk.raw.add_material(|| "materials".to_owned(), material)?;
        }
        Ok(walk)
    }

    /// By the JSON: gltf 1.4.1 panics on an image in a buffer view that states no type, which we need not know.
    fn image(&self, document: &Document, image: &gltf::json::Image) -> Result<Arc<Texture>, String> {
        if let Some(uri) = &image.uri {
            return texture::decode(&resolve(self.source, uri)?);
        }
        let view = image.buffer_view.and_then(|view| document.views().nth(view.value()));
        let view = view.ok_or("it has neither URI nor buffer view")?;
        let bytes = self.buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        let end = view.offset().checked_add(view.length());
        texture::decode(end.and_then(|end| bytes.get(view.offset()..end)).ok_or("its bytes lie outside the buffer")?)
    }

    fn node(&mut self, node: &Node, parent: DMat4, depth: usize) -> Parsed<()> {
        let place = || format!("node {}", node.index());
        if std::mem::replace(&mut self.visited[node.index()], true) {
            return Err(Fault::new(place(), "a second parent", "a tree of nodes"));
        }
        if depth > MAX_DEPTH {
            return Err(Fault::new(place(), "deeper nesting", format!("at most {MAX_DEPTH} levels")));
        }
        let columns = node.transform().matrix().map(|column| column.map(f64::from));
        let transform = parent * DMat4::from_cols_array_2d(&columns);
        self.skipped[SKINS] += usize::from(node.skin().is_some());
        if let Some(mesh) = node.mesh() {
            mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, transform))?;
        }
        node.children().try_for_each(|child| self.node(&child, transform, depth + 1))
    }

    fn primitive(&mut self, primitive: &Primitive, transform: DMat4) -> Parsed<()> {
        let place = || format!("primitive {}", primitive.index());
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.skipped[POINTS_OR_LINES] += 1;
            return Ok(());
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(Fault::new(place(), "no POSITION", "that attribute"));
        };
        self.skipped[MORPHS] += usize::from(primitive.morph_targets().next().is_some());
        let base = self.raw.positions.len();
        for (i, p) in accessor::vectors::<3>(&positions, &self.buffers)?.into_iter().enumerate() {
            let place = || format!("accessor {}, vertex {i}", positions.index());
            let p = finite(DVec3::from_array(p), place)?;
            self.raw.positions.push(finite(transform.transform_point3(p), place)?);
        }
        let count = self.raw.positions.len() - base;
        if self.raw.positions.len() > u32::MAX as usize {
            return Err(Fault::new(place(), "more vertices", format!("at most {}", u32::MAX)));
        }
        let uvs = self.texture_coordinates(primitive, count)?;
        let corners: Vec<u32> = match primitive.indices() {
            Some(indices) => accessor::indices(&indices, &self.buffers)?,
            None => (0..count as u32).collect(),
        };
        if let Some(i) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(Fault::new(place(), format!("vertex index {i}"), format!("an index below {count}")));
        }
        let material = self.material(primitive)?;
        let mirrored = transform.determinant() < 0.0;
        for t in 0..triangle_count(primitive.mode(), corners.len()) {
            let [a, b, c] = triangle(primitive.mode(), t).map(|i| corners[i]);
            let [a, b, c] = if mirrored { [a, c, b] } else { [a, b, c] };
            let uv = uvs.as_ref().map(|uvs| [a, b, c].map(|i| uvs[i as usize]));
            self.raw.push(place, [a, b, c].map(|i| base as u32 + i), uv)?;
            self.raw.material_of.push(material);
        }
        Ok(())
    }

    /// The coordinate set that the base colour texture asks for, its transform applied.
    fn texture_coordinates(&self, primitive: &Primitive, vertices: usize) -> Parsed<Option<Vec<Vec2>>> {
        let info = primitive.material().pbr_metallic_roughness().base_color_texture();
        let transform = info.as_ref().and_then(|info| info.texture_transform());
        let set = info.as_ref().map_or(0, |info| info.tex_coord());
        let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(set);
        let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) else { return Ok(None) };
        let values = accessor::vectors::<2>(&accessor, &self.buffers)?;
        if values.len() < vertices {
            let found = format!("{} texture coordinates", values.len());
            return Err(Fault::new(
                format!("accessor {}", accessor.index()),
                found,
                format!("one each for {vertices} vertices"),
            ));
        }
        let (offset, rotation, scale) =
            transform.map_or((Vec2::ZERO, 0.0, Vec2::ONE), |t| (t.offset().into(), t.rotation(), t.scale().into()));
        let (sin, cos) = rotation.sin_cos();
        Ok(Some(
            values
                .into_iter()
                .map(|[u, v]| {
                    let uv = Vec2::new(u as f32, v as f32) * scale;
                    uv_or_zero(offset + Vec2::new(cos * uv.x + sin * uv.y, cos * uv.y - sin * uv.x))
                })
                .collect(),
        ))
    }

    fn material(&mut self, primitive: &Primitive) -> Parsed<u16> {
        if let Some(index) = primitive.material().index() {
            return Ok(index as u16);
        }
        if self.default_material.is_none() {
            let white = plain("default", [1.0; 4]);
            self.default_material = Some(self.raw.add_material(|| "materials".to_owned(), white)?);
        }
        Ok(self.default_material.unwrap_or(0))
    }

    fn finish(mut self) -> RawMesh {
        let what = [
            ("primitive", "of points or lines skipped"),
            ("skinned node", "left in rest pose"),
            ("primitive", "with morph targets left in rest shape"),
        ];
        for (count, (noun, what)) in self.skipped.into_iter().zip(what).filter(|(count, _)| *count > 0) {
            self.raw.warnings.push(format!("{} {what}", counted(count, noun)));
        }
        self.raw
    }
}

fn triangle_count(mode: Mode, corners: usize) -> usize {
    if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) }
}

/// Corners of triangle `t` (glTF 2.0, section 3.7.2.1).
fn triangle(mode: Mode, t: usize) -> [usize; 3] {
    match mode {
        Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
        Mode::TriangleFan => [t + 1, t + 2, 0],
        _ => [3 * t, 3 * t + 1, 3 * t + 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_keep_their_orientation() {
        assert_eq!(
            (0..3).map(|t| triangle(Mode::TriangleStrip, t)).collect::<Vec<_>>(),
            [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
        );
    }
}
