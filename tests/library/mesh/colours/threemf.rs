//! Colours of 3MF: property groups, textures, what slicers paint.

use lumislice::mesh::Loaded;

use super::{
    super::{
        painted::{assert_shares, shares},
        writers::{rels, threemf_parts},
    },
    BLUE, FACES, POINTS, RED, halves, lost, read, said,
};

/// A cube as 3MF: resources before the object, attributes of the object and of every triangle.
fn threemf(resources: &str, object: &str, triangle: &str) -> Loaded {
    threemf_beside(&[], resources, object, triangle)
}

/// The same with other parts.
fn threemf_beside(parts: &[(&str, &str)], resources: &str, object: &str, triangle: &str) -> Loaded {
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
    let mut all = vec![
        ("_rels/.rels", rels("3D/3dmodel.model").into_bytes()),
        ("3D/3dmodel.model", model.into_bytes()),
        ("3D/Textures/t.png", halves()),
    ];
    all.extend(parts.iter().map(|(name, text)| (*name, text.as_bytes().to_vec())));
    read(&[("a.3mf", threemf_parts(&all))])
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

/// A colour of alpha 0 is no colour that is seen; it is printed, and said.
#[test]
fn transparent_colours_are_said() {
    let group = |alpha: &str| format!("<m:colorgroup id='5'><m:color color='#C82828{alpha}'/></m:colorgroup>");
    let base =
        |alpha: &str| format!("<basematerials id='5'><base name='a' displaycolor='#C82828{alpha}'/></basematerials>");
    for (alpha, is_said) in [("00", true), ("01", false), ("", false)] {
        for resources in [group(alpha), base(alpha)] {
            let loaded = threemf(&resources, "pid='5' pindex='0'", "");
            assert_shares(&loaded, &[(RED, 1.0)]);
            assert_eq!(said(&loaded, "12 triangles with a colour that is wholly transparent"), is_said, "{resources}");
            // What no triangle has does not matter.
            assert_eq!(
                threemf(&format!("{resources}{}", group("").replace('5', "7")), "pid='7' pindex='0'", "")
                    .warnings
                    .len(),
                0
            );
        }
    }
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
fn colours_of_volumes_are_said_to_be_lost() {
    let loaded = threemf(
        "<v:volumedata xmlns:v='http://schemas.microsoft.com/3dmanufacturing/volumetric/2022/01' id='9'/>",
        "",
        "",
    );
    assert!(said(&loaded, "volumetric data"), "{:?}", loaded.warnings);
}

/// Parts of several filaments, and filaments that change by height, as slicers note them beside the model.
#[test]
fn colours_of_filaments_are_said_to_be_lost() {
    let lost_by = |name: &str, text: &str| lost(&threemf_beside(&[(name, text)], "", "", "")).to_owned();
    let (prusa, bambu) = ("Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config");
    let of = |kind: &str, number: u32| format!("<metadata {kind} key='extruder' value='{number}'/>");
    let volumes = |object: u32, [a, b]: [u32; 2]| {
        let volume = |number| format!("<volume firstid='0' lastid='11'>{}</volume>", of("type='volume'", number));
        format!("<config><object id='1'>{}{}{}</object></config>", of("type='object'", object), volume(a), volume(b))
    };
    let parts = |object: u32, [a, b]: [u32; 2]| {
        let part = |number| format!("<part id='1' subtype='normal_part'>{}</part>", of("", number));
        format!(
            "<config><object id='1'>{}{}{}</object><plate><metadata key='plater_id' value='2'/></plate></config>",
            of("", object),
            part(a),
            part(b)
        )
    };
    // A part without a number of its own has its object's, and an object without one the first.
    for (object, of_parts, is_lost) in [
        (0, [0, 0], false),
        (1, [1, 1], false),
        (2, [2, 2], false),
        (3, [1, 1], false),
        (1, [1, 2], true),
        (0, [0, 2], true),
        (0, [3, 1], true),
    ] {
        for (name, text) in [(prusa, volumes(object, of_parts)), (bambu, parts(object, of_parts))] {
            assert_eq!(lost_by(name, &text).contains("filaments"), is_lost, "{text}");
        }
    }
    assert!(lost_by(prusa, &volumes(2, [0, 1])).contains("filaments"));
    // Objects without parts.
    let two =
        |a, b| format!("<config><object id='1'>{}</object><object id='2'>{}</object></config>", of("", a), of("", b));
    assert!(lost_by(bambu, &two(1, 4)).contains("filaments") && lost_by(bambu, &two(4, 4)).is_empty());
    for (name, tag) in [
        ("Metadata/Prusa_Slicer_custom_gcode_per_print_z.xml", "code"),
        ("Metadata/custom_gcode_per_layer.xml", "layer"),
    ] {
        let change =
            |color: &str| format!("<codes><{tag} print_z='5.2' type='0' extruder='1' color='{color}'/></codes>");
        assert!(lost_by(name, &change("#FF0000")).contains("change by height"), "{name}");
        assert_eq!(lost_by(name, &change("")), "");
    }
}
