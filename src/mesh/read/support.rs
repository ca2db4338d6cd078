//! What is read of each format, what does not matter, and what is refused: the parsers ask this table, and
//! docs/formats.md is held against it.

/// What becomes of a part of a format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// It takes part.
    Read,
    /// It says nothing of shape or base colour.
    Ignored,
    /// It may matter and is not read: a warning names it.
    Warned,
    /// It gives a colour and is not read: a warning, and a refusal where the target is made of the mesh's own colour.
    Lost,
    /// The file is refused.
    Refused,
}

#[cfg(test)]
impl Fate {
    const ALL: [Self; 5] = [Self::Read, Self::Ignored, Self::Warned, Self::Lost, Self::Refused];

    /// Its word in the documentation.
    fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Ignored => "ignored",
            Self::Warned => "warned of",
            Self::Lost => "colour lost",
            Self::Refused => "refused",
        }
    }
}

/// Parts of a format that share their fate.
pub(super) struct Row {
    format: &'static str,
    fate: Fate,
    /// Exact names as they stand in files.
    names: &'static [&'static str],
    /// What else the documentation says.
    #[cfg_attr(not(test), expect(dead_code, reason = "only the test of the documentation asks for it"))]
    note: &'static str,
}

const fn row(format: &'static str, fate: Fate, names: &'static [&'static str], note: &'static str) -> Row {
    Row { format, fate, names, note }
}

/// All formats, in the order of the documentation.
pub(super) const ROWS: &[Row] = &[
    row(
        "OBJ",
        Fate::Read,
        &["v", "vt", "f", "fo", "usemtl", "mtllib", "#MRGB"],
        "keywords in any case; polygons, concave ones too; vertex colours (`v x y z r g b`, sRGB), which stand in \
         for Kd where there is no map_Kd; of whole numbers beyond 10 they are bytes, else cut at 1",
    ),
    row(
        "OBJ",
        Fate::Ignored,
        &["vn", "vp", "g", "o", "s", "l", "p"],
        "homogeneous weights; vertex colours under a texture, and numbers of texture coordinates in a file that has \
         none, with a warning",
    ),
    row(
        "OBJ",
        Fate::Warned,
        &["surf", "curv", "curv2", "bsp", "bzp", "cdc", "cdp", "call"],
        "free-form surfaces and other files",
    ),
    row("OBJ", Fate::Lost, &["usemap"], "missing libraries, materials and textures; a texture without `vt`"),
    row("OBJ", Fate::Refused, &[], "indices out of range"),
    row(
        "MTL",
        Fate::Read,
        &["newmtl", "kd", "d", "map_kd"],
        "keywords in any case; the options -s, -o and -clamp of map_Kd; a texture that is not where it is said to be, \
         if one of that name, in any case, lies beside the mesh (so in every format); texels of alpha 0 take the \
         nearest one's colour, with a warning",
    ),
    row(
        "MTL",
        Fate::Ignored,
        &["ka", "ks", "ke", "ns", "ni", "tf", "tr", "illum", "map_ka", "map_ke", "map_ks", "bump", "disp"],
        "the other options of map_Kd",
    ),
    row("MTL", Fate::Warned, &["map_d"], "a Kd of black with map_Kd, which stays black"),
    row(
        "MTL",
        Fate::Lost,
        &["kd spectral", "kd xyz"],
        "the options -mm and -t of map_Kd; materials with neither Kd nor map_Kd; colours that stand in Ke, map_Ka or \
         map_Ke alone; commas in the numbers of Kd and of the options -s, -o, -t and -mm",
    ),
    row(
        "glTF",
        Fate::Read,
        &[
            "EXT_mesh_gpu_instancing",
            "KHR_materials_diffuse_transmission",
            "KHR_materials_pbrSpecularGlossiness",
            "KHR_materials_scatter",
            "KHR_materials_transmission",
            "KHR_materials_unlit",
            "KHR_materials_volume",
            "KHR_materials_volume_scatter",
            "KHR_mesh_quantization",
            "KHR_node_visibility",
            "KHR_texture_transform",
        ],
        "the default scene's nodes, where none is named those of the first that has any, all where there are no \
         scenes; \
         triangles, strips, fans; sparse accessors, and those without bytes, which are 0; base or diffuse colour, \
         texture with its wrap modes, COLOR_0 (linear; multiplies); default morph weights; skins in the pose of \
          their joints; \
         texels and vertices that alpha cuts out (of factor, texture and COLOR_0) take the nearest one's colour, with \
         a warning",
    ),
    row(
        "glTF",
        Fate::Ignored,
        &[
            "AGI_articulations",
            "AGI_stk_metadata",
            "CESIUM_RTC",
            "CESIUM_primitive_outline",
            "EXT_instance_features",
            "EXT_lights_ies",
            "EXT_lights_image_based",
            "EXT_mesh_features",
            "EXT_mesh_manifold",
            "EXT_structural_metadata",
            "EXT_texture_avif",
            "EXT_texture_webp",
            "FB_geometry_metadata",
            "KHR_animation_pointer",
            "KHR_audio_emitter",
            "KHR_implicit_shapes",
            "KHR_interactivity",
            "KHR_lights_punctual",
            "KHR_materials_anisotropy",
            "KHR_materials_clearcoat",
            "KHR_materials_dispersion",
            "KHR_materials_emissive_strength",
            "KHR_materials_ior",
            "KHR_materials_iridescence",
            "KHR_materials_sheen",
            "KHR_materials_specular",
            "KHR_node_hoverability",
            "KHR_node_selectability",
            "KHR_physics_rigid_bodies",
            "KHR_texture_basisu",
            "KHR_xmp",
            "KHR_xmp_json_ld",
            "MSFT_lod",
            "MSFT_packing_normalRoughnessMetallic",
            "MSFT_packing_occlusionRoughnessMetallic",
            "MSFT_texture_dds",
        ],
        "points, lines, cameras, animations, other textures; attributes that begin with `_`; a texture in another \
         codec counts as lost where no PNG \
         or JPEG stands beside it",
    ),
    row(
        "glTF",
        Fate::Warned,
        &["KHR_materials_variants"],
        "every extension in use that is not in this table; refused where required. Primitives without a material \
         are white; what is wholly transparent under `BLEND` is printed in its colour; other scenes are left out; \
         rotations that are not of unit length are made so",
    ),
    row(
        "glTF",
        Fate::Lost,
        &["KHR_materials_cmnBlinnPhong", "KHR_materials_common", "KHR_techniques_webgl"],
        "missing or unreadable images; what a mask cuts out whole; a texture without TEXCOORD; sets of colours beyond \
         COLOR_0 without that; colours that only glow (emissive), those of instances (`_COLOR_0`), and those of morph \
         targets with a default weight; factors beyond 0 to 1, which are cut",
    ),
    row(
        "glTF",
        Fate::Refused,
        &["EXT_meshopt_compression", "KHR_draco_mesh_compression", "KHR_meshopt_compression"],
        "where required, by exact name; where not, what the file holds without them is read. glTF 1.0 and any other \
         version but 2, a `minVersion` beyond 2.0; more than 100 million triangles once nodes and instances are placed",
    ),
    row(
        "STL",
        Fate::Read,
        &[],
        "both kinds, told apart by size and content; several solids; too low a count in the header, with a \
         warning, where triangles follow; `end solid`, or none; `outerloop` and `facetnormal` in one word; no \
         `endfacet` before the next facet",
    ),
    row("STL", Fate::Ignored, &[], "normals, other attribute bytes: an STL has no base colour"),
    row(
        "STL",
        Fate::Lost,
        &[],
        "colours of faces in their attribute bytes and in the header, as Magics and VisCAM keep them",
    ),
    row(
        "PLY",
        Fate::Read,
        &[
            "vertex_indices",
            "vertex_index",
            "texcoord",
            "texnumber",
            "TextureFile",
            "tristrips",
            "red",
            "green",
            "blue",
        ],
        "text, binary of both byte orders, int64 and uint64 too; x y z, u v (s t, `texture_u` `texture_v`); colours of \
         vertices or faces, sRGB, where there is no texture, in numbers as in OBJ; several textures, of \
         which texels of alpha 0 take the nearest one's colour, with a warning",
    ),
    row("PLY", Fate::Ignored, &[], "other elements and properties; vertex colours under a texture, with a warning"),
    row(
        "PLY",
        Fate::Lost,
        &[],
        "`multi_texture` and `material` elements; colours by other properties (`gray`, `intensity`, `rgb`, \
         `ambient_red` …) where no others are; several textures without a texnumber; missing or unreadable \
            textures; a texture without coordinates",
    ),
    row("PLY", Fate::Refused, &[], "indices out of range, a texnumber without TextureFile"),
    row(
        "3MF",
        Fate::Read,
        &[
            "http://schemas.microsoft.com/3dmanufacturing/core/2015/02",
            "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
            "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
            "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
        ],
        "core 1.3: units, components, build items, transforms; base materials, colour groups (sRGB, interpolated), \
         textures with their tile styles; part names in any case; UTF-16",
    ),
    row(
        "3MF",
        Fate::Ignored,
        &["metadata", "thumbnail", "displayproperties"],
        "supports and seams painted in a slicer; print settings; alpha of colours, with a warning where it is 0",
    ),
    row(
        "3MF",
        Fate::Warned,
        &["beamlattice", "slicestack", "volumedata"],
        "objects of type support, solidsupport, surface and other, items with `printable=\"0\"`, modifiers, support \
         enforcers and blockers of Slic3r, PrusaSlicer, Bambu Studio, OrcaSlicer and Cura: left out; recommended \
         extensions other than those read",
    ),
    row(
        "3MF",
        Fate::Lost,
        &["compositematerials", "multiproperties", "mmu_segmentation", "paint_color"],
        "missing properties and textures; colours of volumetric data; a tile style of none where the coordinates \
         leave the texture; colours of several filaments that parts are given in a slicer, and changes of colour by \
         height. A file without any colour has no base colour",
    ),
    row(
        "3MF",
        Fate::Refused,
        &["booleanshape", "levelset", "displacementmesh", "implicitfunction"],
        "negative volumes; objects of slices (`slicestackid`, but for `meshresolution=\"fullres\"`), and those whose \
         alternative alone is of full resolution; shapes bounded by volumetric data; parts of which there are two of \
         one name; required extensions other than those read; more than 100 million triangles, or 100,000 \
         objects, once components are placed",
    ),
];

/// What becomes of the part of a format that has exactly this name; nothing is known of others.
pub(super) fn fate(format: &str, name: &str) -> Option<Fate> {
    ROWS.iter().find(|row| row.format == format && row.names.contains(&name)).map(|row| row.fate)
}

/// The tables of docs/formats.md.
#[cfg(test)]
fn markdown() -> String {
    let mut formats: Vec<&str> = ROWS.iter().map(|row| row.format).collect();
    formats.dedup();
    let mut text = String::new();
    for format in formats {
        text += &format!("| {format} | |\n| --- | --- |\n");
        for fate in Fate::ALL {
            for row in ROWS.iter().filter(|row| row.format == format && row.fate == fate) {
                let names = row.names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" ");
                let gap = if names.is_empty() || row.note.is_empty() { "" } else { "; " };
                text += &format!("| {} | {names}{gap}{} |\n", fate.word(), row.note);
            }
        }
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documentation_holds_these_tables() {
        let documentation = include_str!("../../../docs/formats.md");
        let tables = markdown();
        assert!(documentation.contains(&tables), "docs/formats.md lacks these tables:\n{tables}");
    }

    #[test]
    fn every_name_has_one_fate() {
        let mut names: Vec<_> = ROWS.iter().flat_map(|row| row.names.iter().map(|name| (row.format, *name))).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        assert_eq!(fate("glTF", "KHR_materials_"), None);
    }
}
