//! Writers of every format, byte by byte, for one textured mesh.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec2};

use super::shapes::{box_triangles, box_uvs};

/// A textured box with sides 2, 3, 4 mm, away from the origin.
pub struct Sample {
    pub triangles: Vec<[DVec3; 3]>,
    pub uvs: Vec<[Vec2; 3]>,
    pub texels: Vec<[u8; 4]>,
}

pub const TEXTURE_SIDE: u32 = 4;

pub fn sample() -> Sample {
    let low = DVec3::new(-1.0, 0.5, 8.0);
    Sample {
        triangles: box_triangles(low, low + DVec3::new(2.0, 3.0, 4.0)),
        uvs: box_uvs(),
        texels: (0..16).map(|i| [16 * i, 255 - 7 * i, 3 * i, 255]).collect(),
    }
}

pub fn png(sample: &Sample) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, TEXTURE_SIDE, TEXTURE_SIDE);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&sample.texels.concat()).unwrap();
    writer.finish().unwrap();
    bytes
}

pub fn put(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

pub fn obj(sample: &Sample) -> String {
    let mut text = "# comment\nmtllib paint job.mtl\nvn 0 0 1\nusemtl paint\n".to_owned();
    for (triangle, uvs) in sample.triangles.iter().zip(&sample.uvs) {
        for (p, uv) in triangle.iter().zip(uvs) {
            writeln!(text, "v {} {} {}\nvt {} {}", p.x, p.y, p.z, uv.x, 1.0 - uv.y).unwrap();
        }
        text += "f -3/-3/1 -2/-2/1 -1/-1/1\n";
    }
    text
}

pub const MTL: &str = "newmtl other\nKd 1 0 0\nnewmtl paint\nKd 0.5 0.25 1\nmap_Kd -s 1 1 1 paint.png\n";

pub fn stl_binary(sample: &Sample) -> Vec<u8> {
    // Begins like a text file, as some exporters' do.
    let mut bytes = b"solid but binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((sample.triangles.len() as u32).to_le_bytes());
    for triangle in &sample.triangles {
        bytes.extend([0; 12]);
        for c in triangle.iter().flat_map(|p| p.to_array()) {
            bytes.extend((c as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

pub fn stl_text(sample: &Sample) -> String {
    let mut text = String::new();
    for (part, triangles) in sample.triangles.chunks(6).enumerate() {
        writeln!(text, "solid part {part}").unwrap();
        for triangle in triangles {
            text += "  facet normal nan 0 0\r\n    outer loop\r\n";
            for p in triangle {
                writeln!(text, "      vertex {} {:e} {}", p.x, p.y, p.z).unwrap();
            }
            text += "    endloop\n  endfacet\n";
        }
        writeln!(text, "endsolid part {part}").unwrap();
    }
    text
}

#[derive(Clone, Copy, PartialEq)]
pub enum Ply {
    Text,
    Little,
    Big,
}

/// Quads, texture coordinates per vertex, and an element and properties to step over.
pub fn ply(sample: &Sample, encoding: Ply) -> Vec<u8> {
    let name = ["ascii", "binary_little_endian", "binary_big_endian"][encoding as usize];
    let quads = sample.triangles.len() / 2;
    let mut bytes = format!(
        "ply\nformat {name} 1.0\ncomment TextureFile paint.png\nobj_info made by hand\nelement junk 1\n\
         property list uchar double values\nelement vertex {}\nproperty double x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty float s\nproperty float t\nelement face {quads}\nproperty uchar flags\n\
         property list uchar int vertex_indices\nend_header\n",
        4 * quads
    )
    .into_bytes();
    let mut out = PlyBody { bytes: &mut bytes, encoding };
    out.number(2.0, &2u8.to_le_bytes());
    out.number(0.5, &0.5f64.to_le_bytes());
    out.number(-3.0, &(-3f64).to_le_bytes());
    out.end();
    for (pair, uvs) in sample.triangles.chunks(2).zip(sample.uvs.chunks(2)) {
        for (p, uv) in
            [(pair[0][0], uvs[0][0]), (pair[0][1], uvs[0][1]), (pair[0][2], uvs[0][2]), (pair[1][2], uvs[1][2])]
        {
            out.number(p.x, &p.x.to_le_bytes());
            for c in [p.y, p.z] {
                out.number(c, &(c as f32).to_le_bytes());
            }
            out.number(7.0, &[7]);
            for c in [uv.x, 1.0 - uv.y] {
                out.number(c.into(), &c.to_le_bytes());
            }
            out.end();
        }
    }
    for q in 0..quads as i32 {
        out.number(9.0, &[9]);
        out.number(4.0, &[4]);
        for i in 4 * q..4 * q + 4 {
            out.number(i.into(), &i.to_le_bytes());
        }
        out.end();
    }
    bytes
}

struct PlyBody<'a> {
    bytes: &'a mut Vec<u8>,
    encoding: Ply,
}

impl PlyBody<'_> {
    fn number(&mut self, value: f64, little: &[u8]) {
        match self.encoding {
            Ply::Text => self.bytes.extend(format!("{value} ").bytes()),
            Ply::Little => self.bytes.extend(little),
            Ply::Big => self.bytes.extend(little.iter().rev()),
        }
    }

    fn end(&mut self) {
        if self.encoding == Ply::Text {
            self.bytes.push(b'\n');
        }
    }
}

/// One node that shifts, one below that mirrors; the texture inside.
pub fn glb(sample: &Sample) -> Vec<u8> {
    let image = png(sample);
    let corners: Vec<DVec3> = sample.triangles.iter().flatten().copied().collect();
    let mut bin = Vec::new();
    for p in &corners {
        // mm, z up → m, y up; then what the nodes undo: shift by 1 in x, mirrored in x.
        let scene = DVec3::new(p.x, p.z, -p.y) / 1000.0;
        for c in [-(scene.x - 1.0), scene.y, scene.z] {
            bin.extend((c as f32).to_le_bytes());
        }
    }
    let uv_at = bin.len();
    for uv in sample.uvs.iter().flatten() {
        for c in uv.to_array() {
            bin.extend(c.to_le_bytes());
        }
    }
    let index_at = bin.len();
    for t in 0..sample.triangles.len() as u16 {
        // The mirror turns triangles inside out, so they are stored so.
        for i in [3 * t, 3 * t + 2, 3 * t + 1] {
            bin.extend(i.to_le_bytes());
        }
    }
    let image_at = bin.len();
    bin.extend(&image);
    let n = corners.len();
    let json = serde_json::json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"translation": [1, 0, 0], "children": [1]}, {"scale": [-1, 1, 1], "mesh": 0}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0},
            {"attributes": {"POSITION": 0}, "mode": 1}
        ]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 1], "baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3", "min": [-9, -9, -9], "max": [9, 9, 9]},
            {"bufferView": 1, "componentType": 5126, "count": n, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": n, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": uv_at},
            {"buffer": 0, "byteOffset": uv_at, "byteLength": index_at - uv_at},
            {"buffer": 0, "byteOffset": index_at, "byteLength": image_at - index_at},
            {"buffer": 0, "byteOffset": image_at, "byteLength": image.len()}
        ],
        "buffers": [{"byteLength": bin.len()}]
    });
    glb_of(&json, &bin)
}

/// A GLB container.
pub fn glb_of(json: &serde_json::Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + bin.len();
    for word in [2, total as u32, json.len() as u32] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(&json);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&bin);
    bytes
}

/// A package's relationships, which name its model.
pub fn rels(target: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="{target}"
 Id="r0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#
    )
}

/// A 3MF package around a model part and a texture.
pub fn threemf_of(model: &str, texture: &[u8]) -> Vec<u8> {
    threemf_parts(&[
        ("_rels/.rels", rels("/3D/shape.model").into_bytes()),
        ("3D/shape.model", model.into()),
        ("3D/Textures/paint.png", texture.into()),
    ])
}

/// A 3MF package of these parts.
pub fn threemf_parts(parts: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, bytes) in parts {
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// A centimetre model; the build item quarters the turn that the component leaves, and shifts.
pub fn threemf_model(sample: &Sample) -> String {
    let mut vertices = String::new();
    let mut triangles = String::new();
    let mut coordinates = String::new();
    for (t, (triangle, uvs)) in sample.triangles.iter().zip(&sample.uvs).enumerate() {
        for (p, uv) in triangle.iter().zip(uvs) {
            // Undoes, in this order: shift by (1, 2, 3), turn by 90° about z; then centimetres.
            let q = *p / 10.0 - DVec3::new(1.0, 2.0, 3.0);
            writeln!(vertices, r#"<vertex x="{}" y="{}" z="{}"/>"#, q.y, -q.x, q.z).unwrap();
            writeln!(coordinates, r#"<m:tex2coord u="{}" v="{}"/>"#, uv.x, 1.0 - uv.y).unwrap();
        }
        let i = 3 * t;
        let [j, k] = [i + 1, i + 2];
        writeln!(triangles, r#"<triangle v1="{i}" v2="{j}" v3="{k}" pid="7" p1="{i}" p2="{j}" p3="{k}"/>"#).unwrap();
    }
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<model unit="centimeter" xml:lang="en-US" requiredextensions="m"
 xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02">
<resources>
<m:texture2d id="6" path="/3D/Textures/paint.png" contenttype="image/png"/>
<m:texture2dgroup id="7" texid="6">{coordinates}</m:texture2dgroup>
<object id="1" type="model"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object>
<object id="2" type="model"><components><component objectid="1" transform="0 1 0 -1 0 0 0 0 1 0 0 0"/></components>
</object>
</resources>
<build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 1 2 3"/></build>
</model>"#
    )
}
