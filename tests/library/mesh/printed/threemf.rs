//! Objects of 3MF by their types, and what slicers mark as help or take away.

use glam::DVec3;
use lumislice::mesh::{Loaded, MeshError};

use super::{
    super::{
        shapes::box_triangles,
        writers::{rels, threemf_parts},
    },
    near, said, solid, try_read,
};

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
    // An alternative in another part is not read, and what stands in for it is not printed.
    for (resolution, is_printed) in [("fullres", true), ("lowres", false), ("obfuscated", false)] {
        let alternative = "<pa:alternatives><pa:alternative objectid='7' path='/3D/b.model'/></pa:alternatives>";
        let object = format!("<object id='1' pa:modelresolution='{resolution}'>{alternative}{cube}</object>");
        let read = threemf("", &object, "<item objectid='1'/>", &[]);
        assert_eq!(read.is_ok(), is_printed, "{resolution}");
        assert!(read.err().is_none_or(|error| error.to_string().contains("an alternative of full resolution")));
    }
    let recommended = "recommendedextensions='x m' xmlns:x='http://example.org/bend' \
                       xmlns:m='http://schemas.microsoft.com/3dmanufacturing/material/2015/02'";
    let object = format!("<object id='1'>{cube}</object>");
    let loaded = threemf(recommended, &object, "<item objectid='1'/>", &[]).unwrap();
    assert!(near(solid(&loaded).0, 8.0) && loaded.warnings.len() == 1, "{:?}", loaded.warnings);
    assert!(said(&loaded, "recommended extension `x` (`http://example.org/bend`) is not read"));
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
