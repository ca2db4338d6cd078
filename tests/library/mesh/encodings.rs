//! The same mesh however its text is written: marks, line ends, comments, keywords, part names.

use glam::DVec3;
use lumislice::mesh::{LoadOptions, Loaded, close, load};

use super::shapes::box_triangles;
use super::writers::{self, put, sample, threemf_of};

const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn read(name: &str, bytes: impl AsRef<[u8]>) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    load(&put(folder.path(), name, bytes), &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn volume(loaded: Loaded) -> f64 {
    close(loaded.mesh).unwrap().health.volume_mm3
}

/// A text in each way that editors save it.
fn saved(text: &str) -> Vec<Vec<u8>> {
    let units: Vec<u16> = text.encode_utf16().collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    vec![
        text.into(),
        [b"\xef\xbb\xbf", text.as_bytes()].concat(),
        [&[0xff, 0xfe], &little[..]].concat(),
        [&[0xfe, 0xff], &big[..]].concat(),
        little,
        big,
        text.replace("\r\n", "\n").replace('\n', "\r\n").into(),
        text.replace("\r\n", "\n").replace('\n', "\r").into(),
    ]
}

#[test]
fn obj() {
    for bytes in saved(CUBE) {
        assert_eq!(volume(read("a.obj", bytes)), 1.0);
    }
    let commented = CUBE.replace('\n', " # x / 7 \\\n");
    for text in [
        format!("# from C:\\models\\\n{CUBE}"),
        commented.clone(),
        CUBE.replace("f 1 4", "f 1 \\\n4").to_uppercase(),
        CUBE.replace("v 0 0 0", "v 0 0 0#near"),
    ] {
        let loaded = read("a.obj", &text);
        assert_eq!(loaded.warnings, Vec::<String>::new());
        assert_eq!(volume(loaded), 1.0, "{text}");
    }
}

#[test]
fn obj_and_mtl_together() {
    let sample = sample();
    for (obj, mtl) in saved(&writers::obj(&sample)).into_iter().zip(saved(writers::MTL)) {
        let folder = tempfile::tempdir().unwrap();
        put(folder.path(), "paint job.mtl", mtl);
        put(folder.path(), "paint.png", writers::png(&sample));
        let loaded = load(&put(folder.path(), "a.obj", obj), &LoadOptions::default()).unwrap();
        assert_eq!((loaded.warnings.len(), loaded.lost_color), (0, None));
        assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0]);
        assert!(loaded.mesh.materials[0].base_color_texture.is_some());
    }
}

#[test]
fn names_may_hold_a_hash_and_data_may_be_commented() {
    for (definition, used) in
        [("red # the door", "red"), ("red", "red # the door"), ("red #1", "red #1"), ("r#d", "r#d")]
    {
        let folder = tempfile::tempdir().unwrap();
        put(folder.path(), "a#1.mtl", format!("NewMtl {definition}\n\tKD 0.5 0.25 1 # blue\n"));
        let text = format!("mtllib a#1.mtl # colours\nusemtl {used}\n{CUBE}");
        let loaded = load(&put(folder.path(), "a.obj", text), &LoadOptions::default()).unwrap();
        assert_eq!(loaded.lost_color, None, "{definition} {used}");
        assert_eq!(loaded.mesh.materials[0].base_color, [0.5, 0.25, 1.0, 1.0], "{definition} {used}");
    }
}

/// Names in an encoding of old that differ in what is no UTF-8 only.
#[test]
fn names_in_latin_1_stay_apart() {
    let folder = tempfile::tempdir().unwrap();
    put(folder.path(), "a.mtl", b"newmtl gr\xfcn\nKd 0.25 0.5 1\nnewmtl gr\xf6n\nKd 1 0 0\n");
    let text = [b"mtllib a.mtl\nusemtl gr\xfcn\n", CUBE.as_bytes()].concat();
    let loaded = load(&put(folder.path(), "a.obj", text), &LoadOptions::default()).unwrap();
    assert_eq!(loaded.lost_color, None);
    let used = &loaded.mesh.materials[loaded.mesh.material_of[0] as usize];
    assert_eq!((used.name.as_str(), used.base_color), ("grün", [0.25, 0.5, 1.0, 1.0]));
}

/// UTF-16 that holds half a character is refused with its place, in every text format.
#[test]
fn half_a_character_is_refused() {
    let broken = |text: &str, at: usize| {
        let mut bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        bytes[2 * at..2 * at + 2].copy_from_slice(&0xd83d_u16.to_le_bytes());
        bytes
    };
    let stl = writers::stl_text(&sample());
    for (name, bytes, at) in [
        ("a.obj", broken(CUBE, 20), 40),
        ("a.stl", broken(&stl, stl.len() - 9), 2 * (stl.len() - 9)),
        ("a.ply", broken("ply\nformat ascii 1.0\ncomment x\n", 28), 56),
        ("a.gltf", broken("{\"asset\": {\"version\": \"2.0\"}}", 5), 10),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let error = load(&put(folder.path(), name, bytes), &LoadOptions::default()).unwrap_err().to_string();
        assert!(error.contains(&format!("byte {at}: found half a character of UTF-16")), "{name}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    put(folder.path(), "a.mtl", broken("newmtl a\nKd 0.5 0.5 0.5\n", 7));
    let loaded = load(&put(folder.path(), "a.obj", format!("mtllib a.mtl\nusemtl a\n{CUBE}")), &LoadOptions::default());
    let lost = loaded.unwrap().lost_color.unwrap();
    assert!(lost.contains("(half a character of UTF-16 at offset 14)"), "{lost}");
}

/// Coordinates in double precision as Fortran writes them.
fn with_exponents_of_fortran(text: &str) -> String {
    let word = |word: &str| match word.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => word.replace(word.trim(), &format!("{value:e}").replace('e', "D+")),
        _ => word.to_owned(),
    };
    text.split_inclusive(char::is_whitespace).map(word).collect::<String>().replace("D+-", "D-")
}

#[test]
fn stl_by_words() {
    let text = writers::stl_text(&sample());
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut texts = saved(&text);
    texts.extend(
        [
            words(&text),
            text.replace("endsolid", "end solid").replace("endfacet", "End Facet"),
            text.replace("endsolid part 1\n", ""),
            text.to_uppercase().replace("NAN", "nan"),
            text.replace("part 0", "facet of a \u{e9}toile, endsolid? no"),
            text.replace("solid part 0", "solid"),
            text.replace("facet normal nan 0 0", "facet normal -nan(ind) 1.#QNAN 0 # sic"),
            text.replace("facet normal nan 0 0", "facet"),
            format!("# a comment\n\n  {text}\0\0\0\x1a"),
            text.split_once('\n').unwrap().1.to_owned(),
            text.replace("outer loop", "outerloop"),
            text.replace("facet normal", "FacetNormal").replace("outer loop", "OUTERLOOP"),
            text.replace("facet normal nan 0 0", "facetnormal").replace("outer loop", "outerloop"),
            text.replace("outer loop", "").replace("endloop", ""),
            text.replacen("endfacet", "", 5),
            text.replace("part 0", "facet normal to the bed"),
            with_exponents_of_fortran(&text),
        ]
        .map(String::into_bytes),
    );
    for bytes in texts {
        let shown = String::from_utf8_lossy(&bytes[..80]).into_owned();
        let loaded = read("a.stl", &bytes);
        assert_eq!(loaded.mesh.triangles.len(), 12, "{shown}");
        assert_eq!(volume(loaded), 24.0, "{shown}");
    }
}

#[test]
fn binary_stl_whatever_its_header_says() {
    let good = writers::stl_binary(&sample());
    for header in ["solid facet normal vertex endsolid", "solid\nfacet normal 0 0 1", "\u{feff}solid", ""] {
        for (count, tail) in [(12u32, 0), (12, 7), (0, 0)] {
            let mut bytes = good.clone();
            bytes[..80].fill(b' ');
            bytes[..header.len()].copy_from_slice(header.as_bytes());
            bytes[80..84].copy_from_slice(&count.to_le_bytes());
            bytes.resize(bytes.len() + tail, 1);
            let loaded = read("a.stl", &bytes);
            assert_eq!(loaded.warnings.len(), usize::from(count == 0 || tail > 0), "{header} {count} {tail}");
            assert_eq!(volume(loaded), 24.0, "{header} {count} {tail}");
        }
    }
    // Colours that two programs keep there: in the header and, by faces, in the last two bytes.
    let kept: [(&[u8], u16, &str); 7] = [
        (b"COLOR=\xc8\x28\x28\xff,MATERIAL=", 0x8000, "Magics"),
        (b"by Magics COLOR=\xff\xff\xff\xff", 0x001f, "Magics"),
        (b"COLOR=\xff\xff\xff\xff", 0x7fff, ""),
        (b"COLOR=\xff\xff\xff\xff", 0xffff, ""),
        (b"VisCAM", 0xfc00, "VisCAM"),
        (b"", 0xffff, ""),
        (b"", 0x7c00, ""),
    ];
    for (header, attribute, whose) in kept {
        let mut bytes = good.clone();
        bytes[..80].fill(b' ');
        bytes[..header.len()].copy_from_slice(header);
        bytes[84..].chunks_exact_mut(50).for_each(|record| record[48..].copy_from_slice(&attribute.to_le_bytes()));
        let loaded = read("a.stl", &bytes);
        let said = loaded.lost_color.clone().unwrap_or_default();
        assert!(said.contains(whose) && said.is_empty() == whose.is_empty(), "{header:?} {attribute:x}: {said}");
        assert_eq!(volume(loaded), 24.0);
    }
    // Too low a count, and what was filled up with zeros.
    let with = |count: u32, tail: usize| {
        let mut bytes = good.clone();
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        bytes.resize(bytes.len() + tail, 0);
        read("a.stl", bytes)
    };
    for count in [1, 10, 11] {
        let loaded = with(count, 0);
        assert_eq!(loaded.mesh.triangles.len(), 12, "{count}");
        assert!(loaded.warnings[0].contains(&format!("the header counts {count} triangle")), "{:?}", loaded.warnings);
    }
    let filled = with(12, 100);
    assert_eq!((filled.mesh.triangles.len(), filled.mesh.positions.len()), (12, 8));
    assert!(filled.warnings[0].contains("100 bytes after the last triangle"), "{:?}", filled.warnings);
    let signed = read("a.stl", [&good[..], b"Exported with a program that signs what it writes."].concat());
    assert_eq!((signed.mesh.triangles.len(), signed.mesh.positions.len()), (12, 8));
    assert!(signed.warnings[0].contains("50 bytes after the last triangle"), "{:?}", signed.warnings);
}

#[test]
fn ply_as_text_and_with_lone_returns() {
    let cube = box_triangles(DVec3::ZERO, DVec3::ONE);
    let points: String = cube.iter().flatten().map(|p| format!("{} {} {} # x 9\n", p.x, p.y, p.z)).collect();
    let faces: String = (0..12).map(|t| format!("3 {} {} {}\n", 3 * t, 3 * t + 1, 3 * t + 2)).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 36\nproperty float x\nproperty float y\nproperty float z\nelement face \
            12\n\
         property list uchar int vertex_indices\nend_header\n# points\n{points}{faces}"
    );
    for bytes in saved(&text) {
        assert_eq!(volume(read("a.ply", bytes)), 1.0);
    }
    // What a C library writes where there is no number, in a property that is not asked for.
    let junk =
        text.replace("property float z", "property float z\nproperty float nx").replace(" # x", " -nan(ind) # x");
    assert_eq!(volume(read("a.ply", junk)), 1.0);
    // A body that begins with a line feed's byte, after lone returns.
    let header = "ply\rformat binary_little_endian 1.0\relement vertex 3\rproperty float x\rproperty float y\r\
                  property float z\relement face 1\rproperty list uchar int vertex_indices\rend_header\r";
    let mut bytes = header.as_bytes().to_vec();
    let first = f32::from_le_bytes([b'\n', 0, 0, 0x40]);
    for c in [first, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(c.to_le_bytes());
    }
    bytes.push(3);
    bytes.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    assert_eq!(read("a.ply", &bytes).mesh.positions[0].x, f64::from(first));
}

#[test]
fn triangle_strips_of_a_ply() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n0 1 0\n1 1 0\n9 0 1 2 3 -1 0 2 1 -1\n";
    let loaded = read("a.ply", text);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [2, 1, 3], [0, 2, 1]]);
}

#[test]
fn gltf_with_a_mark() {
    let json = "{\"asset\": {\"version\": \"2.0\"}, \"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": \
        0}}]}], \
                \"accessors\": [{\"bufferView\": 0, \"componentType\": 5126, \"count\": 3, \"type\": \"VEC3\", \
                \"min\": [0, 0, 0], \"max\": [1, 1, 0]}], \"bufferViews\": [{\"buffer\": 0, \"byteLength\": 36}], \
                \"buffers\": [{\"byteLength\": 36, \"uri\": \
                \"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]}";
    for bytes in saved(json) {
        assert_eq!(read("a.gltf", bytes).mesh.triangles.len(), 1);
    }
}

#[test]
fn threemf_parts_in_any_case_and_utf_16() {
    let model = writers::threemf_model(&sample());
    for bytes in saved(&model) {
        let renamed = [
            ("_rels/.rels", "_RELS/.Rels", "/3D/3dmodel.model"),
            ("3D/3dmodel.model", "3d/3DModel.MODEL", "3D/3dmodel.model"),
            ("3D/Textures/paint.png", "3D\\textures\\Paint.png", "./x/../3D/3dmodel%2Emodel"),
        ];
        for (from, to, target) in renamed {
            let package = writers::threemf_parts(
                &[
                    ("_rels/.rels", writers::rels(target).into_bytes()),
                    ("3D/3dmodel.model", bytes.clone()),
                    ("3D/Textures/paint.png", writers::png(&sample())),
                ]
                .map(|(name, bytes)| (if name == from { to } else { name }, bytes)),
            );
            let loaded = read("a.3mf", package);
            assert_eq!((loaded.warnings.len(), loaded.lost_color.clone()), (0, None), "{to}");
            assert!((volume(loaded) - 24.0).abs() < 1e-9);
        }
    }
    assert_eq!(read("a.3mf", threemf_of(&model, &writers::png(&sample()))).warnings.len(), 0);
}
