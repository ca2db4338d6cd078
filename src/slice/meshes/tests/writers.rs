//! What is written reads back.

use std::io::Cursor;

use glam::DVec3;

use super::*;
use crate::{
    mesh::{LoadOptions, load},
    slice::meshes::{write_3mf, write_stl},
};

fn ball() -> MaterialMeshes {
    let size = DVec3::splat(4.0);
    let slicer = slicer(vec![(sphere(size / 2.0, 2.0, 16), stack(&[(WHITE, 0.8)], BLACK))], size, 0.4);
    mesh(&slicer, 0.4, &[WHITE, SUPPORT, BLACK])
}

fn corners(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[[u64; 3]; 3]> {
    triangles.iter().map(|t| t.map(|v| positions[v as usize].to_array().map(f64::to_bits))).collect()
}

#[test]
fn an_stl_reads_back() {
    let meshes = ball();
    let folder = tempfile::tempdir().unwrap();
    let wide: Vec<_> = meshes.positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    for part in [0, 2].map(|n| &meshes.parts[n]) {
        let mut bytes = Vec::new();
        write_stl(&meshes, part, &mut bytes).unwrap();
        assert_eq!(bytes.len(), 84 + 50 * part.triangles.len());
        assert!(bytes.starts_with(b"lumislice material mesh; unit mm; "));
        let path = folder.path().join("part.stl");
        std::fs::write(&path, &bytes).unwrap();
        let read = load(&path, &LoadOptions::default()).unwrap().mesh;
        assert_eq!(corners(&read.positions, &read.triangles), corners(&wide, &part.triangles));
        assert_closed(read.triangles, "the mesh read back");
    }
}

#[test]
fn a_3mf_reads_back_and_is_the_same_every_time() {
    let mut meshes = ball();
    meshes.parts[0].name = "white & <warm>".to_owned();
    let mut palette = [[0; 4]; 256];
    palette[1] = [255, 250, 240, 255];
    let write = || {
        let mut bytes = Cursor::new(Vec::new());
        write_3mf(&meshes, &palette, &mut bytes).unwrap();
        bytes.into_inner()
    };
    let bytes = write();
    assert_eq!(bytes, write());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("assembly.3mf");
    std::fs::write(&path, &bytes).unwrap();
    let read = load(&path, &LoadOptions::default()).unwrap().mesh;
    let count: usize = meshes.parts.iter().map(|part| part.triangles.len()).sum();
    assert_eq!(read.triangles.len(), count);
    assert!(read.materials.iter().any(|material| material.name == "white & <warm>"));
    let wide: Vec<_> = meshes.positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    let all: Vec<_> = meshes.parts.iter().flat_map(|part| part.triangles.iter().copied()).collect();
    assert_eq!(corners(&read.positions, &read.triangles), corners(&wide, &all));
}
