//! Colours of PLY: vertices, faces, textures named in comments.

use lumislice::mesh::{LoadOptions, close, load};

use super::{
    super::{painted::assert_shares, writers::put},
    BLUE, FACES, GREEN, POINTS, RED, lost, opaque, png, read, said,
};

/// A cube as PLY text: types and values of vertices and faces besides the usual, and lines for the header.
pub(super) fn ply(
    header: &str,
    vertex: (&str, &dyn Fn(usize) -> String),
    face: (&str, &dyn Fn(usize) -> String),
) -> Vec<u8> {
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

/// Numbers of eight bytes: colours, and properties to be stepped over.
#[test]
fn ply_of_whole_numbers_in_eight_bytes() {
    for (format, little) in [("binary_little_endian", true), ("binary_big_endian", false)] {
        let number = |value: u64| if little { value.to_le_bytes() } else { value.to_be_bytes() };
        let float = |value: u8| if little { f32::from(value).to_le_bytes() } else { f32::from(value).to_be_bytes() };
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
             property int64 label\nproperty uint64 red\nproperty uint64 green\nproperty uint64 blue\nelement face 6\n\
             property list uchar uint64 vertex_indices\nend_header\n"
        )
        .into_bytes();
        for point in POINTS {
            bytes.extend(point.into_iter().flat_map(float));
            bytes.extend([u64::MAX, 200, 40, 40].into_iter().flat_map(number));
        }
        for face in FACES {
            bytes.push(4);
            bytes.extend(face.into_iter().flat_map(|p| number(p as u64 - 1)));
        }
        let loaded = read(&[("a.ply", bytes)]);
        assert_shares(&loaded, &[(RED, 1.0)]);
        assert!((close(loaded.mesh).unwrap().health.volume_mm3 - 1.0).abs() < 1e-9);
    }
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
