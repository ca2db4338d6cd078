//! Colour is read, or said to be lost: every source of it that a format has.

use glam::{DVec3, Vec2};
use lumislice::mesh::{LoadOptions, Loaded, Placement, Size, close, load, place};
use serde_json::{Value, json};

use super::painted::{assert_shares, byte, linear, shares};
use super::shapes::box_triangles;
use super::writers::{glb_of, put, rels, threemf_parts};

const RED: [u8; 3] = [200, 40, 40];
const BLUE: [u8; 3] = [40, 40, 200];
const GREEN: [u8; 3] = [30, 150, 60];

/// A picture, texels row by row from the top.
fn png(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, texels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&texels.concat()).unwrap();
    writer.finish().unwrap();
    bytes
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

/// Red on the left, blue on the right.
fn halves() -> Vec<u8> {
    png(4, &[RED, RED, BLUE, BLUE].map(opaque).repeat(4))
}

/// Reads the first of the files, which lie in one folder.
fn read(files: &[(&str, Vec<u8>)]) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<_> = files.iter().map(|(name, bytes)| put(folder.path(), name, bytes)).collect();
    load(&paths[0], &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn lost(loaded: &Loaded) -> &str {
    loaded.lost_color.as_deref().unwrap_or("")
}

fn said(loaded: &Loaded, part: &str) -> bool {
    loaded.warnings.iter().any(|warning| warning.contains(part))
}

const FACES: [[usize; 4]; 6] = [[1, 4, 3, 2], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];
const POINTS: [[u8; 3]; 8] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A cube as OBJ, with something behind each `v`, and the whole picture, or this part of it, on every face.
fn obj(head: &str, behind: impl Fn(usize) -> String, uvs: Option<[[f32; 2]; 4]>) -> Vec<u8> {
    let mut text = format!("mtllib a.mtl\n{head}\n");
    for (i, [x, y, z]) in POINTS.iter().enumerate() {
        text += &format!("v {x} {y} {z} {}\n", behind(i));
    }
    for [u, v] in uvs.into_iter().flatten() {
        text += &format!("vt {u} {v}\n");
    }
    for [a, b, c, d] in FACES {
        text += &match uvs {
            Some(_) => format!("f {a}/1 {b}/2 {c}/3 {d}/4\n"),
            None => format!("f {a} {b} {c} {d}\n"),
        };
    }
    text.into_bytes()
}

const WHOLE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

fn plain_obj(mtl: &str, uvs: Option<[[f32; 2]; 4]>) -> Loaded {
    read(&[
        ("a.obj", obj("usemtl m", |_| String::new(), uvs)),
        ("a.mtl", mtl.into()),
        ("half.png", halves()),
        ("red tex.png", png(1, &[opaque(RED)])),
    ])
}

#[test]
fn mtl_keywords_in_any_case() {
    for mtl in [
        "newmtl m\nMAP_KD red tex.png",
        "NEWMTL m\nmap_kd -S 1 1 1 red tex.png",
        "NewMtl m\nkD 0.57758 0.021219 0.021219",
    ] {
        let loaded = plain_obj(mtl, Some(WHOLE));
        assert_eq!(lost(&loaded), "");
        assert_shares(&loaded, &[(RED, 1.0)]);
    }
}

#[test]
fn mtl_options_place_the_texture() {
    let left = [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]];
    let beyond = [[1.05, 0.0], [1.45, 0.0], [1.45, 1.0], [1.05, 1.0]];
    for (option, uvs, color) in [
        ("-s 0.5 1 1", WHOLE, RED),
        ("-s .5", WHOLE, RED),
        ("-o 0.5 0 0", left, BLUE),
        ("-s 0.5 1 1 -o 0.5 0 0", WHOLE, BLUE),
        ("-clamp on", beyond, BLUE),
        ("-clamp off", beyond, RED),
        ("-o 1 2 3 \"red tex.png\" #", WHOLE, RED),
    ] {
        let file = if option.contains('"') { "" } else { "half.png" };
        let loaded = plain_obj(&format!("newmtl m\nmap_Kd {option} {file}"), Some(uvs));
        assert_eq!(lost(&loaded), "");
        println!("{option}");
        assert_shares(&loaded, &[(color, 1.0)]);
    }
}

#[test]
fn what_an_mtl_leaves_open_is_said() {
    for (mtl, uvs, part) in [
        ("newmtl m\nKs 1 1 1", None, "without Kd or map_Kd"),
        ("newmtl other\nKd 1 0 0", None, "nowhere defined"),
        ("newmtl m\nKd spectral red.rfl", None, "expected three numbers"),
        ("newmtl m\nKd 0.6 0.6 0.6\nmap_Ka half.png", Some(WHOLE), "`m` (map_Ka)"),
        ("newmtl m\nKd 128 64 0", None, "found colour `128 64 0`, expected three numbers of 0 to 1"),
        ("newmtl m\nKd -1 0 0", None, "expected three numbers of 0 to 1"),
        (
            "newmtl m\nKd 0,5 0,25 0",
            None,
            "line 2: found colour `0,5 0,25 0`, expected three numbers of 0 to 1 (decimal",
        ),
        ("newmtl m\nmap_Kd -s 0,5 1,0 half.png", Some(WHOLE), "line 2: found options `-s 0,5 1,0 half.png`"),
        ("newmtl m\nmap_Kd none.png", Some(WHOLE), "no such file"),
        ("newmtl m\nmap_Kd half.png", None, "12 of 12 triangles with the texture of material `m`"),
        ("newmtl m\nmap_Kd -mm 0.2 1 half.png", Some(WHOLE), "-mm"),
    ] {
        let loaded = plain_obj(mtl, uvs);
        assert!(lost(&loaded).contains(part), "{mtl}: {:?}", loaded.warnings);
    }
    let black = plain_obj("newmtl m\nKd 0 0 0\nmap_Kd half.png", Some(WHOLE));
    assert!(lost(&black).is_empty() && said(&black, "multiplies its texture by black"));
    assert_shares(&black, &[([0, 0, 0], 1.0)]);
    for unseen in ["d 0.0", "Tr 1"] {
        let loaded = plain_obj(&format!("newmtl m\nKd 1 0 0\n{unseen}"), None);
        assert!(lost(&loaded).is_empty() && said(&loaded, "wholly transparent"), "{:?}", loaded.warnings);
    }
    let masked = plain_obj("newmtl m\nmap_Kd half.png\nmap_d half.png", Some(WHOLE));
    assert!(lost(&masked).is_empty() && said(&masked, "map_d"));
    let mapped = read(&[("a.obj", obj("usemap wood", |_| String::new(), None)), ("a.mtl", Vec::new())]);
    assert!(lost(&mapped).contains("usemap"));
}

#[test]
fn colours_of_obj_vertices() {
    let of = |mtl: &str, behind: &dyn Fn(usize) -> String, uvs| {
        read(&[("a.obj", obj("usemtl m", behind, uvs)), ("a.mtl", mtl.into()), ("half.png", halves())])
    };
    let red = |_: usize| "0.784314 0.156863 0.156863".to_owned();
    let bytes = |_: usize| "200 40 40".to_owned();
    let with_alpha = |_: usize| "0.784314 0.156863 0.156863 1.0".to_owned();
    let with_weight = |_: usize| "1 0.784314 0.156863 0.156863".to_owned();
    // In place of Kd; as bytes; with alpha; a Kd stays where all vertices are white, and where a weight is all there
    // is.
    for behind in [&red as &dyn Fn(usize) -> String, &bytes, &with_alpha, &with_weight] {
        let loaded = of("newmtl m\nKd 0.8 0.8 0.8", behind, None);
        assert_eq!(loaded.warnings, Vec::<String>::new());
        assert!(loaded.mesh.corner_colors.is_empty(), "one colour is a material");
        assert_shares(&loaded, &[(RED, 1.0)]);
    }
    for behind in ["1 1 1", "1.0", ""] {
        let loaded = of("newmtl m\nKd 0.57758 0.021219 0.021219", &|_| behind.to_owned(), None);
        assert_shares(&loaded, &[(RED, 1.0)]);
    }
    // The lower four red, the upper four blue: a face each, and four that go from one to the other.
    let by_height = |i: usize| if i < 4 { red(i) } else { "0.156863 0.156863 0.784314".to_owned() };
    let loaded = of("newmtl m\nKd 1 1 1", &by_height, None);
    assert!(loaded.mesh.corner_colors.len() == 12 && lost(&loaded).is_empty());
    let found = shares(&loaded);
    assert!((found[&RED] - 1.0 / 6.0).abs() < 1e-6 && (found[&BLUE] - 1.0 / 6.0).abs() < 1e-6, "{found:?}");
    assert!(found.keys().all(|[r, g, b]| *g == 40 && (40..=200).contains(r) && (40..=200).contains(b)), "{found:?}");
    // Without any material; under a texture; some missing.
    let bare = read(&[("a.obj", obj("", red, None)), ("a.mtl", Vec::new())]);
    assert_shares(&bare, &[(RED, 1.0)]);
    let textured = of("newmtl m\nmap_Kd half.png", &by_height, Some(WHOLE));
    assert!(said(&textured, "12 triangles with a texture are not used"));
    assert_shares(&textured, &[(RED, 0.5), (BLUE, 0.5)]);
    let some = of("newmtl m\nKd 1 1 1", &|i| if i < 4 { red(i) } else { String::new() }, None);
    assert!(lost(&some).contains("10 triangles have no vertex colour"), "{}", lost(&some));
    // ZBrush: in comments, mask before red, green, blue.
    let mut painted = obj("", |_| String::new(), None);
    painted.extend(format!("#MRGB {}\n", "ffc82828".repeat(8)).into_bytes());
    assert_shares(&read(&[("a.obj", painted), ("a.mtl", Vec::new())]), &[(RED, 1.0)]);
}

/// A cube as PLY text: types and values of vertices and faces besides the usual, and lines for the header.
fn ply(header: &str, vertex: (&str, &dyn Fn(usize) -> String), face: (&str, &dyn Fn(usize) -> String)) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\n{header}element vertex 8\nproperty float x\nproperty float y\nproperty float z\n{}\
         element face 6\nproperty list uchar int vertex_indices\n{}end_header\n",
        vertex.0, face.0
    );
    for (i, [x, y, z]) in POINTS.iter().enumerate() {
        text += &format!("{x} {y} {z} {}\n", vertex.1(i));
    }
    for (i, face_points) in FACES.iter().enumerate() {
        let [a, b, c, d] = face_points.map(|p| p - 1);
        text += &format!("4 {a} {b} {c} {d} {}\n", face.1(i));
    }
    text.into_bytes()
}

#[test]
fn colours_of_ply_vertices_and_faces() {
    let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
    let colors = |kind: &str| format!("property {kind} red\nproperty {kind} green\nproperty {kind} blue\n");
    for (kind, value) in
        [("uchar", "200 40 40"), ("ushort", "51400 10280 10280"), ("float", "0.784314 0.156863 0.156863")]
    {
        for names in [
            colors(kind),
            colors(kind)
                .replace("red", "diffuse_red")
                .replace("green", "diffuse_green")
                .replace("blue", "diffuse_blue"),
        ] {
            let value = |_: usize| value.to_owned();
            for bytes in [ply("", (&names, &value), none), ply("", none, (&names, &value))] {
                let loaded = read(&[("a.ply", bytes)]);
                assert_eq!(loaded.warnings, Vec::<String>::new());
                assert_shares(&loaded, &[(RED, 1.0)]);
            }
        }
    }
    // A face of another colour.
    let face = |i: usize| if i == 2 { "40 40 200" } else { "200 40 40" }.to_owned();
    assert_shares(
        &read(&[("a.ply", ply("", none, (&colors("uchar"), &face)))]),
        &[(RED, 5.0 / 6.0), (BLUE, 1.0 / 6.0)],
    );
    assert!(read(&[("a.ply", ply("", none, none))]).mesh.materials.is_empty());
    // Both: white vertices say nothing, others go before, and it is said.
    let both = |vertex: &'static str| {
        read(&[("a.ply", ply("", (&colors("uchar"), &move |_| vertex.to_owned()), (&colors("uchar"), &face)))])
    };
    assert_shares(&both("255 255 255"), &[(RED, 5.0 / 6.0), (BLUE, 1.0 / 6.0)]);
    let vertices = both("30 150 60");
    assert_shares(&vertices, &[(GREEN, 1.0)]);
    assert!(said(&vertices, "colours of the faces are not used"), "{:?}", vertices.warnings);
}

/// Colours in properties that say nothing alone.
#[test]
fn colours_of_other_properties_are_said_to_be_lost() {
    let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
    let red = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    for (names, value) in [
        ("property uchar gray\n", "128"),
        ("property float Intensity\n", "0.5"),
        ("property uint rgb\n", "13117480"),
        ("property list uchar uchar rgba\n", "4 200 40 40 255"),
        ("property uchar red\nproperty uchar green\n", "200 40"),
        ("property uchar ambient_red\nproperty uchar ambient_green\nproperty uchar ambient_blue\n", "1 2 3"),
    ] {
        let value = move |_: usize| value.to_owned();
        for bytes in [ply("", (names, &value), none), ply("", none, (names, &value))] {
            let loaded = read(&[("a.ply", bytes)]);
            assert!(lost(&loaded).contains("colours by the property"), "{names}: {:?}", loaded.warnings);
        }
        let both = read(&[("a.ply", ply("", (red, &|_| "200 40 40".to_owned()), (names, &value)))]);
        assert_eq!(lost(&both), "");
    }
}

/// As Blender 2.4 wrote them.
#[test]
fn a_ply_of_blender_2() {
    let header = "comment Created by Blender3D 248 - www.blender.org, source file: a.blend\n";
    let names = "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n\
                 property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
    let bytes = ply(header, (names, &|_| "0.0 0.0 1.0 0.5 0.5 200 40 40".to_owned()), none);
    let text = String::from_utf8(bytes).unwrap().replace("uchar int vertex", "uchar uint vertex");
    let loaded = read(&[("a.ply", text.into_bytes())]);
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_shares(&loaded, &[(RED, 1.0)]);
}

/// Any order of elements is legal.
#[test]
fn faces_of_a_ply_may_come_before_its_vertices() {
    let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let usual = String::from_utf8(ply("", (colors, &|_| "200 40 40".to_owned()), none)).unwrap();
    let (header, body) = usual.split_once("end_header\n").unwrap();
    let (vertices, faces) = header.split_at(header.find("element face").unwrap());
    let (preamble, vertices) = vertices.split_at(vertices.find("element vertex").unwrap());
    let lines: Vec<&str> = body.lines().collect();
    let (points, polygons) = lines.split_at(8);
    let body = [polygons, points].concat().join("\n");
    let turned = format!("{preamble}{faces}{vertices}end_header\n{body}\n");
    let loaded = read(&[("a.ply", turned.into_bytes())]);
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_shares(&loaded, &[(RED, 1.0)]);
}

#[test]
fn several_textures_of_a_ply() {
    let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
    let files = |bytes: Vec<u8>| {
        read(&[("a.ply", bytes), ("red.png", png(1, &[opaque(RED)])), ("blue 2.png", png(1, &[opaque(BLUE)]))])
    };
    let header = "comment TextureFile red.png\ncomment texturefile blue 2.png\n";
    let names = "property list uchar float texcoord\nproperty int texnumber\n";
    let face = |i: usize| format!("8 0 0 1 0 1 1 0 1 {}", i % 2);
    assert_shares(&files(ply(header, none, (names, &face))), &[(RED, 0.5), (BLUE, 0.5)]);
    // A number below 0 is no texture.
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let some = |i: usize| format!("8 0 0 1 0 1 1 0 1 {}", i as i32 % 3 - 1);
    let loaded = files(ply(header, (colors, &|_| "30 150 60".to_owned()), (names, &some)));
    assert_shares(&loaded, &[(RED, 1.0 / 3.0), (BLUE, 1.0 / 3.0), (GREEN, 1.0 / 3.0)]);
    assert!(said(&loaded, "8 triangles with a texture are not used"), "{:?}", loaded.warnings);
    let white = files(ply(header, none, (names, &some)));
    assert!(said(&white, "4 triangles without a texture: white"), "{:?}", white.warnings);
    // No coordinates; no files; too high a number.
    let bare = files(ply(header, none, ("property int texnumber\n", &|_| "1".to_owned())));
    assert!(lost(&bare).contains("12 of 12 triangles with the texture of material `blue 2.png`"), "{}", lost(&bare));
    let untold =
        files(ply(header, none, ("property list uchar float texcoord\n", &|_| "8 0 0 1 0 1 1 0 1".to_owned())));
    assert!(lost(&untold).contains("which of 2 textures"), "{}", lost(&untold));
    let other =
        files(ply("element material 0\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n", none, none));
    assert!(lost(&other).contains("the element `material`"), "{}", lost(&other));
    let unnamed = files(ply("", none, (names, &face)));
    assert!(lost(&unnamed).contains("no comment names a TextureFile"));
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "a.ply", ply(header, none, (names, &|_| "8 0 0 1 0 1 1 0 1 2".to_owned())));
    let message = load(&path, &LoadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("texnumber 2") && message.contains("below 2"), "{message}");
}

/// A textured cube as glTF: positions in accessor 0, coordinates 1 (0 to 1 but for u from `u[0]` to `u[1]`), indices 2,
/// then `more`.
struct Gltf {
    json: Value,
    bin: Vec<u8>,
}

impl Gltf {
    fn new(u: [f32; 2]) -> Self {
        let mut made = Self {
            json: json!({
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
                "materials": [{"name": "m"}], "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}]
            }),
            bin: Vec::new(),
        };
        let corners: Vec<DVec3> = box_triangles(DVec3::ZERO, DVec3::ONE).concat();
        made.floats("VEC3", &corners.iter().flat_map(|p| p.to_array().map(|c| c as f32)).collect::<Vec<_>>());
        let [low, high] = u;
        let square = [[low, 0.0], [high, 0.0], [high, 1.0], [low, 0.0], [high, 1.0], [low, 1.0]];
        made.floats("VEC2", &square.concat().repeat(6));
        made
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        views.len() - 1
    }

    fn accessor(&mut self, component: u32, normalized: bool, kind: &str, bytes: &[u8], element: usize) -> usize {
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"bufferView": view, "componentType": component, "normalized": normalized, "type": kind,
            "count": bytes.len() / element, "min": [0, 0, 0], "max": [1, 1, 1]}));
        if kind != "VEC3" {
            accessors.last_mut().unwrap().as_object_mut().unwrap().retain(|key, _| key != "min" && key != "max");
        }
        accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let element = 4 * kind[3..].parse::<usize>().unwrap();
        self.accessor(5126, false, kind, &bytes, element)
    }

    /// An image as the texture of index 0.
    fn image(&mut self, bytes: &[u8]) {
        let view = self.view(bytes);
        self.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
        self.json["textures"] = json!([{"source": 0}]);
    }

    fn read(mut self) -> Loaded {
        self.json["buffers"][0]["byteLength"] = self.bin.len().into();
        read(&[("a.glb", glb_of(&self.json, &self.bin))])
    }
}

#[test]
fn colours_of_gltf_vertices() {
    let red = [0.57758_f32, 0.021_219, 0.021_219];
    let bytes = red.map(|c| (c * 255.0).round() as u8);
    let shorts = red.map(|c| (c * 65_535.0).round() as u16);
    let bytes_of = |c: Vec<u16>| c.into_iter().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let forms: [(u32, bool, &str, Vec<u8>, usize); 6] = [
        (5126, false, "VEC3", red.map(f32::to_le_bytes).concat(), 12),
        (5126, false, "VEC4", [red[0], red[1], red[2], 0.5].map(f32::to_le_bytes).concat(), 16),
        (5121, true, "VEC4", [bytes[0], bytes[1], bytes[2], 9].to_vec(), 4),
        (5123, true, "VEC4", bytes_of(vec![shorts[0], shorts[1], shorts[2], 9]), 8),
        // Integers are fractions, whether the file says so or not.
        (5121, false, "VEC4", [bytes[0], bytes[1], bytes[2], 9].to_vec(), 4),
        (5123, true, "VEC4", bytes_of(vec![shorts[0], shorts[1], shorts[2], u16::MAX]), 8),
    ];
    for (component, normalized, kind, one, element) in forms {
        let mut gltf = Gltf::new([0.0, 1.0]);
        let colors = gltf.accessor(component, normalized, kind, &one.repeat(36), element);
        gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colors.into();
        assert_shares(&gltf.read(), &[(RED, 1.0)]);
    }
    // Cut at 1 before they multiply anything.
    let mut gltf = Gltf::new([0.0, 1.0]);
    let bright = gltf.floats("VEC3", &[2.0, -1.0, 1.5].repeat(36));
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = bright.into();
    gltf.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [0.57758, 1, 0.021_219, 1]});
    assert_shares(&gltf.read(), &[([200, 0, 40], 1.0)]);
    // Times the factor and the texture: white becomes the colour, red and blue lose what it lacks.
    let mut gltf = Gltf::new([0.0, 1.0]);
    let color = gltf.floats("VEC3", &[0.5, 0.25, 1.0].repeat(36));
    gltf.image(&halves());
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = color.into();
    gltf.json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": {"index": 0}});
    let times = |rgb: [u8; 3]| {
        let factor = [0.25, 0.25, 1.0];
        [0, 1, 2].map(|c| byte(linear(f32::from(rgb[c]) / 255.0) * factor[c]))
    };
    assert_shares(&gltf.read(), &[(times(RED), 0.5), (times(BLUE), 0.5)]);
    // Two corners red, one blue, everywhere, on a material with a texture: interpolated and multiplied.
    let mut gltf = Gltf::new([0.0, 1.0]);
    gltf.image(&png(1, &[[255, 255, 255, 255]]));
    let corners = [red, red, [0.021_219, 0.021_219, 0.57758]].concat().repeat(12);
    let colors = gltf.floats("VEC3", &corners);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colors.into();
    gltf.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
    let found = shares(&gltf.read());
    assert!(found.len() > 8 && found.keys().all(|[r, g, b]| g.abs_diff(40) < 2 && (40..=201).contains(r) && *b > 39));
}

/// An accessor without a buffer view is all 0, but for what its sparse part says.
#[test]
fn accessors_without_bytes_are_zeros() {
    let mut gltf = Gltf::new([0.0, 1.0]);
    gltf.image(&halves());
    gltf.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
    gltf.json["accessors"][1] = json!({"componentType": 5126, "count": 36, "type": "VEC2"});
    let loaded = gltf.read();
    assert!(said(&loaded, "accessors without bytes, whose values are 0: 1"), "{:?}", loaded.warnings);
    assert_shares(&loaded, &[(RED, 1.0)]);
    // More values than used to be allowed.
    let count = 70_000;
    let mut gltf = Gltf::new([0.0, 1.0]);
    let padding = gltf.view(&vec![0; 3 * count]);
    let (at, red) = (gltf.view(&[5, 0, 0, 0]), gltf.view(&[1.0f32, 0.5, 0.25].map(f32::to_le_bytes).concat()));
    gltf.json["accessors"].as_array_mut().unwrap().push(json!({"componentType": 5126, "count": count, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": at, "componentType": 5125}, "values": {"bufferView": red}}}));
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2.into();
    let loaded = gltf.read();
    assert!(padding > 0 && loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    assert_eq!((loaded.mesh.corner_colors[1][2], loaded.mesh.corner_colors[0][0]), ([1.0, 0.5, 0.25], [0.0; 3]));
}

#[test]
fn specular_glossiness_says_the_colour() {
    for required in [false, true] {
        for textured in [false, true] {
            let mut gltf = Gltf::new([0.0, 1.0]);
            gltf.image(&halves());
            let name = "KHR_materials_pbrSpecularGlossiness";
            let factor = if textured { [1.0; 4] } else { [0.57758, 0.021_219, 0.021_219, 1.0] };
            let mut says = json!({"diffuseFactor": factor});
            if textured {
                says["diffuseTexture"] = json!({"index": 0});
            }
            gltf.json["materials"][0]["extensions"] = json!({name: says});
            gltf.json["extensionsUsed"] = json!([name]);
            if required {
                gltf.json["extensionsRequired"] = json!([name]);
            }
            let loaded = gltf.read();
            assert_eq!(loaded.warnings, Vec::<String>::new());
            let both: &[_] = if textured { &[(RED, 0.5), (BLUE, 0.5)] } else { &[(RED, 1.0)] };
            assert_shares(&loaded, both);
        }
    }
}

#[test]
fn textures_go_on_as_their_sampler_says() {
    for (wrap, u, expected) in [
        (10497, [1.05, 1.45], &[(RED, 1.0)][..]),
        (33648, [1.05, 1.45], &[(BLUE, 1.0)]),
        (33648, [-0.45, -0.05], &[(RED, 1.0)]),
        (33648, [2.05, 2.45], &[(RED, 1.0)]),
        (33071, [1.05, 7.0], &[(BLUE, 1.0)]),
        (33071, [-3.0, -0.1], &[(RED, 1.0)]),
        (33071, [0.0, 1.0], &[(RED, 0.5), (BLUE, 0.5)]),
    ] {
        let mut gltf = Gltf::new(u);
        gltf.image(&halves());
        gltf.json["samplers"] = json!([{"wrapS": wrap, "wrapT": wrap}]);
        gltf.json["textures"][0]["sampler"] = 0.into();
        gltf.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
        println!("{wrap} {u:?}");
        assert_shares(&gltf.read(), expected);
    }
}

#[test]
fn texels_that_are_cut_out_do_not_count() {
    let half = |alpha: u8| png(4, &[opaque(RED), opaque(RED), [0, 0, 0, alpha], [0, 0, 0, alpha]].repeat(4));
    for (mode, cutoff, alpha, cut) in [
        ("MASK", None, 127, true),
        ("MASK", None, 128, false),
        ("MASK", Some(0.9), 200, true),
        ("BLEND", None, 0, true),
        ("BLEND", None, 1, false),
        ("OPAQUE", None, 0, false),
    ] {
        let mut gltf = Gltf::new([0.0, 1.0]);
        gltf.image(&half(alpha));
        gltf.json["materials"][0] =
            json!({"name": "m", "alphaMode": mode, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        if let Some(cutoff) = cutoff {
            gltf.json["materials"][0]["alphaCutoff"] = json!(cutoff);
        }
        let loaded = gltf.read();
        assert_eq!(said(&loaded, "cuts 8 texels out"), cut, "{mode} {cutoff:?} {alpha}");
        let black: &[_] = if cut { &[(RED, 1.0)] } else { &[(RED, 0.5), ([0; 3], 0.5)] };
        assert_shares(&loaded, black);
    }
}

/// Alpha is the product of factor, texture and vertex colour.
#[test]
fn what_the_alpha_of_vertices_cuts_out_takes_the_colour_beside_it() {
    let (red, blue) = ([0.57758_f32, 0.021_219, 0.021_219], [0.021_219_f32, 0.021_219, 0.57758]);
    // Faces of the cube by fours of two triangles; the last three are blue.
    let read = |mode: &str, factor: f32, alphas: [f32; 2], picture: Option<Vec<u8>>| {
        let mut gltf = Gltf::new([0.0, 1.0]);
        let [kept, other] = [(red, alphas[0]), (blue, alphas[1])].map(|([r, g, b], alpha)| [r, g, b, alpha].repeat(18));
        let colors = gltf.floats("VEC4", &[kept, other].concat());
        gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colors.into();
        gltf.json["materials"][0] =
            json!({"name": "m", "alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, factor]}});
        if let Some(picture) = picture {
            gltf.image(&picture);
            gltf.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
        }
        gltf.read()
    };
    let white = || Some(png(1, &[[255; 4]]));
    let both: &[_] = &[(RED, 0.5), (BLUE, 0.5)];
    for picture in [None, white()] {
        for (mode, factor, alphas, shown) in [
            ("OPAQUE", 1.0, [1.0, 0.0], both),
            ("MASK", 1.0, [1.0, 0.49], &[(RED, 1.0)]),
            ("MASK", 1.0, [0.49, 1.0], &[(BLUE, 1.0)]),
            ("MASK", 1.0, [1.0, 0.51], both),
            ("MASK", 0.6, [1.0, 0.8], &[(RED, 1.0)]),
            ("MASK", 0.7, [1.0, 0.8], both),
            ("BLEND", 1.0, [1.0, 0.0], &[(RED, 1.0)]),
            ("BLEND", 1.0, [1.0, 0.01], both),
        ] {
            let loaded = read(mode, factor, alphas, picture.clone());
            println!("{mode} {factor} {alphas:?}");
            assert_shares(&loaded, shown);
            assert_eq!(said(&loaded, "cuts 18 corners out of material `m`"), shown.len() == 1, "{:?}", loaded.warnings);
            assert_eq!((lost(&loaded), loaded.warnings.len()), ("", 2 - shown.len()));
        }
    }
    // All of it: by vertices, by the product, by that with the texture; what is clear is printed.
    for (factor, alpha, picture, part) in [
        (1.0, 0.4, None, "cuts out all of it"),
        (0.6, 0.8, None, "cuts out all of it"),
        (0.8, 0.8, Some(png(1, &[[255, 255, 255, 190]])), "cuts out its whole texture"),
    ] {
        let loaded = read("MASK", factor, [alpha; 2], picture);
        assert!(lost(&loaded).contains(part) && loaded.warnings.len() == 1, "{:?}", loaded.warnings);
    }
    let unseen = png(1, &[[255, 255, 255, 0]]);
    for (factor, alpha, picture) in
        [(0.0, 1.0, None), (1.0, 0.0, None), (0.0, 1.0, white()), (1.0, 0.0, white()), (1.0, 1.0, Some(unseen))]
    {
        let clear = read("BLEND", factor, [alpha; 2], picture);
        assert_eq!(lost(&clear), "");
        assert!(said(&clear, "material `m` is wholly transparent") && clear.warnings.len() == 1);
        assert_shares(&clear, both);
    }
    // Corners that are placed twice are counted once.
    let mut twice = Gltf::new([0.0, 1.0]);
    let alphas = [[1.0_f32; 4].repeat(18), [1.0, 1.0, 1.0, 0.0].repeat(18)].concat();
    let colors = twice.floats("VEC4", &alphas);
    twice.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colors.into();
    twice.json["materials"][0]["alphaMode"] = "MASK".into();
    twice.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]);
    twice.json["scenes"][0]["nodes"] = json!([0, 1]);
    let twice = twice.read();
    assert!(twice.mesh.triangles.len() == 24 && said(&twice, "cuts 18 corners out"), "{:?}", twice.warnings);
    // Half of the texture where vertices take part.
    let half = png(2, &[opaque([255; 3]), [255, 255, 255, 200]]);
    let mixed = read("MASK", 1.0, [1.0, 0.6], Some(half.clone()));
    assert!(said(&mixed, "vertices and texture together") && mixed.warnings.len() == 1, "{:?}", mixed.warnings);
    // Vertices that are cut out by themselves take the others' colour, and no more is cut out of the texture.
    let apart = read("MASK", 1.0, [1.0, 0.0], Some(half));
    assert!(said(&apart, "cuts 18 corners out") && apart.warnings.len() == 1, "{:?}", apart.warnings);
    // A piece with nothing left beside it.
    let piece = |mode: &str| {
        let mut gltf = Gltf::new([0.0, 1.0]);
        let colors = gltf.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(36));
        let mut second = gltf.json["meshes"][0]["primitives"][0].clone();
        second["attributes"]["COLOR_0"] = colors.into();
        gltf.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
        gltf.json["materials"][0]["alphaMode"] = mode.into();
        gltf.read()
    };
    let masked = piece("MASK");
    assert!(lost(&masked).contains("whole pieces of material `m` out, 36 corners"), "{:?}", masked.warnings);
    let clear = piece("BLEND");
    assert!(
        lost(&clear).is_empty() && said(&clear, "whole pieces of material `m`, 36 corners, are wholly transparent")
    );
}

#[test]
fn gltf_colours_that_are_lost() {
    let textured = |change: &dyn Fn(&mut Gltf)| {
        let mut gltf = Gltf::new([0.0, 1.0]);
        gltf.image(&halves());
        gltf.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
        change(&mut gltf);
        gltf.read()
    };
    let bare = textured(&|gltf| {
        gltf.json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
    });
    assert!(lost(&bare).contains("12 of 12 triangles with the texture of material `m`"), "{}", lost(&bare));
    let other_set = textured(&|gltf| {
        gltf.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1.into();
    });
    assert!(lost(&other_set).contains("no texture coordinates"));
    // What default weights add to colours or coordinates; without weights nothing does.
    for (name, weights, shown) in [("COLOR_0", [0.5], true), ("TEXCOORD_0", [0.5], true), ("COLOR_0", [0.0], false)] {
        let morphed = textured(&|gltf| {
            let values = gltf.floats("VEC3", &[0.1; 108]);
            let mesh = &mut gltf.json["meshes"][0];
            mesh["primitives"][0]["targets"] = json!([{name: values}]);
            mesh["weights"] = json!(weights);
        });
        assert_eq!(lost(&morphed).contains(&format!("the {name} of morph targets")), shown, "{}", lost(&morphed));
    }
    // Weights count for the targets that they stand beside: those of the mesh, unless its node has others.
    for (weights, node, shown) in [
        ([0.5, 0.0], json!(null), ""),
        ([0.0, 0.5], json!(null), "the COLOR_0 of morph targets"),
        ([0.0, 0.5], json!([0.0, 0.0]), ""),
        ([0.0, 0.0], json!([0.0, 0.5]), "the COLOR_0 of morph targets"),
    ] {
        let morphed = textured(&|gltf| {
            let values = gltf.floats("VEC3", &[0.0; 108]);
            let colored = json!([{"POSITION": values}, {"COLOR_0": values}]);
            gltf.json["meshes"][0]["primitives"][0]["targets"] = colored.clone();
            gltf.json["meshes"][0]["weights"] = json!(weights);
            // Another mesh has the same targets, and nothing shows them.
            let mut other = gltf.json["meshes"][0].clone();
            other["weights"] = json!([0.0, 0.0]);
            gltf.json["meshes"].as_array_mut().unwrap().push(other);
            gltf.json["nodes"] = json!([{"mesh": 0}, {"mesh": 1, "translation": [3, 0, 0]}]);
            gltf.json["scenes"][0]["nodes"] = json!([0, 1]);
            if !node.is_null() {
                gltf.json["nodes"][0]["weights"] = node.clone();
            }
        });
        assert!(lost(&morphed).contains(shown) && lost(&morphed).is_empty() == shown.is_empty(), "{}", lost(&morphed));
    }
    let dormant = textured(&|gltf| {
        let values = gltf.floats("VEC3", &[0.0; 108]);
        let mut other = gltf.json["meshes"][0].clone();
        gltf.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": values}]);
        gltf.json["meshes"][0]["weights"] = json!([0.5]);
        other["primitives"][0]["targets"] = json!([{"COLOR_0": values}]);
        gltf.json["meshes"].as_array_mut().unwrap().push(other);
        gltf.json["nodes"] = json!([{"mesh": 0}, {"mesh": 1, "translation": [3, 0, 0]}]);
        gltf.json["scenes"][0]["nodes"] = json!([0, 1]);
    });
    assert_eq!(lost(&dormant), "");
    let codec =
        textured(&|gltf| gltf.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}));
    assert!(lost(&codec).contains("a codec other than PNG and JPEG"));
    let old = textured(&|gltf| gltf.json["materials"][0]["extensions"] = json!({"KHR_materials_common": {}}));
    assert!(lost(&old).contains("KHR_materials_common"));
    let white = textured(&|gltf| {
        gltf.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    });
    assert!(said(&white, "1 primitive without a material: white"), "{:?}", white.warnings);
    let second = textured(&|gltf| {
        let colors = gltf.floats("VEC3", &[1.0; 108]);
        gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_1"] = colors.into();
    });
    assert!(lost(&second).contains("other sets than COLOR_0"), "{}", lost(&second));
    // The image of another material is not missed.
    let unused = textured(&|gltf| gltf.json["images"].as_array_mut().unwrap().push(json!({"uri": "none.png"})));
    assert!(lost(&unused).is_empty() && unused.warnings.is_empty());
    let other = textured(&|gltf| {
        let texture = json!({"baseColorTexture": {"index": 1}});
        gltf.json["images"].as_array_mut().unwrap().push(json!({"uri": "none.png"}));
        gltf.json["textures"].as_array_mut().unwrap().push(json!({"source": 1}));
        gltf.json["materials"].as_array_mut().unwrap().push(json!({"pbrMetallicRoughness": texture}));
    });
    assert!(lost(&other).is_empty() && other.warnings.is_empty());
}

/// A cube as 3MF: resources before the object, attributes of the object and of every triangle.
fn threemf(resources: &str, object: &str, triangle: &str) -> Loaded {
    let vertices: String = POINTS.iter().map(|[x, y, z]| format!("<vertex x='{x}' y='{y}' z='{z}'/>")).collect();
    let triangles: String = FACES
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|t| t.map(|p| p - 1))
        .map(|[a, b, c]| format!("<triangle v1='{a}' v2='{b}' v3='{c}' {triangle}/>"))
        .collect();
    let model = format!(
        "<model xmlns:m='http://schemas.microsoft.com/3dmanufacturing/material/2015/02'><resources>{resources}\
         <object id='1' {object}><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>\
         </object></resources><build><item objectid='1'/></build></model>"
    );
    let package = threemf_parts(&[
        ("_rels/.rels", rels("3D/3dmodel.model").into_bytes()),
        ("3D/3dmodel.model", model.into_bytes()),
        ("3D/Textures/t.png", halves()),
    ]);
    read(&[("a.3mf", package)])
}

const GROUP: &str = "<m:colorgroup id='5'><m:color color='#C82828'/><m:color color='#2828C8'/></m:colorgroup>";

#[test]
fn colour_groups_are_interpolated() {
    for (object, triangle) in [
        ("", "pid='5' p1='0' p2='0' p3='0'"),
        ("", "pid='5' p1='0'"),
        ("pid='5' pindex='0'", ""),
        ("pid='5'", "p1='0'"),
        ("pid='5' pindex='1'", "p1='0'"),
    ] {
        let loaded = threemf(GROUP, object, triangle);
        assert_eq!((lost(&loaded), loaded.warnings.len()), ("", 0));
        assert_shares(&loaded, &[(RED, 1.0)]);
    }
    let loaded = threemf(GROUP, "", "pid='5' p1='0' p2='1' p3='1'");
    assert!(loaded.mesh.corner_colors.len() == 12 && lost(&loaded).is_empty());
    let found = shares(&loaded);
    assert!(found.len() > 6 && found.keys().all(|[r, g, b]| g.abs_diff(40) < 2 && *r >= 40 && *b >= 40), "{found:?}");
    // More colours than materials may be.
    let many: String = (0..70_000).map(|i| format!("<m:color color='#{i:06X}'/>")).collect();
    let loaded = threemf(&format!("<m:colorgroup id='5'>{many}</m:colorgroup>"), "", "pid='5' p1='69999'");
    assert_shares(&loaded, &[([0x01, 0x11, 0x6f], 1.0)]);
}

#[test]
fn tile_styles() {
    for (style, u, expected) in [
        ("", [1.05, 1.45], RED),
        ("tilestyleu='wrap'", [1.05, 1.45], RED),
        ("tilestyleu='mirror' tilestylev='wrap'", [1.05, 1.45], BLUE),
        ("tilestyleu='clamp'", [1.05, 1.45], BLUE),
        ("tilestyleu='none'", [0.0, 0.45], RED),
    ] {
        for path in ["/3D/Textures/t.png", "3D/Textures/t.png", "Textures/T.PNG"] {
            let resources = format!(
                "<m:texture2d id='9' path='{path}' contenttype='image/png' {style}/><m:texture2dgroup id='10' \
                    texid='9'>\
                 <m:tex2coord u='{}' v='0'/><m:tex2coord u='{}' v='0'/><m:tex2coord u='{}' v='1'/></m:texture2dgroup>",
                u[0], u[1], u[1]
            );
            let loaded = threemf(&resources, "", "pid='10' p1='0' p2='1' p3='2'");
            assert_eq!(lost(&loaded), "", "{style} {path}");
            assert_shares(&loaded, &[(expected, 1.0)]);
        }
    }
}

#[test]
fn threemf_colours_that_are_lost() {
    let ends = "<m:texture2d id='9' path='/3D/Textures/t.png' contenttype='image/png' tilestylev='none'/>\
                <m:texture2dgroup id='10' texid='9'><m:tex2coord u='0' v='2'/></m:texture2dgroup>";
    let multi = format!("{GROUP}<m:multiproperties id='8' pids='5'><m:multi pindices='1'/></m:multiproperties>");
    let composite =
        "<m:compositematerials id='8' matid='5' matindices='0 1'><m:composite values='1 0'/></m:compositematerials>";
    for (resources, object, triangle, part) in [
        (multi.as_str(), "pid='8' pindex='0'", "", "multi-properties (property group 8"),
        (composite, "", "pid='8' p1='0'", "composite materials (property group 8"),
        ("", "pid='8' pindex='0'", "", "property group 8 of /3D/3dmodel.model, which is nowhere defined"),
        (GROUP, "pid='5' pindex='0'", "slic3rpe:mmu_segmentation='4'", "mmu_segmentation"),
        ("", "", "paint_color='8'", "paint_color"),
        (ends, "", "pid='10' p1='0'", "tile style none"),
    ] {
        let loaded = threemf(resources, object, triangle);
        assert!(lost(&loaded).contains(part), "{part}: {}", lost(&loaded));
    }
    // Defined and not used, or empty, they do not matter; without any colour there is none.
    assert_eq!(lost(&threemf(&multi, "pid='5' pindex='0'", "paint_color=''")), "");
    let bare = threemf("", "", "paint_supports='4'");
    assert!(bare.mesh.materials.is_empty() && lost(&bare).is_empty());
}

#[test]
fn concave_polygons_have_their_area_and_their_texture() {
    // An arrowhead of area 2 × 1 / 2 … drawn from a corner that does not see all of it, in each format with polygons.
    let rim = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [3.0, 1.0]];
    let area: f64 = 4.0;
    let prism = |z: f32| rim.map(|[x, y]| format!("{x} {y} {z}"));
    let points: Vec<String> = [prism(0.0), prism(1.0)].concat();
    let faces =
        [vec![3, 2, 1, 0], vec![4, 5, 6, 7], vec![0, 1, 5, 4], vec![1, 2, 6, 5], vec![2, 3, 7, 6], vec![3, 0, 4, 7]];
    let mut obj: String = points.iter().map(|p| format!("v {p}\nvt {}\n", p.rsplit_once(' ').unwrap().0)).collect();
    let mut ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty \
            float s\n\
         property float t\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n{}",
        points.iter().map(|p| format!("{p} {}\n", p.rsplit_once(' ').unwrap().0)).collect::<String>()
    );
    for face in &faces {
        obj += &format!("f {}\n", face.iter().map(|p| format!("{0}/{0}", p + 1)).collect::<Vec<_>>().join(" "));
        ply += &format!("{} {}\n", face.len(), face.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "));
    }
    for (name, text) in [("a.obj", obj), ("a.ply", ply)] {
        let loaded = read(&[(name, text.into_bytes())]);
        for (triangle, uvs) in loaded.mesh.triangles.iter().zip(&loaded.mesh.uvs) {
            for (&v, uv) in triangle.iter().zip(uvs) {
                let p = loaded.mesh.positions[v as usize];
                assert_eq!(*uv, Vec2::new(p.x as f32, 1.0 - p.y as f32));
            }
        }
        let health = close(loaded.mesh).unwrap().health;
        let sides: f64 = (0..4)
            .map(|i| {
                DVec3::from([rim[i][0], rim[i][1], 0.0].map(f64::from))
                    .distance(DVec3::from([rim[(i + 1) % 4][0], rim[(i + 1) % 4][1], 0.0].map(f64::from)))
            })
            .sum();
        assert!((health.area_mm2 - 2.0 * area - sides).abs() < 1e-9, "{name}: {}", health.area_mm2);
        assert!((health.volume_mm3 - area).abs() < 1e-9 && health.flipped_triangles == 0, "{name}");
    }
}

/// What passes below the surface goes into the albedo, by texel: the cup of DiffuseTransmissionTeacup, whose texture
/// has the share that passes in its alpha, here 0 on the left and 51 of 255 on the right.
#[test]
fn light_that_passes_through_is_part_of_the_albedo() {
    let mut gltf = Gltf::new([0.0, 1.0]);
    gltf.image(&png(4, &[[9, 9, 9, 0], [9, 9, 9, 0], [9, 9, 9, 51], [9, 9, 9, 51]].repeat(4)));
    let name = "KHR_materials_diffuse_transmission";
    gltf.json["extensionsUsed"] = json!([name]);
    gltf.json["extensionsRequired"] = json!([name]);
    gltf.json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]},
        "extensions": {name: {
            "diffuseTransmissionFactor": 1.0,
            "diffuseTransmissionTexture": {"index": 0},
            "diffuseTransmissionColorFactor": [0.84, 0.8, 0.74],
        }},
    });
    let loaded = gltf.read();
    assert_eq!(loaded.warnings, Vec::<String>::new());
    let right = [0.84_f32, 0.8, 0.74].map(|colour| byte(0.8 * 0.5 + 0.2 * colour));
    assert_shares(&loaded, &[([byte(0.5); 3], 0.5), (right, 0.5)]);
    assert_eq!(loaded.mesh.materials[0].mean_free_path_mm, None);
}

/// Distances are metres, and grow and shrink with the mesh.
#[test]
fn a_mean_free_path_has_the_size_of_its_mesh() {
    let mut gltf = Gltf::new([0.0, 1.0]);
    gltf.json["materials"][0] = json!({
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {
                "thicknessFactor": 1.0, "attenuationDistance": 0.5, "attenuationColor": [0.5, 0.25, 0.125],
            },
            "KHR_materials_volume_scatter": {"multiscatterColor": [0.2, 0.4, 0.6]},
        },
    });
    let loaded = gltf.read();
    let material = &loaded.mesh.materials[0];
    let found = material.base_color[..3].iter().zip([0.2, 0.4, 0.6]).all(|(found, rho)| (found - rho).abs() < 1e-6);
    assert!(found, "{:?}", material.base_color);
    // −0.5 m/ln ½, half of it, a third of it.
    let whole = 500.0 / std::f64::consts::LN_2;
    let is = |path: Option<[f64; 3]>, scale: f64| {
        let expected = [whole, whole / 2.0, whole / 3.0].map(|mm| mm * scale);
        assert!(path.unwrap().iter().zip(expected).all(|(found, mm)| (found / mm - 1.0).abs() < 1e-12), "{path:?}");
    };
    is(material.mean_free_path_mm, 1.0);
    let smaller = Placement { size: Size::Scale(-0.04), ..Placement::default() };
    is(place(loaded.mesh, &smaller).unwrap().0.materials[0].mean_free_path_mm, 0.04);
}

/// One value a little beyond 1 is rounding, or light; it turns no fractions into bytes.
#[test]
fn values_beyond_1_do_not_make_bytes_of_fractions() {
    let named = "property float red\nproperty float green\nproperty float blue\n";
    for beyond in ["1.000001", "1.5", "3", "10"] {
        // Seven corners red, one red beyond its full value.
        let behind =
            |i: usize| if i == 6 { format!("{beyond} 0.156863 0.156863") } else { "1 0.156863 0.156863".into() };
        let expected = [([255, 40, 40], 1.0)];
        assert_shares(&read(&[("a.obj", obj("", behind, None)), ("a.mtl", Vec::new())]), &expected);
        let none = ("", &(|_| String::new()) as &dyn Fn(usize) -> String);
        assert_shares(&read(&[("a.ply", ply("", (named, &behind), none))]), &expected);
    }
    for bytes in ["200 40 40", "200.5 40.25 40", "200 1 0"] {
        let loaded = read(&[("a.obj", obj("", |_| bytes.to_owned(), None)), ("a.mtl", Vec::new())]);
        let (red, share) = shares(&loaded).into_iter().next().unwrap();
        assert!((200..202).contains(&red[0]) && red[1] < 41 && share > 0.99, "{red:?}");
    }
}

/// A colour that stands where none is read is said to be lost; a shade of what has a colour of its own is not.
#[test]
fn colours_in_other_places_are_said_to_be_lost() {
    for (mtl, part) in [
        ("Kd 0 0 0\nKe 1 0 0", "`m` (Ke)"),
        ("Kd 0 0 0\nmap_Ke half.png", "`m` (map_Ke)"),
        ("Kd 1 1 1\nKa 1 0 0\nmap_Ka half.png", "`m` (map_Ka)"),
        ("Kd 0.5 0.2 0.2\nKe 1 0 0\nmap_Ka half.png", ""),
        ("Kd 1 1 1\nmap_Kd half.png\nmap_Ke half.png", ""),
        ("Kd 0 0 0\nKe 0 0 0", ""),
    ] {
        let loaded = plain_obj(&format!("newmtl m\n{mtl}\n"), Some(WHOLE));
        assert!(
            lost(&loaded).contains(part) && lost(&loaded).is_empty() == part.is_empty(),
            "{mtl}: {}",
            lost(&loaded)
        );
    }
    let glow = |base: Value, factor: [f64; 3], textured: bool| {
        let mut gltf = Gltf::new([0.0, 1.0]);
        gltf.image(&halves());
        gltf.json["materials"][0]["pbrMetallicRoughness"] = base;
        gltf.json["materials"][0]["emissiveFactor"] = json!(factor);
        if textured {
            gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
        }
        lost(&gltf.read()).to_owned()
    };
    let black = json!({"baseColorFactor": [0, 0, 0, 1]});
    for (base, factor, textured, is_lost) in [
        (black.clone(), [1.0; 3], true, true),
        (json!({}), [1.0; 3], true, true),
        (black.clone(), [1.0, 0.0, 0.0], false, true),
        (json!({}), [1.0; 3], false, false),
        (black, [0.0; 3], true, false),
        (json!({"baseColorFactor": [0.5, 0, 0, 1]}), [1.0; 3], true, false),
        (json!({"baseColorTexture": {"index": 0}}), [1.0; 3], true, false),
    ] {
        let lost = glow(base.clone(), factor, textured);
        assert_eq!(
            lost.contains("what glows") && lost.contains("`m`"),
            is_lost,
            "{base} {factor:?} {textured}: {lost}"
        );
    }
    let mut gltf = Gltf::new([0.0, 1.0]);
    let colors = gltf.floats("VEC3", &[1.0, 0.0, 0.0]);
    gltf.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": colors, "_COLOR_0": colors}}});
    assert!(lost(&gltf.read()).contains("_COLOR_0"));
}

#[test]
fn colours_of_volumes_are_said_to_be_lost() {
    let loaded = threemf(
        "<v:volumedata xmlns:v='http://schemas.microsoft.com/3dmanufacturing/volumetric/2022/01' id='9'/>",
        "",
        "",
    );
    assert!(said(&loaded, "volumetric data"), "{:?}", loaded.warnings);
}
