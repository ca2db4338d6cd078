//! glTF 2.0, as .glb or .gltf with its buffers.
//!
//! The default scene's nodes are walked and their transforms applied; strips and fans become triangles, points and
//! lines are skipped. A shape is what a viewer shows before any animation starts: default morph weights, skins in their
//! joints' pose ([`gltf_shape`]), instances ([`gltf_instances`]) and visibility. Materials are read by
//! [`gltf_material`], which extensions matter is known to [`support`].

use std::collections::BTreeSet;

use glam::{DMat4, DVec3, Vec2};
use gltf::mesh::{Mode, Primitive};
use gltf::{Document, Node, Semantic};

use super::gltf_container::{resolve, split};
use super::gltf_document::{ShownTarget, document, note_unread_morphs};
use super::gltf_mask::Alphas;
use super::gltf_material::{BaseColor, Materials, name_of};
use super::gltf_shape::{self, Pose};
use super::raw::{RawMesh, finite, plain, uv_or_zero};
use super::text::decoded;
use super::{Source, accessor, check_memory, gltf_instances, gltf_interior};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::counted;

/// Deepest nesting of nodes: well beyond any model, well within the thread's stack.
const MAX_DEPTH: usize = 512;
/// By which a primitive's values may be packed, beside those that the file holds unpacked.
const PACKED: &str = "KHR_draco_mesh_compression";

pub(super) fn parse(source: &Source) -> Parsed<RawMesh> {
    let (json, blob) = split(source.bytes)?;
    let mut raw = RawMesh::new(1000.0);
    raw.y_up = true;
    let json = decoded(json)?;
    let document = document(&json, &mut raw)?;
    let buffers = document
        .buffers()
        .map(|buffer| {
            let place = || format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                // A buffer without bytes of its own is what an extension would unpack to.
                gltf::buffer::Source::Bin if buffer.index() > 0 => {
                    return Err(Fault::new(place(), "no URI", "bytes that no extension has to unpack"));
                }
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
    let mut materials = Materials::new(source, &document, &buffers);
    let primitives = document.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>());
    let used: BTreeSet<Option<usize>> = primitives.map(|primitive| primitive.material().index()).collect();
    for material in document.materials() {
        // What nothing is made of has no colour to lose.
        let looks = match used.contains(&material.index()) {
            true => materials.read(&material, &mut raw),
            false => plain(material.name().unwrap_or(""), BaseColor::of(&material).factor),
        };
        raw.add_material(|| "materials".to_owned(), looks)?;
    }
    let alphas = materials.alphas;
    name_colors_elsewhere(&document, &mut raw);
    let mut walk = Walk {
        document: &document,
        globals: gltf_shape::globals(&document),
        buffers: &buffers,
        raw,
        default_material: None,
        visited: vec![false; document.nodes().len()],
        empty: BTreeSet::new(),
        skipped: [0; 4],
        alphas,
        morphs: BTreeSet::new(),
    };
    let first = || document.scenes().find(|scene| scene.nodes().len() > 0).or_else(|| document.scenes().next());
    let scene = document.default_scene().or_else(first);
    let roots = match &scene {
        Some(scene) => scene.nodes().collect(),
        None => rootless(&document),
    };
    check_room(&roots, &document, &buffers)?;
    match scene {
        Some(_) => {
            roots.iter().try_for_each(|node| walk.node(node, DMat4::IDENTITY, 0))?;
            let is_new = |node: Node| !walk.visited[node.index()];
            let others = document.scenes().filter(|other| other.nodes().any(is_new)).count();
            if others > 0 {
                let what = if others == 1 { "is" } else { "are" };
                walk.raw
                    .warnings
                    .push(format!("{} besides the first to be shown {what} left out", counted(others, "scene")));
            }
        }
        None if document.nodes().len() > 0 => {
            roots.iter().try_for_each(|node| walk.node(node, DMat4::IDENTITY, 0))?;
        }
        None => {
            for mesh in document.meshes() {
                walk.mesh(&mesh, None, mesh.weights(), DMat4::IDENTITY)?;
            }
        }
    }
    note_unread_morphs(&json, &walk.morphs, &mut walk.raw);
    Ok(walk.finish())
}

/// Warns of colours where none are looked for: in what glows, where the base colour is black or white all over, and by
/// instance.
fn name_colors_elsewhere(document: &Document, raw: &mut RawMesh) {
    let primitives = document.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>());
    let plain: BTreeSet<usize> = primitives
        .filter(|primitive| primitive.get(&Semantic::Colors(0)).is_none())
        .filter_map(|primitive| primitive.material().index())
        .collect();
    let glows = |material: &gltf::Material| {
        let base = BaseColor::of(material);
        let rgb = &base.factor[..3];
        let is_plain = base.texture.is_none() && (rgb == [0.0; 3] || rgb == [1.0; 3]);
        let glow = material.emissive_factor();
        // White light alone is a lamp.
        let is_colored = glow != [0.0; 3] && (material.emissive_texture().is_some() || glow != [glow[0]; 3]);
        is_plain && is_colored && material.index().is_some_and(|index| plain.contains(&index))
    };
    let names: Vec<String> = document.materials().filter(glows).map(|m| format!("`{}`", name_of(&m))).collect();
    if !names.is_empty() {
        raw.lose_color(format!("the colour of what glows is not read: material {}", names.join(", ")));
    }
    let has_colors = |node: &Node| {
        let instancing = node.extension_value("EXT_mesh_gpu_instancing");
        instancing.and_then(|value| value.get("attributes")?.get("_COLOR_0")).is_some()
    };
    if document.nodes().any(|node| has_colors(&node)) {
        raw.lose_color("the colours of instances (_COLOR_0) are not read".to_owned());
    }
}

/// Nodes that are no other's child.
fn rootless(document: &Document) -> Vec<Node<'_>> {
    let mut has_parent = vec![false; document.nodes().len()];
    document.nodes().flat_map(|node| node.children().collect::<Vec<_>>()).for_each(|child| {
        has_parent[child.index()] = true;
    });
    document.nodes().filter(|node| !has_parent[node.index()]).collect()
}

/// Counts what these nodes show before any of it is placed: nodes and instances that show one mesh are many in a small
/// file.
fn check_room(roots: &[Node], document: &Document, buffers: &[Vec<u8>]) -> Parsed<()> {
    // More elements than bytes are complained of where they are read.
    let bytes = buffers.iter().map(Vec::len).sum();
    let size_of = |mesh: &gltf::Mesh| {
        let mut size = [0u64; 2];
        for primitive in mesh.primitives() {
            let positions = primitive.get(&Semantic::Positions).map_or(0, |accessor| accessor.count()).min(bytes);
            let corners = primitive.indices().map_or(positions, |accessor| accessor.count().min(bytes));
            size[0] += triangle_count(primitive.mode(), corners) as u64;
            size[1] += positions.min(corners) as u64;
        }
        size
    };
    let sizes: Vec<[u64; 2]> = document.meshes().map(|mesh| size_of(&mesh)).collect();
    let mut seen = vec![false; document.nodes().len()];
    let mut open: Vec<Node> = roots.to_vec();
    let mut sum = [0u64; 2];
    while let Some(node) = open.pop() {
        if std::mem::replace(&mut seen[node.index()], true) || is_hidden(&node) {
            continue;
        }
        open.extend(node.children());
        let Some(mesh) = node.mesh() else { continue };
        let instances = gltf_instances::count(&node, document).map_or(1, |count| count.min(bytes) as u64);
        for (sum, size) in sum.iter_mut().zip(sizes[mesh.index()]) {
            *sum = sum.saturating_add(instances.saturating_mul(size));
        }
    }
    check_memory(|| "the scene, with every node and instance".to_owned(), sum[0], sum[1])
}

fn is_hidden(node: &Node) -> bool {
    let visible = node.extension_value("KHR_node_visibility").and_then(|value| value.get("visible"));
    visible.and_then(|visible| visible.as_bool()) == Some(false)
}

struct Walk<'a> {
    document: &'a Document,
    /// Every node's transform to the scene.
    globals: Vec<DMat4>,
    buffers: &'a [Vec<u8>],
    raw: RawMesh,
    /// Index into `raw.materials` of the material of primitives without.
    default_material: Option<u16>,
    visited: Vec<bool>,
    /// Accessors whose values are 0 for want of bytes.
    empty: BTreeSet<usize>,
    skipped: [usize; 4],
    alphas: Alphas,
    /// Morph targets with a weight.
    morphs: BTreeSet<ShownTarget>,
}

/// Slots of `Walk::skipped`.
const POINTS_OR_LINES: usize = 0;
const HIDDEN: usize = 1;
const UNPAINTED: usize = 2;
const OFF_UNIT: usize = 3;

impl Walk<'_> {
    fn node(&mut self, node: &Node, parent: DMat4, depth: usize) -> Parsed<()> {
        let place = || format!("node {}", node.index());
        if std::mem::replace(&mut self.visited[node.index()], true) {
            return Err(Fault::new(place(), "a second parent", "a tree of nodes"));
        }
        if depth > MAX_DEPTH {
            return Err(Fault::new(place(), "deeper nesting", format!("at most {MAX_DEPTH} levels")));
        }
        if is_hidden(node) {
            self.skipped[HIDDEN] += 1;
            return Ok(());
        }
        self.skipped[OFF_UNIT] += usize::from(gltf_shape::is_off_unit(node));
        let transform = parent * gltf_shape::local(node);
        if let Some(mesh) = node.mesh() {
            let pose = node.skin().map(|skin| Pose::new(&skin, &self.globals, self.buffers)).transpose()?;
            let weights = node.weights().or(mesh.weights());
            match gltf_instances::read(node, self.document, self.buffers)? {
                Some(instances) => {
                    for instance in instances {
                        self.mesh(&mesh, pose.as_ref(), weights, transform * instance)?;
                    }
                }
                None => self.mesh(&mesh, pose.as_ref(), weights, transform)?,
            }
        }
        node.children().try_for_each(|child| self.node(&child, transform, depth + 1))
    }

    fn mesh(
        &mut self,
        mesh: &gltf::Mesh,
        pose: Option<&Pose>,
        weights: Option<&[f32]>,
        transform: DMat4,
    ) -> Parsed<()> {
        let weights = weights.unwrap_or(&[]);
        let shown = (0..weights.len()).filter(|&target| weights[target] != 0.0);
        self.morphs.extend(shown.map(|target| ShownTarget { mesh: mesh.index(), target }));
        mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, pose, weights, transform))
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        pose: Option<&Pose>,
        weights: &[f32],
        transform: DMat4,
    ) -> Parsed<()> {
        let place = || format!("primitive {}", primitive.index());
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.skipped[POINTS_OR_LINES] += 1;
            return Ok(());
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(Fault::new(place(), "no POSITION", "that attribute"));
        };
        if primitive.extension_value(PACKED).is_some() && accessor::is_empty(&positions) {
            return Err(Fault::new(place(), format!("positions in {PACKED} alone"), "positions in a buffer view, too"));
        }
        self.note_empty(primitive);
        let mut points = accessor::vectors::<3>(&positions, self.buffers)?;
        let count = points.len();
        gltf_shape::morph(primitive, weights, self.buffers, &mut points)?;
        // A skin's joints alone place its vertices.
        let skinned = pose.map(|pose| pose.of(primitive, count, self.buffers)).transpose()?.flatten();
        let mut placed = Vec::with_capacity(count);
        for (i, p) in points.into_iter().enumerate() {
            let place = || format!("accessor {}, vertex {i}", positions.index());
            let p = finite(DVec3::from_array(p), place)?;
            let transform = skinned.as_ref().map_or(transform, |skinned| skinned[i]);
            placed.push(finite(transform.transform_point3(p), place)?);
        }
        let uvs = self.texture_coordinates(primitive, count)?;
        let mut colors = self.vertex_colors(primitive, count)?;
        let corners: Vec<u32> = match primitive.indices() {
            Some(indices) => accessor::indices(&indices, self.buffers)?,
            None => (0..count as u32).collect(),
        };
        if let Some(i) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(Fault::new(place(), format!("vertex index {i}"), format!("an index below {count}")));
        }
        if let Some(colors) = &mut colors {
            self.alphas.fill(primitive, self.buffers, &placed, &corners, colors)?;
        }
        let name_of = self.raw.add_positions(&placed, corners.iter().copied());
        let material = self.material(primitive)?;
        if primitive.material().index().is_none() && colors.is_none() {
            self.skipped[UNPAINTED] += 1;
        }
        let mirrors = transform.determinant() < 0.0;
        for t in 0..triangle_count(primitive.mode(), corners.len()) {
            let [a, b, c] = triangle(primitive.mode(), t).map(|i| corners[i]);
            let mirrored = skinned.as_ref().map_or(mirrors, |skinned| skinned[a as usize].determinant() < 0.0);
            let [a, b, c] = if mirrored { [a, c, b] } else { [a, b, c] };
            let uv = uvs.as_ref().map(|uvs| [a, b, c].map(|i| uvs[i as usize]));
            self.raw.push(place, [a, b, c].map(&name_of), uv)?;
            self.raw.material_of.push(material);
            if let Some(colors) = &colors {
                self.raw.color_last([a, b, c].map(|i| colors[i as usize]));
            }
        }
        Ok(())
    }

    /// Notes which values are 0 for want of bytes.
    fn note_empty(&mut self, primitive: &Primitive) {
        let matters = |semantic: &Semantic| {
            matches!(semantic, Semantic::Positions | Semantic::TexCoords(_) | Semantic::Colors(_))
        };
        let attributes = primitive.attributes().filter(|(semantic, _)| matters(semantic)).map(|(_, values)| values);
        let empty = attributes.chain(primitive.indices()).filter(accessor::is_empty);
        self.empty.extend(empty.map(|accessor| accessor.index()));
    }

    /// The coordinate set that the base colour texture asks for, its transform applied.
    fn texture_coordinates(&self, primitive: &Primitive, vertices: usize) -> Parsed<Option<Vec<Vec2>>> {
        let material = primitive.material();
        let leading = gltf_interior::leading(&material, BaseColor::of(&material).texture.as_ref());
        let set = leading.as_ref().map_or(0, |leading| leading.set);
        let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) else { return Ok(None) };
        let values = accessor::vectors::<2>(&accessor, self.buffers)?;
        one_each(&accessor, values.len(), vertices, "texture coordinates")?;
        let (offset, rotation, scale) = leading.map_or(([0.0; 2], 0.0, [1.0; 2]), |leading| leading.transform);
        let (offset, scale) = (Vec2::from(offset), Vec2::from(scale));
        let (sin, cos) = libm::sincosf(rotation);
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

    /// Linear RGB of COLOR_0.
    fn vertex_colors(&mut self, primitive: &Primitive, vertices: usize) -> Parsed<Option<Vec<[f32; 3]>>> {
        let Some(accessor) = primitive.get(&Semantic::Colors(0)) else {
            let others = primitive.attributes().any(|(semantic, _)| matches!(semantic, Semantic::Colors(_)));
            if others && self.raw.lost_color.is_none() {
                self.raw.lose_color("colours of vertices in other sets than COLOR_0 are not read".to_owned());
            }
            return Ok(None);
        };
        let colors = accessor::colors(&accessor, self.buffers)?;
        one_each(&accessor, colors.len(), vertices, "colours")?;
        Ok(Some(colors))
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
            "of points or lines skipped",
            "with all that hangs on it hidden and left out",
            "without a material: white",
            "with a rotation that is not of unit length, which was made so",
        ];
        let nouns = ["primitive", "node", "primitive", "node"];
        for ((count, noun), what) in self.skipped.into_iter().zip(nouns).zip(what).filter(|((count, _), _)| *count > 0)
        {
            self.raw.warnings.push(format!("{} {what}", counted(count, noun)));
        }
        self.alphas.tell(&mut self.raw);
        if !self.empty.is_empty() {
            let numbers = self.empty.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
            self.raw.warnings.push(format!("accessors without bytes, whose values are 0: {numbers}"));
        }
        self.raw.note_besides(self.skipped[POINTS_OR_LINES], "primitive");
        if let Some(what) = self.raw.besides.last_mut() {
            what.push_str(" of points or lines");
        }
        if self.skipped[HIDDEN] > 0 {
            self.raw.besides.push(format!("{} that are hidden", counted(self.skipped[HIDDEN], "node")));
        }
        if self.raw.besides.is_empty() {
            self.raw.besides.push(match self.document.meshes().len() {
                0 => format!("{} without a mesh", counted(self.document.nodes().len(), "node")),
                1 => "1 mesh without a triangle in the scene".to_owned(),
                many => format!("{many} meshes without a triangle in the scene"),
            });
        }
        self.raw
    }
}

/// Every vertex needs its value.
pub(super) fn one_each(accessor: &gltf::Accessor, values: usize, vertices: usize, what: &str) -> Parsed<()> {
    if values >= vertices {
        return Ok(());
    }
    let place = format!("accessor {}", accessor.index());
    Err(Fault::new(place, format!("{values} {what}"), format!("one each for {vertices} vertices")))
}

pub(super) fn triangle_count(mode: Mode, corners: usize) -> usize {
    if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) }
}

/// Corners of triangle `t` (glTF 2.0, section 3.7.2.1).
pub(super) fn triangle(mode: Mode, t: usize) -> [usize; 3] {
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
