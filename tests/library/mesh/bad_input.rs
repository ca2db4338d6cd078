//! Every kind of broken file is refused in one line that names file, place, found and expected.

use lumislice::mesh::{LoadOptions, MeshError, load};

use super::writers::{self, Ply, glb_of, put, sample, threemf_of};

/// File name, bytes, and what the message must contain.
type Case = (&'static str, Vec<u8>, &'static [&'static str]);

fn check(cases: Vec<Case>) {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, parts) in cases {
        let path = put(folder.path(), name, &bytes);
        let error = load(&path, &LoadOptions::default()).expect_err(&format!("{name} with {parts:?}"));
        let message = error.to_string();
        println!("{}", message.replace(&*folder.path().to_string_lossy(), "…"));
        assert!(!message.contains('\n'), "{message}");
        assert!(message.starts_with(&*path.to_string_lossy()), "{message}");
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
}

fn text(text: &str) -> Vec<u8> {
    text.as_bytes().to_vec()
}

#[test]
fn missing_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().join("none.obj"), folder.path().to_owned()] {
        let error = load(&path, &LoadOptions::default()).unwrap_err();
        assert!(matches!(error, MeshError::Read { .. }), "{error}");
    }
}

#[test]
fn empty_files() {
    check(["a.obj", "a.stl", "a.ply", "a.glb", "a.gltf", "a.3mf"].map(|n| (n, vec![], &["empty file"][..])).to_vec());
}

#[test]
fn obj() {
    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let with = |rest: &str| text(&format!("{TRIANGLE}{rest}"));
    check(vec![
        ("a.obj", with(""), &["no triangles"]),
        ("a.obj", with("f 1 2 4\n"), &["line 4", "position 4", "1 to 3"]),
        ("a.obj", with("f 1 2 0\n"), &["line 4", "corner `0`"]),
        ("a.obj", with("f 1 2 -4\n"), &["line 4", "corner `-4`"]),
        ("a.obj", with("vt 0 0\nf 1/1 2/1 3/2\n"), &["line 5", "texture coordinate 2"]),
        ("a.obj", with("f 1/-1 2/-1 3/-1\nvt 0 0\n"), &["line 4", "no texture coordinate"]),
        ("a.obj", with("l 1 2 3\nl 1 2\np 1\n"), &["no triangles, but 2 lines, 1 row of points and 3 points"]),
        ("a.obj", with("surf 0 1 0 1 1 2 3\n"), &["no triangles, but `surf` and 3 points"]),
        ("a.obj", with("f 1 2\n"), &["1 face with fewer than three corners"]),
        ("a.obj", with("f 1 2 three\n"), &["line 4", "corner `three`"]),
        ("a.obj", with("f 1 2 99999999999999999999\n"), &["line 4"]),
        ("a.obj", with("v 1 2\nf 1 2 3\n"), &["line 4", "`v 1 2`", "three numbers"]),
        ("a.obj", with("v 1 2 x\n"), &["line 4", "`v 1 2 x`"]),
        ("a.obj", with("v 1 nan 2\nf 1 2 3\n"), &["line 4", "NaN", "finite"]),
        ("a.obj", with("v -nan(ind) 0 0\nf 1 2 3\n"), &["line 4", "position (NaN, 0, 0)", "finite"]),
        ("a.obj", with("v nancy 0 0\n"), &["line 4", "`v nancy 0 0`", "three numbers"]),
        ("a.obj", with("v 1 2 1e999\n"), &["line 4", "inf", "finite"]),
        ("a.obj", with("vt\n"), &["line 4", "`vt u v`"]),
        ("a.obj", vec![0xff; 400], &["no triangles"]),
        ("a.obj", text("v 0 0 0\nv 1e7 0 0\nv 0 1 0\nf 1 2 3\n"), &["10000000 mm", "unit = \"um\""]),
        ("a.obj", text("v 0 0 0\nv 1e-7 0 0\nv 0 1e-7 0\nf 1 2 3\n"), &["1e-7 mm", "unit = \"m\""]),
        ("a.obj", text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n"), &[" 0 mm"]),
    ]);
}

#[test]
fn stl() {
    let sample = sample();
    let good = writers::stl_binary(&sample);
    let with_count = |count: u32| {
        let mut bytes = good.clone();
        bytes[0..5].copy_from_slice(b"other");
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        bytes
    };
    let mut not_a_number = good.clone();
    not_a_number[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    let facet = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n";
    check(vec![
        ("a.stl", with_count(u32::MAX), &["byte 80", "4294967295 triangles", "600 bytes"]),
        ("a.stl", with_count(13), &["byte 80", "13 triangles", "650 bytes"]),
        ("a.stl", good[..83].to_vec(), &["84 bytes"]),
        ("a.stl", with_count(0)[..84].to_vec(), &["no triangles"]),
        ("a.stl", not_a_number, &["triangle 1", "NaN"]),
        ("a.stl", text(facet), &["line 5", "end of the file", "endfacet"]),
        (
            "a.stl",
            text(&format!("{facet}endloop\nendfacet\nendsolid")),
            &["line 7", "`endfacet`", "corner 3", "line 2"],
        ),
        ("a.stl", text(&format!("{facet}vertex 0 1\n")), &["line 6", "`vertex 0 1`", "three numbers"]),
        ("a.stl", text(&format!("{facet}vertex -nan(ind) 0 0\n")), &["line 6", "position (NaN, 0, 0)", "finite"]),
        ("a.stl", text(&format!("{facet}vertex 0 1 0\nvertex 0 0 1\n")), &["line 7", "endloop"]),
        ("a.stl", text("solid x\nfacets\nendsolid\n"), &["line 2", "`facets`"]),
        ("a.stl", text("solid x\nendsolid\n"), &["no triangles, but 1 solid"]),
        ("a.stl", text("nothing of the kind"), &["19 bytes", "`nothing"]),
    ]);
}

#[test]
fn ply() {
    let sample = sample();
    let little = writers::ply(&sample, Ply::Little);
    let replaced = |from: &str, to: &str| {
        let at = little.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&little[..at], to.as_bytes(), &little[at + from.len()..]].concat()
    };
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let with = |body: &str| text(&format!("{head}{body}"));
    check(vec![
        ("a.ply", little[..60].to_vec(), &["end_header"]),
        ("a.ply", little[..little.len() - 1].to_vec(), &["face 5", "end of the file"]),
        ("a.ply", replaced("vertex 24", "vertex 4294967295"), &["element vertex", "4294967295", "bytes left"]),
        ("a.ply", replaced("face 6", "face 18446744073709551615"), &["element face", "18446744073709551615"]),
        ("a.ply", replaced("face 6", "face 18446744073709551616"), &["line", "`element face 18446744073709551616`"]),
        ("a.ply", replaced("vertex 24", "vertex -1"), &["`element vertex -1`"]),
        ("a.ply", replaced("double x", "double w"), &["element vertex", "`w y z", "x, y and z"]),
        ("a.ply", replaced("format binary_little_endian 1.0", "format binary 1.0"), &["line 2", "`format binary 1.0`"]),
        ("a.ply", replaced("format binary_little_endian 1.0\n", ""), &["no format line"]),
        ("a.ply", replaced("property double x", "property triple x"), &["`property triple x`"]),
        ("a.ply", text("ply\nformat ascii 1.0\nelement face 9999999999999\nend_header\n"), &["without properties"]),
        ("a.ply", text("ply\nformat ascii 1.0\nproperty int x\nend_header\n"), &["line 3", "an element before"]),
        ("a.ply", text("ply of potatoes"), &["line 1", "`ply of potatoes`"]),
        ("a.ply", with("0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), &["vertex index 3", "below 3"]),
        ("a.ply", with("0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), &["line 13, face 0", "vertex index -1"]),
        ("a.ply", with("0 0 0\n1 0 0\n0 1 0\n3000000000 0 1 2\n"), &["line 13, face 0", "a list of 3000000000 items"]),
        ("a.ply", with("0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), &["no triangles"]),
        (
            "a.ply",
            text(
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                  property float f_dc_0\nend_header\n0 0 0 1\n",
            ),
            &["no triangles, but 1 of the element `vertex` (Gaussian splats)"],
        ),
        ("a.ply", with("0 0 0\n1 zero 0\n0 1 0\n3 0 1 2\n"), &["line 11, vertex 1", "`zero`", "a number"]),
        ("a.ply", with("0 0 0\n1 inf 0\n0 1 0\n3 0 1 2\n"), &["line 11, vertex 1", "inf", "finite"]),
        ("a.ply", with("0 0 0\n1 0 0\n0 1 0\n3 0 1\n"), &["face 0", "end of the file"]),
    ]);
}

#[test]
fn gltf() {
    let good = writers::glb(&sample());
    let triangle = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut json = serde_json::json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1,
                1]},
                {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"}],
            "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36,
            "byteLength": 12}],
            "buffers": [{"byteLength": 48}]
        });
        change(&mut json);
        let positions = [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].map(f32::to_le_bytes).concat();
        let indices = [0u32, 1, 2].map(u32::to_le_bytes).concat();
        glb_of(&json, &[positions, indices].concat())
    };
    let set = |pointer: &'static str, value: serde_json::Value| {
        triangle(&|json| *json.pointer_mut(pointer).unwrap() = value.clone())
    };
    let mut infinite = triangle(&|_| ());
    let at = infinite.len() - 48;
    infinite[at..at + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let mut stray = triangle(&|_| ());
    let end = stray.len();
    stray[end - 4..].copy_from_slice(&3u32.to_le_bytes());
    check(vec![
        ("a.glb", good[..11].to_vec(), &["byte 12", "JSON chunk"]),
        ("a.glb", good[..good.len() - 1].to_vec(), &["whole BIN chunk"]),
        ("a.glb", [&good[..4], &[1], &good[5..]].concat(), &["byte 4", "GLB of version 1", "gltf-pipeline"]),
        ("a.glb", [&good[..4], &[3], &good[5..]].concat(), &["byte 4", "GLB of version 3", "export it as glTF 2.0"]),
        ("a.gltf", text("{"), &["JSON part", "EOF"]),
        ("a.gltf", text("{}"), &["asset", "no version", "glTF 2.0 document"]),
        ("a.glb", set("/asset", serde_json::json!({})), &["asset", "no version"]),
        ("a.glb", set("/asset/version", "1.0".into()), &["asset", "glTF version `1.0`", "gltf-pipeline"]),
        ("a.glb", set("/asset/version", 1.0.into()), &["asset", "glTF version `1.0`", "gltf-pipeline"]),
        ("a.glb", set("/asset/version", "3.0".into()), &["asset", "glTF version `3.0`", "export it as glTF 2.0"]),
        ("a.glb", set("/asset/version", "two".into()), &["asset", "glTF version `two`"]),
        (
            "a.gltf",
            text("{\"asset\": {\"version\": \"1.0\"}, \"meshes\": {\"m\": {\"primitives\": []}}}"),
            &["asset", "glTF version `1.0`", "expected glTF 2.0", "gltf-pipeline"],
        ),
        (
            "a.gltf",
            text("{\"asset\": {}, \"meshes\": {\"m\": {\"primitives\": []}}}"),
            &["asset", "no version, and parts with names", "gltf-pipeline"],
        ),
        ("a.glb", infinite, &["accessor 0, vertex 0", "inf"]),
        ("a.glb", stray, &["primitive 0", "vertex index 3", "below 3"]),
        (
            "a.glb",
            set("/accessors/0/count", 4_000_000_000u64.into()),
            &["accessor 0", "4000000000 elements", "36 bytes"],
        ),
        ("a.glb", set("/accessors/0/count", u64::MAX.into()), &["accessor 0"]),
        ("a.glb", set("/accessors/0/bufferView", 9.into()), &["JSON part", "bufferView"]),
        ("a.glb", set("/accessors/0/type", "VEC2".into()), &["accessor 0", "Vec2", "3 components"]),
        ("a.glb", set("/accessors/1/componentType", 5126.into()), &["accessor 1", "F32", "unsigned"]),
        ("a.glb", set("/bufferViews/0/byteLength", 50.into()), &["buffer view 0", "50", "inside the buffer"]),
        ("a.glb", set("/bufferViews/0/byteOffset", u64::MAX.into()), &["buffer view 0"]),
        ("a.glb", set("/buffers/0/byteLength", 5000.into()), &["buffer 0", "48 bytes", "5000 bytes"]),
        ("a.glb", set("/nodes", serde_json::json!([{"mesh": 0, "children": [0]}])), &["node 0", "second parent"]),
        ("a.glb", set("/meshes/0/primitives/0/attributes", serde_json::json!({"NORMAL": 0})), &["POSITION", "Missing"]),
        (
            "a.glb",
            set("/meshes/0/primitives/0/attributes", serde_json::json!({"POSITION": 7})),
            &["mesh 0", "accessor 7", "below 2"],
        ),
        (
            "a.glb",
            triangle(&|json| {
                json["accessors"][0] = serde_json::json!({"componentType": 5126, "count": 400_000_000u64,
                "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1], "sparse": {"count": 1,
                "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}}})
            }),
            &["accessor 0", "400000000 elements without a buffer view", "no more than the file has bytes"],
        ),
        (
            "a.glb",
            set("/accessors/0", serde_json::json!({"componentType": 5126, "count": 3, "type": "VEC3"})),
            &[" 0 mm"],
        ),
        (
            "a.glb",
            triangle(&|json| {
                json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
                json["meshes"][0]["primitives"][0]["extensions"] =
                    serde_json::json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
            }),
            &["primitive 0", "positions in KHR_draco_mesh_compression alone"],
        ),
        ("a.glb", set("/nodes", serde_json::json!([{"name": "a"}])), &["no triangles, but 1 mesh without a triangle"]),
        (
            "a.glb",
            triangle(&|json| json["meshes"][0]["primitives"][0]["mode"] = 1.into()),
            &["no triangles, but 1 primitive of points or lines"],
        ),
        (
            "a.glb",
            set("/asset", serde_json::json!({"version": "2.0", "minVersion": "2.1"})),
            &["asset", "minVersion `2.1`", "at most 2.0"],
        ),
        (
            "a.glb",
            triangle(&|json| json["extensionsRequired"] = serde_json::json!(["KHR_draco_mesh_compression"])),
            &["KHR_draco_mesh_compression"],
        ),
        (
            "a.glb",
            triangle(&|json| json["buffers"][0]["uri"] = "gone.bin".into()),
            &["buffer 0", "`gone.bin`", "no such file"],
        ),
    ]);
}

/// As programs write numbers that take their user's for a German or French one.
#[test]
fn decimal_commas() {
    const COMMAS: &str = "decimal commas are not read";
    const LIST: &str = "commas between numbers are not read";
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let model = writers::threemf_model(&sample());
    let replaced = |from: &str, to: &str| {
        assert!(model.contains(from), "{from}");
        threemf_of(&model.replacen(from, to, 1), &[])
    };
    check(vec![
        ("a.obj", text("v 1,5 2,0 0,25\n"), &["line 1", "`v 1,5 2,0 0,25`", "three numbers", COMMAS]),
        ("a.obj", text("v 0 0 0\nv 1 0 -0,5\n"), &["line 2", "`v 1 0 -0,5`", COMMAS]),
        ("a.obj", text("v 0 0 0 0,8 0,2 0,2\n"), &["line 1", "`v x y z r g b`", COMMAS]),
        ("a.obj", text("v 1, 2, 3\n"), &["line 1", "`v 1, 2, 3`", LIST]),
        ("a.obj", text("v 0 0 0 1, 0, 0\n"), &["line 1", "`v x y z r g b`", LIST]),
        ("a.obj", text("v 0 0 0\nvt 0,5 0,5\n"), &["line 2", "`vt 0,5 0,5`", COMMAS]),
        ("a.obj", text("v 0 0 0\nvt 0 0,5\n"), &["line 2", "`vt 0 0,5`", COMMAS]),
        (
            "a.stl",
            text("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 1,5 0\n"),
            &["line 4", "`vertex 0 1,5`", COMMAS],
        ),
        ("a.ply", text(&format!("{head}0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n")), &["line 11, vertex 1", "`0,5`", COMMAS]),
        ("a.3mf", replaced("<vertex x=\"", "<vertex x=\"0,\" was=\""), &["line 44", "x = `0,`", LIST]),
        ("a.3mf", replaced("1 0 0 0 1 0 0 0 1 1 2 3", "1,0 0 0 0 1 0 0 0 1 1 2 3"), &["transform `1,0", COMMAS]),
    ]);
}

#[test]
fn threemf() {
    let good = writers::threemf_model(&sample());
    let package = threemf_of(&good, &[]);
    let replaced = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        threemf_of(&good.replacen(from, to, 1), &[])
    };
    check(vec![
        ("a.3mf", text("PK\x03\x04 and no more"), &["the package", "zip"]),
        ("a.3mf", package[..package.len() - 30].to_vec(), &["the package"]),
        ("a.3mf", replaced("v1=\"0\"", "v1=\"36\""), &["object 1", "vertex index 36", "below 36"]),
        ("a.3mf", replaced("v1=\"0\"", "v1=\"-1\""), &["line", "v1 = `-1`", "a number"]),
        ("a.3mf", replaced("v1=\"0\"", ""), &["line", "no v1"]),
        ("a.3mf", replaced("<vertex x=\"", "<vertex x=\"a"), &["line 44", "x = `a"]),
        ("a.3mf", replaced("<vertex x=\"", "<vertex x=\"1e999\" was=\""), &["line 44", "inf", "finite"]),
        ("a.3mf", replaced("centimeter", "cubit"), &["line", "`cubit`", "millimeter"]),
        ("a.3mf", replaced("</object>", "</objekt>"), &["line", "well-formed XML"]),
        ("a.3mf", replaced("<model", "<modell").to_vec(), &["well-formed XML"]),
        ("a.3mf", replaced("objectid=\"1\"", "objectid=\"2\""), &["object 2", "no cycles"]),
        ("a.3mf", replaced("objectid=\"1\"", "objectid=\"8\""), &["object 8", "no such object"]),
        ("a.3mf", replaced("<item objectid=\"2\"", "<thing objectid=\"2\""), &["without items"]),
        ("a.3mf", replaced("1 0 0 0 1 0 0 0 1 1 2 3", "1 0 0"), &["transform `1 0 0`", "12 numbers"]),
        ("a.3mf", replaced("p1=\"0\"", "p1=\"99\""), &["property group 7", "below 36"]),
        ("a.3mf", replaced("requiredextensions=\"m\"", "requiredextensions=\"s\""), &["required extension `s`"]),
        (
            "a.3mf",
            replaced(
                "requiredextensions=\"m\"",
                "requiredextensions=\"b\" xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\"",
            ),
            &["required extension `b` (`beamlattice/2017/02`)"],
        ),
        (
            "a.3mf",
            replaced("type=\"model\"><mesh>", "type=\"support\"><mesh>"),
            &["no triangles, but objects of type `support` (1 left out)"],
        ),
        ("a.3mf", threemf_of("<svg/>", &[]), &["no model element"]),
        ("a.3mf", threemf_of("<model><resources><object id='1'>", &[]), &["end of the part"]),
    ]);
}

/// What is small in a file and many when it is placed is counted before any of it is.
#[test]
fn what_multiplies_is_counted_first() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: Vec<u8>| {
        let begun = std::time::Instant::now();
        let message = load(&put(folder.path(), name, bytes), &LoadOptions::default()).unwrap_err().to_string();
        assert!(begun.elapsed().as_secs() < 20, "{message}");
        assert!(message.contains("at most 100000000 triangles") && !message.contains('\n'), "{message}");
        message
    };
    let triangles = 20_000;
    let strip = |i: usize| format!("<vertex x='{}' y='{}' z='0'/>", i / 2, i % 2);
    let face = |i: usize| format!("<triangle v1='{i}' v2='{}' v3='{}'/>", i + 1, i + 2);
    let mesh = format!(
        "<mesh><vertices>{}</vertices><triangles>{}</triangles></mesh>",
        (0..triangles + 2).map(strip).collect::<String>(),
        (0..triangles).map(face).collect::<String>()
    );
    let mut model = format!("<model><resources><object id='0'>{mesh}</object>");
    for level in 1..5 {
        let below = format!("<component objectid='{}'/>", level - 1).repeat(10);
        model += &format!("<object id='{level}'><components>{below}</components></object>");
    }
    model += "</resources><build><item objectid='4'/></build></model>";
    let message = refused("laughs.3mf", threemf_of(&model, &[]));
    assert!(message.contains("found 200000000 triangles"), "{message}");
    // A mesh of as many triangles, by 10,000 nodes or by one with 10,000 instances.
    let floats: Vec<f32> = (0..triangles + 2).flat_map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    let bin: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    let many: Vec<usize> = (0..10_000).collect();
    let node = serde_json::json!({"mesh": 0});
    let instanced = serde_json::json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
        {"TRANSLATION": 1}}}});
    for (name, nodes, roots) in
        [("nodes.glb", vec![node; many.len()], many.clone()), ("instances.glb", vec![instanced], vec![0])]
    {
        let count = floats.len() / 3;
        let json = serde_json::json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes,
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
                    "min": [0, 0, 0], "max": [9, 9, 9]},
                {"bufferView": 0, "componentType": 5126, "count": many.len(), "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": bin.len()}], "buffers": [{"byteLength": bin.len()}]
        });
        let message = refused(name, glb_of(&json, &bin));
        assert!(message.contains("found 200000000 triangles"), "{message}");
    }
}

/// Vertices that no triangle uses are not placed.
#[test]
fn unused_vertices_do_not_multiply() {
    let folder = tempfile::tempdir().unwrap();
    let vertices: String = (0..10_000).map(|i| format!("<vertex x='{}' y='{}' z='0'/>", i % 3, i % 2)).collect();
    let mesh = format!(
        "<mesh><vertices>{vertices}</vertices><triangles><triangle v1='9990' v2='9991' v3='9992'/></triangles></mesh>"
    );
    let components = "<component objectid='1'/>".repeat(9_000);
    let model = format!(
        "<model><resources><object id='1'>{mesh}</object><object id='2'><components>{components}</components></object>\
         </resources><build><item objectid='2'/></build></model>"
    );
    let loaded = load(&put(folder.path(), "a.3mf", threemf_of(&model, &[])), &LoadOptions::default()).unwrap();
    assert_eq!((loaded.mesh.triangles.len(), loaded.mesh.positions.len()), (9_000, 3));
}

#[test]
fn components_that_double_at_every_level_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = "<model><resources><object id='0'><mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='1' y='0' \
        z='0'/>\
                     <vertex x='0' y='1' z='0'/></vertices><triangles><triangle v1='0' v2='1' \
                     v3='2'/></triangles></mesh></object>"
        .to_owned();
    // 131,072 triangles: few enough for memory.
    for level in 1..18 {
        let below = format!("<component objectid='{}'/>", level - 1).repeat(2);
        model += &format!("<object id='{level}'><components>{below}</components></object>");
    }
    model += "</resources><build><item objectid='17'/></build></model>";
    let path = put(folder.path(), "laughs.3mf", threemf_of(&model, &[]));
    let message = load(&path, &LoadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("at most 100000 components"), "{message}");
}
