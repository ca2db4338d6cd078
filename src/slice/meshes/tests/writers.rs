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

/// The corners of a mesh that was read, in the precision they were written in.
pub(super) fn read_corners(mesh: &TriangleMesh) -> Vec<[[f32; 3]; 3]> {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize].as_vec3().to_array())).collect()
}

pub(super) fn corners(meshes: &MaterialMeshes, part: usize) -> Vec<[[f32; 3]; 3]> {
    meshes.parts[part].triangles.iter().map(|t| t.map(|v| meshes.positions[v as usize])).collect()
}

#[test]
fn an_stl_reads_back() {
    let meshes = ball();
    let folder = tempfile::tempdir().unwrap();
    for n in [0, 2] {
        let part = &meshes.parts[n];
        let mut bytes = Vec::new();
        write_stl(&meshes, part, &mut bytes).unwrap();
        assert_eq!(bytes.len(), 84 + 50 * part.triangles.len());
        assert!(bytes.starts_with(b"lumislice material mesh; unit mm; "));
        let path = folder.path().join("part.stl");
        std::fs::write(&path, &bytes).unwrap();
        let read = load(&path, &LoadOptions::default()).unwrap().mesh;
        assert!(read_corners(&read) == corners(&meshes, n), "{} differs", part.name);
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
    assert!(read.materials.iter().any(|material| material.name == "white & <warm>"));
    let all = [corners(&meshes, 0), corners(&meshes, 2)].concat();
    assert!(read_corners(&read) == all, "the assembly differs");
}
