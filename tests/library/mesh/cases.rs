//! The inputs that lie beside the project, if they do: what other programs' users met. Each has its right answer in the
//! README there.

use lumislice::mesh::{LoadOptions, Loaded, MeshError, Solid, close, load};

use super::painted::{assert_shares, shares};

const RED: [u8; 3] = [200, 40, 40];
const BLUE: [u8; 3] = [40, 40, 200];

fn read(name: &str) -> Option<Result<Loaded, MeshError>> {
    let path = crate::common::shared(&format!("cases/{name}"))?;
    Some(load(&path, &LoadOptions::default()))
}

fn solid(loaded: Loaded) -> Solid {
    close(loaded.mesh).unwrap()
}

#[test]
fn volumes() {
    let cube = 1.0;
    for (name, volume, warning) in [
        ("f13_fin.obj", cube, Some("1 sheet without thickness, of 2 triangles")),
        ("f6_jitter.stl", 109.3, Some("joined with others")),
        ("a1_bom_v.obj", cube, None),
        ("a1b_bom_mtllib.obj", cube, None),
        ("a3_comment.obj", cube, None),
        ("a4_bs.obj", cube, None),
        ("e4_endsolid_sp.stl", cube, None),
        ("e11_count0.stl", cube, None),
        ("d9b_case.3mf", 8.0, None),
        ("d2_type_support.3mf", 8.0, None),
        ("b7_instancing.glb", 3e9, None),
        ("b20_morph.glb", 2e9, None),
    ] {
        let Some(loaded) = read(name) else { return };
        let solid = solid(loaded.unwrap_or_else(|error| panic!("{error}")));
        let found = solid.health.volume_mm3;
        assert!((found / volume - 1.0).abs() < 1e-3, "{name}: {found} mm³, not {volume}");
        let warnings = solid.health.warnings();
        match warning {
            Some(part) => assert!(warnings.len() == 1 && warnings[0].contains(part), "{name}: {warnings:?}"),
            None => assert_eq!(warnings, Vec::<String>::new(), "{name}"),
        }
    }
}

#[test]
fn buried_faces_are_no_surface() {
    for (name, volume, area) in [
        ("f1_overlap.stl", 64.0 + 18.0, 96.0 + 24.0),
        ("f4_touch.stl", 128.0, 160.0),
        ("f4c_coplanar.stl", 96.0, 128.0),
    ] {
        let Some(loaded) = read(name) else { return };
        let health = solid(loaded.unwrap()).health;
        let (found, expected) = ((health.volume_mm3, health.area_mm2), (volume, area));
        assert!(
            (found.0 - volume).abs() < 1e-6 && (found.1 - area).abs() < 1e-6,
            "{name}: {found:?}, not {expected:?}"
        );
        assert!(health.buried_area_mm2 > 1.0);
    }
}

#[test]
fn what_is_left_out_is_said() {
    let Some(loaded) = read("d2_type_support.3mf") else { return };
    let warnings = loaded.unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.contains("`support`")), "{warnings:?}");
}

#[test]
fn what_takes_shape_away_is_refused_by_name() {
    for (name, part) in [("d4_negvol.3mf", "`NegativeVolume`"), ("d5_bambu.3mf", "`negative_part`")] {
        let Some(loaded) = read(name) else { return };
        let message = loaded.unwrap_err().to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn colours() {
    let both = &[(RED, 0.5), (BLUE, 0.5)][..];
    for (name, expected) in [
        ("b2_specgloss.glb", &[([203, 63, 63], 1.0)][..]),
        ("b2b_specgloss_req.glb", both),
        ("a6d.obj", &[(RED, 1.0)]),
        ("a7s.obj", &[(RED, 1.0)]),
        ("a7o.obj", &[(BLUE, 1.0)]),
        ("b3c_mirror.glb", &[(BLUE, 1.0)]),
        ("d8_mirror.3mf", &[(BLUE, 1.0)]),
        ("c2_multitex.ply", both),
        ("a8.obj", &[([0, 0, 0], 1.0)]),
        ("b15_mask.glb", &[(RED, 1.0)]),
        ("a1b_bom_mtllib.obj", &[([231, 63, 63], 1.0)]),
        ("t15.obj", &[([231, 63, 63], 1.0 / 6.0), ([149, 149, 149], 5.0 / 6.0)]),
    ] {
        let Some(loaded) = read(name) else { return };
        let loaded = loaded.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.lost_color, None, "{name}");
        println!("{name}");
        assert_shares(&loaded, expected);
    }
}

#[test]
fn colours_of_vertices() {
    for (name, ends) in [
        ("b1_color0.glb", [[203, 63, 63], [63, 63, 203]]),
        ("a5b_vc_mtl.obj", [[204, 26, 26], [26, 26, 204]]),
        ("d7_grad.3mf", [RED, BLUE]),
    ] {
        let Some(loaded) = read(name) else { return };
        let loaded = loaded.unwrap();
        assert_eq!(loaded.lost_color, None, "{name}");
        let found = shares(&loaded);
        // Something of either end, much between where one face has both, nothing outside.
        for end in ends {
            let near = |color: &[u8; 3]| color.iter().zip(end).all(|(a, b)| a.abs_diff(b) < 60);
            assert!(found.keys().any(near), "{name}: {end:?} is not in {found:?}");
        }
        assert!(name.starts_with("b1") || found.len() > 6, "{name}: {found:?}");
        assert!(found.keys().all(|color| color[1] < 70), "{name}: {found:?}");
    }
}

#[test]
fn colours_that_are_lost_are_refused_or_said() {
    for (name, part) in [
        ("d6_paint.3mf", "painted in a slicer (paint_color)"),
        ("d7f_multi.3mf", "multi-properties"),
        ("b5_nouv.glb", "no texture coordinates"),
    ] {
        let Some(loaded) = read(name) else { return };
        let lost = loaded.unwrap().lost_color.unwrap_or_default();
        assert!(lost.contains(part), "{name}: {lost}");
    }
    let Some(bare) = read("d9f_rel.3mf") else { return };
    assert!(bare.unwrap().mesh.materials.is_empty());
    for (name, part) in [("a8.obj", "multiplies its texture by black"), ("b15_mask.glb", "cuts 8 texels out")] {
        let Some(loaded) = read(name) else { return };
        let warnings = loaded.unwrap().warnings;
        assert!(warnings.iter().any(|warning| warning.contains(part)), "{name}: {warnings:?}");
    }
}
