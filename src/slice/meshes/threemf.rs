//! One 3MF assembly: a mesh object per material with its colour, held together by components.
//!
//! 3MF Core Specification 1.3: base materials (section 5), mesh objects (4.1), components (4.2); Open Packaging
//! Conventions for the zip.

use std::io::{self, Seek, Write};

use quick_xml::escape::escape;
use zip::{CompressionMethod, DateTime, ZipWriter, write::SimpleFileOptions};

use super::{MaterialMeshes, MaterialPart};
use crate::slice::Palette;

const CONTENT_TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>
"#;

const RELATIONSHIPS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>
"#;

/// Resource number of the base materials; the objects follow.
const MATERIALS: usize = 1;

/// Writes all parts that have triangles as one assembly, in the colours of `palette`. The bytes depend on the
/// arguments alone.
///
/// # Errors
/// Those of `out`.
pub fn write_3mf(meshes: &MaterialMeshes, palette: &Palette, out: impl Write + Seek) -> io::Result<()> {
    let mut zip = ZipWriter::new(out);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .large_file(true);
    for (name, content) in [("[Content_Types].xml", CONTENT_TYPES), ("_rels/.rels", RELATIONSHIPS)] {
        zip.start_file(name, options)?;
        zip.write_all(content.as_bytes())?;
    }
    zip.start_file("3D/3dmodel.model", options)?;
    write_model(meshes, palette, &mut io::BufWriter::with_capacity(1 << 16, &mut zip))?;
    zip.finish()?.flush()
}

fn write_model(meshes: &MaterialMeshes, palette: &Palette, out: &mut impl Write) -> io::Result<()> {
    let parts: Vec<_> = meshes.parts.iter().filter(|part| !part.triangles.is_empty()).collect();
    writeln!(out, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
    writeln!(
        out,
        r#"<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">"#
    )?;
    writeln!(out, r#"<metadata name="Application">lumislice</metadata>"#)?;
    writeln!(out, r#"<resources>"#)?;
    if !parts.is_empty() {
        writeln!(out, r#"<basematerials id="{MATERIALS}">"#)?;
        for part in &parts {
            let [r, g, b, a] = palette[usize::from(part.id.0)];
            let name = escape(&part.name);
            writeln!(out, "<base name=\"{name}\" displaycolor=\"#{r:02X}{g:02X}{b:02X}{a:02X}\"/>")?;
        }
        writeln!(out, "</basematerials>")?;
    }
    let mut numbers = vec![u32::MAX; meshes.positions.len()];
    for (index, part) in parts.iter().enumerate() {
        let (id, name) = (MATERIALS + 1 + index, escape(&part.name));
        writeln!(out, r#"<object id="{id}" type="model" name="{name}" pid="{MATERIALS}" pindex="{index}">"#)?;
        write_mesh(meshes, part, &mut numbers, out)?;
        writeln!(out, "</object>")?;
    }
    let assembly = MATERIALS + 1 + parts.len();
    if !parts.is_empty() {
        writeln!(out, r#"<object id="{assembly}" type="model" name="assembly"><components>"#)?;
        for index in 0..parts.len() {
            writeln!(out, r#"<component objectid="{}"/>"#, MATERIALS + 1 + index)?;
        }
        writeln!(out, "</components></object>")?;
    }
    writeln!(out, "</resources>")?;
    if parts.is_empty() {
        writeln!(out, "<build/>")?;
    } else {
        writeln!(out, r#"<build><item objectid="{assembly}"/></build>"#)?;
    }
    writeln!(out, "</model>")?;
    out.flush()
}

/// Writes the mesh of one part; `numbers` has an entry per vertex of the pool, all `u32::MAX` before and after.
fn write_mesh(
    meshes: &MaterialMeshes,
    part: &MaterialPart,
    numbers: &mut [u32],
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "<mesh><vertices>")?;
    let mut next = 0;
    for &vertex in part.triangles.iter().flatten() {
        let number = &mut numbers[vertex as usize];
        if *number == u32::MAX {
            *number = next;
            next += 1;
            let [x, y, z] = meshes.positions[vertex as usize];
            writeln!(out, r#"<vertex x="{x}" y="{y}" z="{z}"/>"#)?;
        }
    }
    writeln!(out, "</vertices><triangles>")?;
    for triangle in &part.triangles {
        let [a, b, c] = triangle.map(|vertex| numbers[vertex as usize]);
        writeln!(out, r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#)?;
    }
    writeln!(out, "</triangles></mesh>")?;
    for &vertex in part.triangles.iter().flatten() {
        numbers[vertex as usize] = u32::MAX;
    }
    Ok(())
}
