//! Colours of glTF: materials and their extensions, textures, vertices.

mod light;

use glam::DVec3;
use lumislice::mesh::Loaded;
use serde_json::{Value, json};

use super::{
    super::{
        painted::{assert_shares, byte, linear, shares},
        shapes::box_triangles,
        writers::glb_of,
    },
    BLUE, RED, halves, lost, opaque, png, read, said,
};

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

/// A factor has a range; rounding may leave it.
#[test]
fn factors_beyond_their_range_are_said_to_be_lost() {
    let key = "KHR_materials_pbrSpecularGlossiness";
    for (factor, is_lost) in [
        ([1.0_f32, 0.5, 0.0, 1.0], false),
        ([1.000_01, 0.5, -1e-6, 1.0], false),
        ([2.0, 0.5, 0.0, 1.0], true),
        ([200.0, 40.0, 40.0, 1.0], true),
        ([1.0, -0.5, 0.0, 1.0], true),
    ] {
        for material in [
            json!({"name": "m", "pbrMetallicRoughness": {"baseColorFactor": factor}}),
            json!({"name": "m", "extensions": {key: {"diffuseFactor": factor}}}),
        ] {
            let mut gltf = Gltf::new([0.0, 1.0]);
            gltf.json["materials"][0] = material;
            gltf.json["extensionsUsed"] = json!([key]);
            let loaded = gltf.read();
            assert_eq!(
                lost(&loaded).contains("`m`: found base colour factor"),
                is_lost,
                "{factor:?}: {}",
                lost(&loaded)
            );
            let found = loaded.mesh.materials[0].base_color;
            assert_eq!(found, factor.map(|value| value.clamp(0.0, 1.0)));
        }
    }
}
