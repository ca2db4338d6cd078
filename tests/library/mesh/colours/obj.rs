//! Colours of OBJ: materials in an MTL, vertices.

use lumislice::mesh::Loaded;

use super::{
    super::painted::{assert_shares, shares},
    BLUE, FACES, POINTS, RED, halves, lost, opaque, png, read, said,
};

/// A cube as OBJ, with something behind each `v`, and the whole picture, or this part of it, on every face.
pub(super) fn obj(head: &str, behind: impl Fn(usize) -> String, uvs: Option<[[f32; 2]; 4]>) -> Vec<u8> {
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

/// Texels that cannot be seen have a colour that nobody meant: black, mostly.
#[test]
fn texels_of_alpha_0_do_not_count() {
    let clear = |alpha: u8| png(4, &[opaque(RED), opaque(RED), [0, 0, 0, alpha], [0, 0, 0, alpha]].repeat(4));
    for (alpha, shown) in [(0, &[(RED, 1.0)][..]), (1, &[(RED, 0.5), ([0; 3], 0.5)])] {
        let of_obj = read(&[
            ("a.obj", obj("usemtl m", |_| String::new(), Some(WHOLE))),
            ("a.mtl", b"newmtl m\nmap_Kd half.png".into()),
            ("half.png", clear(alpha)),
        ]);
        assert_eq!(said(&of_obj, "8 texels of texture `half.png` are cut out"), alpha == 0, "{:?}", of_obj.warnings);
        assert_shares(&of_obj, shown);
    }
    let whole = read(&[
        ("a.obj", obj("usemtl m", |_| String::new(), Some(WHOLE))),
        ("a.mtl", b"newmtl m\nmap_Kd half.png".into()),
        ("half.png", png(1, &[[RED[0], RED[1], RED[2], 0]])),
    ]);
    assert!(said(&whole, "texture `half.png` is wholly transparent"), "{:?}", whole.warnings);
    assert_shares(&whole, &[(RED, 1.0)]);
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
}

/// `mtllib` may name several libraries, whose names may hold spaces.
#[test]
fn several_libraries_with_spaces_in_their_names() {
    let read_with = |names: &str, files: &[&str]| {
        let text = String::from_utf8(obj("usemtl m", |_| String::new(), None)).unwrap();
        let mut all = vec![("a.obj", text.replace("mtllib a.mtl", &format!("mtllib {names}")).into_bytes())];
        all.extend(files.iter().map(|name| (*name, b"newmtl other\nKd 0 0 1\n".to_vec())));
        all.last_mut().unwrap().1 = b"newmtl m\nKd 0.57758 0.021219 0.021219\n".to_vec();
        read(&all)
    };
    for (names, files) in [
        ("a.mtl", &["a.mtl"][..]),
        ("my  lib.mtl", &["my  lib.mtl"]),
        ("a.mtl b.mtl", &["a.mtl", "b.mtl"]),
        ("a.mtl my lib.mtl", &["a.mtl", "my lib.mtl"]),
        ("my lib.MTL a.mtl", &["a.mtl", "my lib.MTL"]),
        ("first second", &["first", "second"]),
    ] {
        let loaded = read_with(names, files);
        assert_eq!((lost(&loaded), loaded.warnings.len()), ("", 0), "{names}: {:?}", loaded.warnings);
        assert_shares(&loaded, &[(RED, 1.0)]);
    }
    // What is there is read, and what is not is named.
    let loaded = read_with("a.mtl b.mtl", &["b.mtl"]);
    assert!(lost(&loaded).contains("`a.mtl` cannot be read"), "{:?}", loaded.warnings);
    assert_shares(&loaded, &[(RED, 1.0)]);
}
