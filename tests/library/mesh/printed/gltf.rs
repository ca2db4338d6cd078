//! Instances, poses, scenes, extensions of glTF.

use glam::DVec3;
use lumislice::mesh::{Loaded, close};
use serde_json::{Value, json};

use super::{
    super::{shapes::box_triangles, writers::glb_of},
    near, said, solid, try_read,
};

/// A cube of a metre as glTF: positions are accessor 0; `change` may add to it.
fn gltf(change: impl FnOnce(&mut Value, &mut dyn FnMut(&mut Value, &str, &[f32]) -> usize)) -> Vec<u8> {
    let mut bin = Vec::new();
    let mut json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [], "bufferViews": [], "buffers": [{}]
    });
    let mut add = |json: &mut Value, kind: &str, values: &[f32]| {
        let components = match kind {
            "MAT4" => 16,
            kind => kind[3..].parse::<usize>().unwrap(),
        };
        let views = json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": 4 * values.len()}));
        bin.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        json["buffers"][0]["byteLength"] = bin.len().into();
        let accessors = json["accessors"].as_array_mut().unwrap();
        let mut accessor = json!({"bufferView": accessors.len(), "componentType": 5126, "type": kind,
            "count": values.len() / components});
        if kind == "VEC3" {
            (accessor["min"], accessor["max"]) = (json!([0, 0, 0]), json!([1, 1, 1]));
        }
        accessors.push(accessor);
        accessors.len() - 1
    };
    add(&mut json, "VEC3", &cube());
    change(&mut json, &mut add);
    glb_of(&json, &bin)
}

fn cube() -> Vec<f32> {
    box_triangles(DVec3::ZERO, DVec3::ONE).concat().iter().flat_map(|p| p.to_array().map(|c| c as f32)).collect()
}

fn read_gltf(change: impl FnOnce(&mut Value, &mut dyn FnMut(&mut Value, &str, &[f32]) -> usize)) -> Loaded {
    try_read("a.glb", gltf(change)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn instances_of_a_mesh() {
    let loaded = read_gltf(|json, add| {
        let places = add(json, "VEC3", &[0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let turns = add(json, "VEC4", &[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half], [0.0; 4]].concat());
        let sizes = add(json, "VEC3", &[1.0, 1.0, 1.0, 1.0, 1.0, 2.0, -1.0, 1.0, 1.0]);
        json["nodes"][0] = json!({"mesh": 0, "scale": [1, 2, 1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
            {"TRANSLATION": places, "ROTATION": turns, "SCALE": sizes, "_ID": 9}}}});
        json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
        json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    });
    assert_eq!((loaded.mesh.triangles.len(), loaded.warnings.len()), (36, 1), "{:?}", loaded.warnings);
    let health = close(loaded.mesh.clone()).unwrap().health;
    assert!(near(health.volume_mm3, 8e9) && health.turned_shells == 0 && health.flipped_triangles == 0);
    assert!((solid(&loaded).1 - DVec3::new(6000.0, 2000.0, 2000.0)).abs().max_element() < 1.0, "{:?}", solid(&loaded));
}

#[test]
fn bad_instances_are_refused() {
    for (attributes, part) in [
        (json!({}), "no TRANSLATION, ROTATION or SCALE"),
        (json!({"TRANSLATION": 7}), "TRANSLATION 7"),
        (json!({"TRANSLATION": "x"}), "an accessor below"),
        (json!({"TRANSLATION": 0, "SCALE": 1}), "36 and 1 instances"),
        (json!({"ROTATION": 0}), "vectors of 4 components"),
    ] {
        let bytes = gltf(|json, add| {
            add(json, "VEC3", &[1.0; 3]);
            json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        });
        let message = try_read("a.glb", bytes).unwrap_err().to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn hidden_nodes_are_left_out() {
    for (visible, volume) in [(json!({"visible": false}), 1e9), (json!({"visible": true}), 3e9), (json!({}), 3e9)] {
        let loaded = read_gltf(|json, _| {
            json["scenes"][0]["nodes"] = json!([0, 1]);
            json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0], "children": [2],
                "extensions": {"KHR_node_visibility": visible}}, {"mesh": 0, "translation": [3, 0, 0]}]);
            json["extensionsUsed"] = json!(["KHR_node_visibility"]);
        });
        assert!(near(solid(&loaded).0, volume));
        assert_eq!(said(&loaded, "1 node with all that hangs on it hidden"), volume < 2e9, "{:?}", loaded.warnings);
    }
}

#[test]
fn default_weights_of_morph_targets() {
    let stretched = |mesh: Value, node: Value| {
        read_gltf(|json, add| {
            let up: Vec<f32> = cube().chunks(3).flat_map(|p| [0.0, p[1], 0.0]).collect();
            let along: Vec<f32> = cube().chunks(3).flat_map(|p| [p[0], 0.0, 0.0]).collect();
            let targets = [up, along].map(|values| add(json, "VEC3", &values));
            json["meshes"][0]["primitives"][0]["targets"] = targets.map(|target| json!({"POSITION": target})).into();
            json["meshes"][0]["weights"] = mesh;
            if !node.is_null() {
                json["nodes"][0]["weights"] = node;
            }
        })
    };
    for (mesh, node, volume) in [
        (json!([1.0, 0.0]), Value::Null, 2e9),
        (json!([1.0, 0.5]), Value::Null, 3e9),
        (json!([0.0, 0.0]), Value::Null, 1e9),
        (json!([1.0, 0.0]), json!([0.0, 2.0]), 3e9),
    ] {
        assert!(near(solid(&stretched(mesh, node)).0, volume));
    }
}

#[test]
fn skins_stand_in_their_joints_pose() {
    // Bound to two joints, one of which has been pulled up by two metres since; the node's own place does not count.
    let pulled = |weights: [[f32; 4]; 2]| {
        read_gltf(|json, add| {
            let joints = add(json, "VEC4", &[[0.0, 1.0, 0.0, 0.0]; 36].concat());
            let weights: Vec<f32> = cube().chunks(3).flat_map(|p| weights[usize::from(p[1] > 0.5)]).collect();
            let weights = add(json, "VEC4", &weights);
            let mut unbind = [[0.0; 16]; 2];
            for matrix in &mut unbind {
                (0..4).for_each(|i| matrix[5 * i] = 1.0);
            }
            unbind[1][13] = -1.0;
            let unbind = add(json, "MAT4", &unbind.concat());
            json["accessors"][joints]["componentType"] = 5126.into();
            json["meshes"][0]["primitives"][0]["attributes"] =
                json!({"POSITION": 0, "JOINTS_0": joints, "WEIGHTS_0": weights});
            json["nodes"] = json!([{"mesh": 0, "skin": 0, "translation": [50, 60, 70], "scale": [9, 9, 9]},
                {"children": [2]}, {"translation": [0, 3, 0]}]);
            json["scenes"][0]["nodes"] = json!([0, 1]);
            json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": unbind}]);
        })
    };
    let first = [1.0, 0.0, 0.0, 0.0];
    for (top, height) in
        [([0.0, 1.0, 0.0, 0.0], 3000.0), (first, 1000.0), ([0.25, 0.25, 0.0, 0.0], 2000.0), ([0.0; 4], 1000.0)]
    {
        let loaded = pulled([first, top]);
        let (volume, size) = solid(&loaded);
        assert!(near(volume, height * 1e6) && near(size.z, height), "{top:?}: {size}");
        assert_eq!(loaded.mesh.positions.iter().map(|p| p.x).fold(f64::MAX, f64::min), 0.0);
    }
}

#[test]
fn extensions_that_are_not_read_are_named() {
    let with = |used: &str, required: bool| {
        try_read(
            "a.glb",
            gltf(|json, _| {
                json["extensionsUsed"] = json!([used]);
                if required {
                    json["extensionsRequired"] = json!([used]);
                }
            }),
        )
    };
    for harmless in ["KHR_materials_clearcoat", "KHR_materials_unlit", "KHR_lights_punctual", "KHR_mesh_quantization"] {
        assert!(!said(&with(harmless, false).unwrap(), harmless));
        assert!(with(harmless, true).is_ok());
    }
    // Not by the beginning of their names.
    for unread in ["KHR_materials_variants", "KHR_materials_vol", "KHR_materials_of_tomorrow", "VENDOR_twist"] {
        assert!(said(&with(unread, false).unwrap(), &format!("extension `{unread}` is in use and not read")));
        let message = with(unread, true).unwrap_err().to_string();
        assert!(message.contains(&format!("required extension `{unread}`")), "{message}");
    }
    // The file holds the mesh without them, unless it says otherwise.
    for packed in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        assert!(with(packed, false).is_ok());
        assert!(with(packed, true).unwrap_err().to_string().contains(packed));
    }
}

#[test]
fn rotations_that_are_no_unit_quaternions_turn_and_do_not_scale() {
    for (rotation, is_off) in [
        (json!([0, 0, 1, 1]), true),
        (json!([0, 0, 0, 0]), true),
        (json!([0, 0, 0.2, 0.2]), true),
        (json!([0, 0, 0.707_106_77, 0.707_106_77]), false),
    ] {
        let loaded = read_gltf(|json, _| json["nodes"][0]["rotation"] = rotation.clone());
        assert!(near(solid(&loaded).0, 1e9), "{rotation}: {}", solid(&loaded).0);
        assert_eq!(said(&loaded, "not of unit length"), is_off, "{rotation}: {:?}", loaded.warnings);
    }
}

#[test]
fn nodes_without_scenes_and_other_scenes() {
    let two = |json: &mut Value| {
        json["nodes"] = json!([{"mesh": 0, "scale": [2, 2, 2]}, {"mesh": 0, "translation": [5, 0, 0]}]);
    };
    let loaded = read_gltf(|json, _| {
        two(json);
        let root = json.as_object_mut().unwrap();
        root.remove("scene");
        root.remove("scenes");
    });
    assert!(near(solid(&loaded).0, 9e9), "{}", solid(&loaded).0);
    let loaded = read_gltf(|json, _| {
        two(json);
        json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    });
    assert!(near(solid(&loaded).0, 8e9) && said(&loaded, "1 scene besides"), "{:?}", loaded.warnings);
    // A scene may be empty, and is shown where it is the one to be shown.
    let bytes = |shown: Option<usize>| {
        gltf(|json, _| {
            json["scenes"] = json!([{"name": "empty"}, {"nodes": [0]}]);
            match shown {
                Some(shown) => json["scene"] = shown.into(),
                None => drop(json.as_object_mut().unwrap().remove("scene")),
            }
        })
    };
    for shown in [None, Some(1)] {
        assert!(near(solid(&try_read("a.glb", bytes(shown)).unwrap()).0, 1e9), "{shown:?}");
    }
    let message = try_read("a.glb", bytes(Some(0))).unwrap_err().to_string();
    assert!(message.contains("no triangles"), "{message}");
}

#[test]
fn what_says_nothing_of_a_shape_does_not_refuse_it() {
    for name in ["_BATCHID", "_FEATURE_ID_0", "_foo"] {
        let loaded = read_gltf(|json, add| {
            let values = add(json, "VEC2", &[1.0; 72]);
            json["meshes"][0]["primitives"][0]["attributes"][name] = values.into();
        });
        assert!(near(solid(&loaded).0, 1e9) && !said(&loaded, name), "{name}: {:?}", loaded.warnings);
    }
    let loaded = read_gltf(|json, _| {
        json["animations"] = json!([{"channels": [{"sampler": 0, "target": {"path": "pointer", "extensions":
            {"KHR_animation_pointer": {"pointer": "/nodes/0/scale"}}}}], "samplers": [{"input": 0, "output": 0}]}]);
        json["accessors"][0].as_object_mut().unwrap().remove("min");
    });
    assert!(near(solid(&loaded).0, 1e9));
    let loaded = read_gltf(|json, add| {
        let ids = add(json, "VEC2", &[0.0; 4]);
        json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"_ID": ids}}});
    });
    assert_eq!(loaded.mesh.triangles.len(), 24);
    let loaded = read_gltf(|json, _| {
        json["cameras"] = json!([{"type": "fisheye"}]);
        json["nodes"][0]["camera"] = 0.into();
        json["bufferViews"][0]["target"] = 0.into();
        json["bufferViews"][0]["byteStride"] = 0.into();
    });
    assert!(near(solid(&loaded).0, 1e9) && loaded.warnings.len() == 1, "{:?}", loaded.warnings);
    // What is wrong besides is still said.
    let bytes = gltf(|json, _| {
        json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "_ID": 0, "FOO": 0});
    });
    assert!(try_read("a.glb", bytes).unwrap_err().to_string().contains("semantic"));
}

/// A JSON chunk that its writer did not pad, or padded with zeros.
#[test]
fn chunks_that_are_not_padded() {
    let bytes = gltf(|_, _| ());
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let (json, rest) = (&bytes[20..20 + length], &bytes[20 + length..]);
    let json = json.trim_ascii_end();
    for padding in [&b""[..], b" ", b"  ", b"   ", b"\0", b"\0\0\0"] {
        let length = (json.len() + padding.len()) as u32;
        let bytes = [&bytes[..12], &length.to_le_bytes(), b"JSON", json, padding, rest].concat();
        assert!(near(solid(&try_read("a.glb", bytes).unwrap()).0, 1e9), "{padding:?}");
    }
}
