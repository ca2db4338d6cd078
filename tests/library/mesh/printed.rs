//! Only the part is printed, and all of it: instances, poses, what a slicer marks as help or takes away.

use glam::DVec3;
use lumislice::mesh::{LoadOptions, Loaded, MeshError, close, load};
use serde_json::{Value, json};

use super::shapes::box_triangles;
use super::writers::{glb_of, put, rels, threemf_parts};

fn try_read(name: &str, bytes: Vec<u8>) -> Result<Loaded, MeshError> {
    let folder = tempfile::tempdir().unwrap();
    load(&put(folder.path(), name, bytes), &LoadOptions::default())
}

/// Volume, and the longest sides.
fn solid(loaded: &Loaded) -> (f64, DVec3) {
    let health = close(loaded.mesh.clone()).unwrap().health;
    let positions = &loaded.mesh.positions;
    let low = positions.iter().copied().reduce(DVec3::min).unwrap();
    let high = positions.iter().copied().reduce(DVec3::max).unwrap();
    (health.volume_mm3, high - low)
}

fn near(found: f64, expected: f64) -> bool {
    (found / expected - 1.0).abs() < 1e-6
}

fn said(loaded: &Loaded, part: &str) -> bool {
    loaded.warnings.iter().any(|warning| warning.contains(part))
}

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

/// The mesh of a box as 3MF.
fn box_xml(boxes: &[(f64, f64)]) -> String {
    let (mut vertices, mut triangles) = (String::new(), String::new());
    for (n, &(at, side)) in boxes.iter().enumerate() {
        for (t, triangle) in box_triangles(DVec3::splat(at), DVec3::splat(at + side)).iter().enumerate() {
            for p in triangle {
                vertices += &format!("<vertex x='{}' y='{}' z='{}'/>", p.x, p.y, p.z);
            }
            let i = 3 * (12 * n + t);
            triangles += &format!("<triangle v1='{i}' v2='{}' v3='{}'/>", i + 1, i + 2);
        }
    }
    format!("<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>")
}

/// A package with these resources and build, and other parts.
fn threemf(attributes: &str, resources: &str, build: &str, parts: &[(&str, &str)]) -> Result<Loaded, MeshError> {
    let model = format!("<model {attributes}><resources>{resources}</resources><build>{build}</build></model>");
    let mut all =
        vec![("_rels/.rels", rels("/3D/3dmodel.model").into_bytes()), ("3D/3dmodel.model", model.into_bytes())];
    all.extend(parts.iter().map(|(name, text)| (*name, text.as_bytes().to_vec())));
    try_read("a.3mf", threemf_parts(&all))
}

#[test]
fn only_models_are_printed() {
    let two = |kind: &str, item: &str| {
        let resources = format!(
            "<object id='1' type='model'>{}</object><object id='2' {kind}>{}</object>",
            box_xml(&[(0.0, 2.0)]),
            box_xml(&[(5.0, 2.0)])
        );
        threemf("", &resources, &format!("<item objectid='1'/><item objectid='2' {item}/>"), &[]).unwrap()
    };
    for (kind, item, volume, part) in [
        ("", "", 16.0, ""),
        ("type='model'", "printable='1'", 16.0, ""),
        ("type='support'", "", 8.0, "`support`"),
        ("type='solidsupport'", "", 8.0, "`solidsupport`"),
        ("type='surface'", "", 8.0, "`surface`"),
        ("type='other'", "", 8.0, "`other`"),
        ("", "printable='0'", 8.0, "printable"),
        ("", "p:printable='false'", 8.0, "printable"),
    ] {
        let loaded = two(kind, item);
        assert!(near(solid(&loaded).0, volume), "{kind} {item}");
        assert!(loaded.warnings.len() == usize::from(volume < 9.0) && loaded.warnings.iter().all(|w| w.contains(part)));
    }
    // The type of what is made of components does not count; theirs does.
    let resources = format!(
        "<object id='1'>{}</object><object id='2' type='support'>{}</object><object id='3' type='support'><components>\
         <component objectid='1'/><component objectid='2'/></components></object>",
        box_xml(&[(0.0, 2.0)]),
        box_xml(&[(5.0, 2.0)])
    );
    assert!(near(solid(&threemf("", &resources, "<item objectid='3'/>", &[]).unwrap()).0, 8.0));
    let nothing = threemf("", &resources, "<item objectid='2'/>", &[]).unwrap_err().to_string();
    assert!(nothing.contains("no triangles"), "{nothing}");
}

#[test]
fn helpers_of_prusa_slicer() {
    let with = |metadata: &str| {
        let object = format!("<object id='4'>{}</object>", box_xml(&[(0.0, 4.0), (2.0, 6.0)]));
        let config = format!(
            "<?xml version='1.0'?><config><object id='4'><metadata type='object' key='extruder' value='1'/>\
             <volume firstid='0' lastid='11'><metadata type='volume' key='volume_type' value='ModelPart'/></volume>\
             <volume firstid='12' lastid='23'>{metadata}</volume></object></config>"
        );
        threemf("", &object, "<item objectid='4'/>", &[("Metadata/Slic3r_PE_model.config", &config)])
    };
    let kind = |kind: &str| format!("<metadata type='volume' key='volume_type' value='{kind}'/>");
    for (metadata, part) in [
        (kind("ParameterModifier"), "modifier volumes"),
        (kind("SupportEnforcer"), "support enforcers"),
        (kind("SupportBlocker"), "support blockers"),
        ("<metadata type='volume' key='modifier' value='1'/>".to_owned(), "modifier volumes"),
    ] {
        let loaded = with(&metadata).unwrap();
        assert!(near(solid(&loaded).0, 64.0) && said(&loaded, part), "{:?}", loaded.warnings);
    }
    for unread in ["NegativeVolume", "VolumeOfTomorrow"] {
        let message = with(&kind(unread)).unwrap_err().to_string();
        assert!(message.contains(&format!("`{unread}`")) && message.contains("object 4"), "{message}");
    }
    assert_eq!(with(&kind("ModelPart")).unwrap().mesh.triangles.len(), 24);
    let broken = "<config><object id='4'><volume firstid='0' lastid='99999999999'/></objekt>";
    let object = format!("<object id='4'>{}</object>", box_xml(&[(0.0, 4.0)]));
    let message = threemf("", &object, "<item objectid='4'/>", &[("Metadata/Slic3r_PE_model.config", broken)]);
    assert!(message.unwrap_err().to_string().contains("well-formed XML"));
}

#[test]
fn helpers_of_bambu_studio_and_orca_slicer() {
    let with = |subtype: &str, id: u32| {
        let other = format!(
            "<model><resources><object id='1'>{}</object><object id='2'>{}</object></resources></model>",
            box_xml(&[(0.0, 4.0)]),
            box_xml(&[(2.0, 6.0)])
        );
        let root = "<object id='3'><components><component p:path='/3D/Objects/object_1.model' objectid='1'/>\
                    <component p:path='/3D/objects/OBJECT_1.model' objectid='2'/></components></object>";
        let config = format!(
            "<config><object id='{id}'><part id='1' subtype='normal_part'/><part id='2' \
                subtype='{subtype}'/></object></config>"
        );
        let parts = [("3D/Objects/object_1.model", other.as_str()), ("Metadata/model_settings.config", &config)];
        threemf("", root, "<item objectid='3' printable='1'/>", &parts)
    };
    for (subtype, part) in
        [("modifier_part", "modifier"), ("support_enforcer", "enforcers"), ("support_blocker", "blockers")]
    {
        let loaded = with(subtype, 3).unwrap();
        assert!(near(solid(&loaded).0, 64.0) && said(&loaded, part), "{:?}", loaded.warnings);
    }
    let message = with("negative_part", 3).unwrap_err().to_string();
    assert!(message.contains("`negative_part`") && message.contains("component 2"), "{message}");
    // Of another object.
    assert_eq!(with("negative_part", 7).unwrap().mesh.triangles.len(), 24);
}

#[test]
fn helpers_of_cura() {
    let with = |name: &str, value: &str| {
        let resources = format!(
            "<object id='1'>{}</object><object id='2'><metadatagroup><metadata name='cura:extruder_nr'>1</metadata>\
             <metadata name='{name}' type='xs:string'>{value}</metadata></metadatagroup>{}</object>",
            box_xml(&[(0.0, 2.0)]),
            box_xml(&[(5.0, 2.0)])
        );
        solid(&threemf("", &resources, "<item objectid='1'/><item objectid='2'/>", &[]).unwrap()).0
    };
    for name in ["cura:support_mesh", "cura:anti_overhang_mesh", "cura:infill_mesh", "cura:cutting_mesh"] {
        assert!(near(with(name, "True"), 8.0) && near(with(name, "False"), 16.0));
    }
    assert!(near(with("cura:wall_line_count", "True"), 16.0));
}

#[test]
fn shapes_that_are_not_meshes_are_refused_by_name() {
    let cube = box_xml(&[(0.0, 2.0)]);
    for (object, part) in [
        (
            format!("<object id='1' s:slicestackid='9' s:meshresolution='lowres'>{cube}</object>"),
            "slices of higher resolution",
        ),
        ("<object id='1'><bo:booleanshape objectid='2' operation='difference'/></object>".to_owned(), "booleanshape"),
        (format!("<object id='1'><v:levelset/>{cube}</object>"), "levelset"),
        ("<object id='1'><d:displacementmesh/></object>".to_owned(), "displacementmesh"),
    ] {
        let message = threemf("", &object, "<item objectid='1'/>", &[]).unwrap_err().to_string();
        assert!(message.contains(part) && message.contains("object 1"), "{message}");
    }
    for (stack, part) in [("slicestack", "slice stacks"), ("beamlattice", "beam lattices")] {
        let resources = format!("<s:{stack} id='9'/><object id='1' s:meshresolution='fullres'>{cube}</object>");
        let loaded = threemf("", &resources, "<item objectid='1'/>", &[]).unwrap();
        assert!(near(solid(&loaded).0, 8.0) && said(&loaded, part));
    }
    let slices = "requiredextensions='s' xmlns:s='http://schemas.microsoft.com/3dmanufacturing/slice/2015/07'";
    let object = format!("<object id='1'>{cube}</object>");
    let message = threemf(slices, &object, "<item objectid='1'/>", &[]).unwrap_err().to_string();
    assert!(message.contains("required extension `s`"), "{message}");
}

#[test]
fn shapes_by_slices_and_volumes_are_refused() {
    let cube = box_xml(&[(0.0, 2.0)]);
    let volume = "xmlns:v='http://schemas.microsoft.com/3dmanufacturing/volumetric/2022/01'";
    let slices = "xmlns:s='http://schemas.microsoft.com/3dmanufacturing/slice/2015/07'";
    let stack = "<s:slicestack id='9' zbottom='0'><s:slice ztop='2'><s:vertices><s:vertex x='0' y='0'/></s:vertices>\
                 </s:slice></s:slicestack>";
    let bounded = cube.replace("</mesh>", "<v:volumedata><v:boundary functionid='3'/></v:volumedata></mesh>");
    for (attributes, resources, part) in [
        (slices, format!("{stack}<object id='1' s:slicestackid='9'>{cube}</object>"), "slicestackid"),
        (volume, format!("<object id='1'>{bounded}</object>"), "volumedata"),
        (
            volume,
            format!(
                "<v:volumedata id='9'><v:boundary functionid='3'/></v:volumedata><object id='1'>{}</object>",
                cube.replace("<mesh>", "<mesh volumeid='9'>")
            ),
            "volumedata",
        ),
    ] {
        let message = threemf(attributes, &resources, "<item objectid='1'/>", &[]).unwrap_err().to_string();
        assert!(message.contains(part) && message.contains("object 1"), "{message}");
    }
    // Where the mesh is said to be as fine as the slices it counts.
    let fine = format!("{stack}<object id='1' s:slicestackid='9' s:meshresolution='fullres'>{cube}</object>");
    let loaded = threemf(slices, &fine, "<item objectid='1'/>", &[]).unwrap();
    assert!(near(solid(&loaded).0, 8.0) && said(&loaded, "slice stacks"));
}

#[test]
fn helpers_of_older_slicers() {
    let slic3r = "xmlns:slic3r='http://schemas.slic3r.org/3mf/2017/06'";
    let both = box_xml(&[(0.0, 2.0), (5.0, 2.0)]);
    let with = |last: &str| {
        let volumes = format!(
            "<slic3r:volumes><slic3r:volume ts='0' te='11' modifier='0'/><slic3r:volume ts='12' te='23' \
             modifier='{last}'/></slic3r:volumes></mesh>"
        );
        let object = format!(
            "<object id='1'><slic3r:object type='fill_density' config='20%'/>{}</object>",
            both.replace("</mesh>", &volumes)
        );
        threemf(slic3r, &object, "<item objectid='1'/>", &[]).unwrap()
    };
    assert!(near(solid(&with("1")).0, 8.0) && said(&with("1"), "modifier"));
    assert!(near(solid(&with("0")).0, 16.0) && with("0").warnings.iter().all(|said| !said.contains("modifier")));
    let cura = |key: &str, value: &str| {
        let resources = format!(
            "<object id='1'>{}</object><object id='2'><cura:settings><setting key='{key}'>{value}</setting>\
             </cura:settings>{}</object>",
            box_xml(&[(0.0, 2.0)]),
            box_xml(&[(5.0, 2.0)])
        );
        let cura = "xmlns:cura='http://software.ultimaker.com/xml/cura/3mf/2015/10'";
        solid(&threemf(cura, &resources, "<item objectid='1'/><item objectid='2'/>", &[]).unwrap()).0
    };
    for key in ["support_mesh", "anti_overhang_mesh", "infill_mesh", "cutting_mesh"] {
        assert!(near(cura(key, "True"), 8.0) && near(cura(key, "False"), 16.0), "{key}");
    }
    assert!(near(cura("wall_line_count", "True"), 16.0));
}

/// Roles hold however the root's name is spelled.
#[test]
fn a_root_in_another_case_is_the_root() {
    for (target, path) in [
        ("/3d/3DModel.Model", "/3D/3dmodel.model"),
        ("/3D/3dmodel.model", "/3D/3DModel.MODEL"),
        ("3D/3dmodel.model", ""),
    ] {
        let path = if path.is_empty() { String::new() } else { format!("p:path='{path}'") };
        let model = format!(
            "<model><resources><object id='1'>{}</object><object id='2'>{}</object><object id='3'><components><component \
             objectid='1'/><component objectid='2'/></components></object></resources><build><item objectid='3' {path}/>\
             </build></model>",
            box_xml(&[(0.0, 2.0)]),
            box_xml(&[(5.0, 2.0)])
        );
        let config = "<config><object id='3'><part id='1' subtype='normal_part'/><part id='2' \
                      subtype='modifier_part'/></object></config>";
        let parts = [
            ("_rels/.rels", rels(target).into_bytes()),
            ("3D/3dmodel.model", model.into_bytes()),
            ("Metadata/model_settings.config", config.as_bytes().to_vec()),
        ];
        let loaded = try_read("a.3mf", threemf_parts(&parts)).unwrap();
        assert!(near(solid(&loaded).0, 8.0), "{target} {path}");
    }
}

#[test]
fn a_name_used_twice_is_refused() {
    let model = |side: f64| {
        format!(
            "<model><resources><object id='1'>{}</object></resources><build><item objectid='1'/></build></model>",
            box_xml(&[(0.0, side)])
        )
        .into_bytes()
    };
    let parts = [
        ("_rels/.rels", rels("/3D/3dmodel.model").into_bytes()),
        ("3D/3dmodel.model", model(2.0)),
        ("3D/3DMODEL.model", model(3.0)),
    ];
    let message = try_read("a.3mf", threemf_parts(&parts)).unwrap_err().to_string();
    assert!(message.contains("two entries of that name"), "{message}");
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
