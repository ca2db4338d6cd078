//! A textured box survives every format: corners, texture coordinates, texels, units, axes.

use std::path::Path;

use glam::DVec3;
use lumislice::mesh::{LoadOptions, Loaded, MeshError, Unit, close, load};

use super::shapes::corners;
use super::writers::{self, Ply, Sample, TEXTURE_SIDE, put, sample};

fn read(path: &Path) -> Loaded {
    load(path, &LoadOptions::default()).unwrap()
}

/// Same triangles in the same order, the same picture on them, and a closed solid of 24 mm³.
fn assert_same(loaded: Loaded, sample: &Sample, textured: bool, tolerance: f64) {
    let found = corners(&loaded.mesh);
    assert_eq!(found.len(), sample.triangles.len());
    assert_eq!(loaded.mesh.positions.len(), 8, "equal positions are shared");
    for (found, expected) in found.iter().flatten().zip(sample.triangles.iter().flatten()) {
        assert!(found.distance(*expected) <= tolerance, "{found} is not {expected}");
    }
    if textured {
        for (found, expected) in loaded.mesh.uvs.iter().flatten().zip(sample.uvs.iter().flatten()) {
            assert!(found.distance(*expected) < 1e-6, "{found} is not {expected}");
        }
        assert_eq!(loaded.mesh.uvs.len(), sample.triangles.len());
        let of = |t: usize| usize::from(loaded.mesh.material_of.get(t).copied().unwrap_or(0));
        let texture = loaded.mesh.materials[of(0)].base_color_texture.as_ref().unwrap();
        assert_eq!((texture.width, texture.height), (TEXTURE_SIDE, TEXTURE_SIDE));
        assert_eq!(texture.texels, sample.texels);
        assert!((0..12).all(|t| of(t) == of(0)));
    } else {
        assert!(loaded.mesh.uvs.is_empty() && loaded.mesh.materials.is_empty());
    }
    let solid = close(loaded.mesh).unwrap();
    assert!((solid.health.volume_mm3 - 24.0).abs() < 100.0 * tolerance + 1e-12);
    assert_eq!(solid.health.warnings(), Vec::<String>::new());
}

#[test]
fn obj_with_mtl() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    put(folder.path(), "paint job.mtl", writers::MTL);
    put(folder.path(), "paint.png", writers::png(&sample));
    let loaded = read(&put(folder.path(), "box.obj", writers::obj(&sample)));
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_eq!(loaded.mesh.materials[0].name, "paint");
    assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0]);
    assert_same(loaded, &sample, true, 0.0);
}

/// Faces that number texture coordinates, or normals, of a file that has none.
#[test]
fn obj_without_the_coordinates_that_its_faces_number() {
    let sample = sample();
    for corner in ["-3/-3/1 -2/-2/1 -1/-1/1", "-3/1 -2/1 -1/1", "-3/0/0 -2/0/0 -1/0/0", "-3/1/7 -2/2/7 -1/3/7"] {
        let text = writers::obj(&sample).replace("-3/-3/1 -2/-2/1 -1/-1/1", corner);
        let text: String =
            text.lines().filter(|line| !line.starts_with("vt")).map(|line| format!("{line}\n")).collect();
        let folder = tempfile::tempdir().unwrap();
        put(folder.path(), "paint job.mtl", "newmtl paint\nKd 0.5 0.25 1\n");
        let loaded = read(&put(folder.path(), "a.obj", &text));
        assert_eq!(loaded.warnings, ["faces number texture coordinates, and the file has none: it is read without"]);
        assert_eq!((loaded.mesh.triangles.len(), loaded.mesh.uvs.len(), loaded.lost_color), (12, 0, None));
        assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0]);
        // A texture needs them.
        put(folder.path(), "paint job.mtl", "newmtl paint\nmap_Kd paint.png\n");
        put(folder.path(), "paint.png", writers::png(&sample));
        let lost = read(&folder.path().join("a.obj")).lost_color.unwrap();
        assert!(lost.contains("12 of 12 triangles"), "{lost}");
    }
}

/// Textures that moved with the mesh, or were named on a system that does not tell cases apart.
#[test]
fn companions_are_found_beside_the_mesh() {
    let sample = sample();
    let of = |name: &str, files: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        put(folder.path(), "PAINT Job.mtl", format!("newmtl paint\nmap_Kd {name}\n"));
        files.iter().for_each(|file| drop(put(folder.path(), file, writers::png(&sample))));
        read(&put(folder.path(), "a.obj", writers::obj(&sample)))
    };
    for name in [
        "Paint.PNG",
        "C:\\scans\\rabbit\\paint.png",
        "/home/maker/paint.png",
        "../textures/PAINT.png",
        "tex\\paint.png",
    ] {
        let loaded = of(name, &["paint.png"]);
        assert_eq!((loaded.lost_color, loaded.companions.len()), (None, 2), "{name}: {:?}", loaded.warnings);
        assert!(loaded.mesh.materials[0].base_color_texture.is_some());
    }
    for (name, files) in
        [("paint.png", &["Paint.png", "PAINT.png"][..]), ("other.png", &["paint.png"]), ("tex/", &["paint.png"])]
    {
        assert!(of(name, files).lost_color.is_some(), "{name}");
    }
}

#[test]
fn obj_without_its_mtl_is_white_and_says_so() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let path = put(folder.path(), "box.obj", writers::obj(&sample));
    let loaded = read(&path);
    assert!(loaded.warnings[0].contains("`paint job.mtl`"), "{:?}", loaded.warnings);
    assert_eq!(loaded.mesh.materials[0].base_color, [1.0; 4]);
    put(folder.path(), "paint job.mtl", writers::MTL);
    let loaded = read(&path);
    assert!(loaded.warnings[0].contains("`paint.png`"), "{:?}", loaded.warnings);
    assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0]);
}

#[test]
fn a_short_colour_in_an_mtl_is_grey_not_a_crash() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    put(folder.path(), "paint job.mtl", "newmtl paint\nKd 0.5\n");
    let loaded = read(&put(folder.path(), "box.obj", writers::obj(&sample)));
    assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.5, 0.5, 1.0]);
}

#[test]
fn obj_polygons_fan_and_lines_may_continue() {
    let folder = tempfile::tempdir().unwrap();
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0.5 2 0\nv 0 1 0\nf 1 2 \\\n 3 4 5\nf 1 2\nl 1 2\np 1\n";
    let loaded = read(&put(folder.path(), "house.obj", text));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
}

#[test]
fn stl() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let warnings = |loaded: &Loaded| loaded.warnings.len();
    for bytes in [writers::stl_binary(&sample), writers::stl_text(&sample).into_bytes()] {
        let loaded = read(&put(folder.path(), "box.STL", bytes));
        assert_eq!(warnings(&loaded), 0);
        assert_same(loaded, &sample, false, 0.0);
    }
}

#[test]
fn stl_by_another_writer() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let vertex = |p: &DVec3| stl_io::Vertex::new(p.as_vec3().to_array());
    let triangles: Vec<stl_io::Triangle> = sample
        .triangles
        .iter()
        .map(|t| stl_io::Triangle { normal: stl_io::Normal::new([0.0; 3]), vertices: [0, 1, 2].map(|i| vertex(&t[i])) })
        .collect();
    let mut bytes = Vec::new();
    stl_io::write_stl(&mut bytes, triangles.iter()).unwrap();
    assert_same(read(&put(folder.path(), "box.stl", bytes)), &sample, false, 0.0);
}

#[test]
fn ply_in_all_encodings() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    put(folder.path(), "paint.png", writers::png(&sample));
    for encoding in [Ply::Text, Ply::Little, Ply::Big] {
        let loaded = read(&put(folder.path(), "box.ply", writers::ply(&sample, encoding)));
        assert_eq!(loaded.warnings, Vec::<String>::new());
        assert_same(loaded, &sample, true, 0.0);
    }
}

#[test]
fn ply_face_coordinates_win_over_vertex_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let text = "ply\r\nformat ascii 1.0\r\ncomment caf\u{e9}\r\nelement vertex 3\r\nproperty float x\r\nproperty \
        float y\r\n\
                property float z\r\nproperty float u\r\nproperty float v\r\nelement face 1\r\n\
                property list uchar uint vertex_index\r\nproperty list uchar float texcoord\r\nend_header\r\n\
                0 0 0 9 9\r\n1. 0 0 9 9\r\n0 .5 0 9 9\r\n3 0 1 2 6 0 0 1 0 0 1\r\n";
    let loaded = read(&put(folder.path(), "t.ply", text));
    let uv = loaded.mesh.uvs[0].map(|uv| uv.to_array());
    assert_eq!(uv, [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
}

#[test]
fn glb_with_nodes_and_texture() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let loaded = read(&put(folder.path(), "box.glb", writers::glb(&sample)));
    assert_eq!(loaded.warnings, ["1 primitive of points or lines skipped"]);
    assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0]);
    // Single precision metres, shifted by one: an ulp is 6e-5 mm.
    assert_same(loaded, &sample, true, 1e-4);
}

#[test]
fn gltf_strips_sparse_positions_quantised_coordinates_and_a_texture_transform() {
    let folder = tempfile::tempdir().unwrap();
    // Positions all zero but for two sparse ones, as a strip of one triangle; uv as normalised bytes.
    let mut bin = vec![1u8, 2, 0, 0];
    for c in [1f32, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bin.extend(c.to_le_bytes());
    }
    bin.extend([0u8, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 0]);
    put(folder.path(), "data 1.bin", &bin);
    let json = serde_json::json!({
        "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_texture_transform", "KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "mode": 5, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {
            "KHR_texture_transform": {"offset": [0.5, 0.0], "scale": [0.5, 2.0],
            "rotation": std::f64::consts::FRAC_PI_2}}}}}],
        "textures": [{"source": 0}], "images": [{"uri": "missing.png"}],
        "accessors": [
            {"componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0],
            "sparse": {"count": 2,
             "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 1}}},
            {"bufferView": 2, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC2"}],
        "bufferViews": [{"buffer": 0, "byteLength": 2}, {"buffer": 0, "byteOffset": 4, "byteLength": 24},
            {"buffer": 0, "byteOffset": 28, "byteLength": 12, "byteStride": 4}],
        "buffers": [{"byteLength": bin.len(), "uri": "data%201.bin"}]
    });
    let loaded = read(&put(folder.path(), "strip.gltf", json.to_string()));
    assert_eq!(corners(&loaded.mesh), [[DVec3::ZERO, DVec3::X * 1000.0, DVec3::Z * 1000.0]]);
    assert!(loaded.warnings[0].contains("image 0"), "{:?}", loaded.warnings);
    // Scaled, turned a quarter counter-clockwise in uv with v down, shifted: (u, v) → (0.5 + 2v, −0.5u).
    let expected = [[0.5, 0.0], [0.5, -0.5], [2.5, 0.0]];
    for (found, expected) in loaded.mesh.uvs[0].iter().zip(expected) {
        assert!(found.distance(expected.into()) < 1e-6, "{found} is not {expected:?}");
    }
}

#[test]
fn threemf_with_components_units_and_texture() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let package = writers::threemf_of(&writers::threemf_model(&sample), &writers::png(&sample));
    let loaded = read(&put(folder.path(), "box.3mf", package));
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_same(loaded, &sample, true, 1e-12);
}

#[test]
fn threemf_base_materials_are_linear_and_mirrors_keep_the_inside() {
    let folder = tempfile::tempdir().unwrap();
    let model = r##"<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
        <basematerials id="5"><base name="a" displaycolor="#FFFFFF"/><base name="b&amp;c" displaycolor="#80000080"/>
        </basematerials>
        <object id="1" pid="5" pindex="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
        <vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
        <triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3" p1="0"/>
        </triangles></mesh></object>
        </resources><build><item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/></build></model>"##;
    let loaded = read(&put(folder.path(), "t.3mf", writers::threemf_of(model, &[])));
    let names: Vec<_> = loaded.mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["b&c", "a"]);
    assert!((loaded.mesh.materials[0].base_color[0] - 0.215_86).abs() < 1e-4);
    assert_eq!(loaded.mesh.material_of, [0, 0, 0, 1]);
    let solid = close(loaded.mesh).unwrap();
    assert_eq!((solid.health.turned_shells, solid.health.flipped_triangles), (0, 0));
}

#[test]
fn units_and_the_matrix_from_the_file() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let stl = put(folder.path(), "box.stl", writers::stl_binary(&sample));
    for (unit, mm) in [(Unit::Um, 0.001), (Unit::Mm, 1.0), (Unit::Cm, 10.0), (Unit::M, 1000.0), (Unit::Inch, 25.4)] {
        let loaded = load(&stl, &LoadOptions { unit: Some(unit) }).unwrap();
        let expected = sample.triangles[0][0];
        assert_eq!(loaded.mesh.positions[0], expected * mm);
        assert!(loaded.file_to_mesh.transform_point3(expected).distance(expected * mm) < 1e-12 * mm);
    }
    let glb = put(folder.path(), "box.glb", writers::glb(&sample));
    let loaded = load(&glb, &LoadOptions { unit: Some(Unit::Cm) }).unwrap();
    let scene = DVec3::new(sample.triangles[0][0].x, sample.triangles[0][0].z, -sample.triangles[0][0].y) / 1000.0;
    assert!(loaded.file_to_mesh.transform_point3(scene).distance(loaded.mesh.positions[0]) < 1e-6);
    assert!(loaded.mesh.positions[0].distance(sample.triangles[0][0] / 100.0) < 1e-6);
}

#[test]
fn a_file_without_extension_is_known_by_its_bytes() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    for bytes in [
        writers::glb(&sample),
        writers::ply(&sample, Ply::Big),
        writers::stl_text(&sample).into_bytes(),
        writers::threemf_of(&writers::threemf_model(&sample), &[]),
    ] {
        assert_eq!(read(&put(folder.path(), "mesh", bytes)).mesh.triangles.len(), 12);
    }
    let unknown = load(&put(folder.path(), "mesh.xyz", "0 1 2"), &LoadOptions::default());
    assert!(matches!(unknown, Err(MeshError::UnknownFormat { .. })));
}

#[test]
fn an_image_inside_a_glb_needs_no_stated_type() {
    let (folder, sample) = (tempfile::tempdir().unwrap(), sample());
    let good = writers::glb(&sample);
    let length = u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&good[20..20 + length]).unwrap();
    json["images"][0].as_object_mut().unwrap().remove("mimeType");
    let loaded = read(&put(folder.path(), "box.glb", writers::glb_of(&json, &good[28 + length..])));
    assert_same(loaded, &sample, true, 1e-4);
}
