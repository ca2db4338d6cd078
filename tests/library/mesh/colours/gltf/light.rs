//! Light of glTF: what passes through, what glows.

use lumislice::mesh::{Placement, Size, place};
use serde_json::{Value, json};

use super::{Gltf, assert_shares, byte, halves, lost, png};

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

/// What glows where the base is black is said to be lost, and colours of instances are.
#[test]
fn what_glows_is_said_to_be_lost() {
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
