//! Writing a textured mesh as a GLB file (glTF 2.0, binary container): metres, y up, one primitive, one texture.

use glam::{DVec3, Vec2, Vec3};
use serde_json::json;

use crate::meshing::Mesh;
use crate::packing::Atlas;
use crate::shape::Figure;

const METRES_PER_MM: f64 = 1e-3;
/// Corner normals that differ by less share a vertex (cosine of 20°); others meet at a crease.
const SHARED_COSINE: f64 = 0.94;
/// How far from its corner, towards the triangle's middle, a normal is taken: on one side of any crease.
const INWARDS: f64 = 0.1;

// glTF's numbers for component types and buffer targets.
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Why a mesh does not fit the file.
#[derive(Debug, thiserror::Error)]
pub enum GlbFault {
    #[error("{0} vertices, expected at most 65535 for 16-bit indices")]
    TooManyVertices(usize),
    #[error("JSON chunk: {0}")]
    Json(#[from] serde_json::Error),
}

/// What the GPU draws: corners with the same position, normal and texture coordinates share a vertex.
#[derive(Default)]
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<u16>,
}

impl Vertices {
    fn collect(mesh: &Mesh, atlas: &Atlas, figure: &Figure) -> Result<Self, GlbFault> {
        let (normals, normal_of) = corner_normals(mesh, figure);
        let mut vertices = Self::default();
        // Vertices made so far with every normal: (chart, index).
        let mut made: Vec<Vec<(usize, usize)>> = vec![Vec::new(); normals.len()];
        for (t, corners) in atlas.corners.iter().enumerate() {
            for i in 0..3 {
                let (normal, chart) = (normal_of[t][i], atlas.chart_of[t]);
                let known = made[normal].iter().find(|(other, _)| *other == chart);
                let index = known.map_or(vertices.positions.len(), |(_, index)| *index);
                if index == vertices.positions.len() {
                    made[normal].push((chart, index));
                    vertices.positions.push((mesh.corners(t)[i] * METRES_PER_MM).as_vec3());
                    vertices.normals.push(normals[normal].normalize_or(DVec3::Y).as_vec3());
                    vertices.uvs.push((corners[i] / atlas.size as f64).as_vec2());
                }
                vertices.indices.push(u16::try_from(index).map_err(|_| GlbFault::TooManyVertices(index + 1))?);
            }
        }
        Ok(vertices)
    }
}

/// The normals that meet at the mesh's vertices, one per side of a crease, and the index of each corner's.
fn corner_normals(mesh: &Mesh, figure: &Figure) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let mut normals: Vec<DVec3> = Vec::new();
    let mut sides: Vec<Vec<usize>> = vec![Vec::new(); mesh.positions.len()];
    let normal_of = (0..mesh.triangles.len())
        .map(|t| {
            let corners = mesh.corners(t);
            let middle = corners.iter().sum::<DVec3>() / 3.0;
            [0, 1, 2].map(|i| {
                let normal = figure.normal(figure.project(corners[i].lerp(middle, INWARDS), 1e-6));
                let side = &mut sides[mesh.triangles[t][i] as usize];
                let known = side.iter().find(|&&n| normals[n].normalize_or(DVec3::Y).dot(normal) > SHARED_COSINE);
                match known {
                    Some(&n) => {
                        normals[n] += normal;
                        n
                    }
                    None => {
                        side.push(normals.len());
                        normals.push(normal);
                        normals.len() - 1
                    }
                }
            })
        })
        .collect();
    (normals, normal_of)
}

/// The binary chunk and the description of its parts.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<serde_json::Value>,
}

impl Binary {
    /// Appends a part at a multiple of 4 bytes; returns its view's index.
    fn append(&mut self, part: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": part.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.bytes.extend_from_slice(part);
        self.views.len() - 1
    }
}

/// The file's bytes; `texture` is a PNG file that becomes the base colour.
pub fn glb(name: &str, mesh: &Mesh, atlas: &Atlas, figure: &Figure, texture: &[u8]) -> Result<Vec<u8>, GlbFault> {
    let vertices = Vertices::collect(mesh, atlas, figure)?;
    let count = vertices.positions.len();
    let low = vertices.positions.iter().fold(Vec3::MAX, |m, p| m.min(*p));
    let high = vertices.positions.iter().fold(Vec3::MIN, |m, p| m.max(*p));
    let floats =
        |values: &[Vec3]| values.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect::<Vec<_>>();
    let uvs: Vec<u8> = vertices.uvs.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect();
    let indices: Vec<u8> = vertices.indices.iter().flat_map(|i| i.to_le_bytes()).collect();

    let mut binary = Binary::default();
    let position_view = binary.append(&floats(&vertices.positions), Some(ARRAY_BUFFER));
    let normal_view = binary.append(&floats(&vertices.normals), Some(ARRAY_BUFFER));
    let uv_view = binary.append(&uvs, Some(ARRAY_BUFFER));
    let index_view = binary.append(&indices, Some(ELEMENT_ARRAY_BUFFER));
    let image_view = binary.append(texture, None);
    binary.bytes.resize(binary.bytes.len().next_multiple_of(4), 0);

    let document = json!({
        "asset": {"version": "2.0", "generator": "lumislice make_samples"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"name": name, "primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0
        }]}],
        "materials": [{"name": "marble", "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 0.4
        }}],
        "textures": [{"sampler": 0, "source": 0}],
        // Linear with mipmaps, clamped at the edges.
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}],
        "images": [{"name": "marble", "mimeType": "image/png", "bufferView": image_view}],
        "accessors": [
            {"bufferView": position_view, "componentType": FLOAT, "count": count, "type": "VEC3",
             "min": low.to_array(), "max": high.to_array()},
            {"bufferView": normal_view, "componentType": FLOAT, "count": count, "type": "VEC3"},
            {"bufferView": uv_view, "componentType": FLOAT, "count": count, "type": "VEC2"},
            {"bufferView": index_view, "componentType": UNSIGNED_SHORT, "count": vertices.indices.len(),
            "type": "SCALAR"}
        ],
        "bufferViews": binary.views,
        "buffers": [{"byteLength": binary.bytes.len()}]
    });
    let mut text = serde_json::to_vec(&document)?;
    text.resize(text.len().next_multiple_of(4), b' ');

    let mut file = Vec::with_capacity(28 + text.len() + binary.bytes.len());
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(((28 + text.len() + binary.bytes.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary.bytes)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    Ok(file)
}
