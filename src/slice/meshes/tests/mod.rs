//! Laws of material meshes.

mod cells;
mod shapes;
mod shared;
mod simplified;
mod textured;
mod writers;

use std::collections::{BTreeSet, HashMap};

use glam::{DVec3, Vec2};

use super::{MaterialMesher, MaterialMeshes};
use crate::test_shapes::{box_triangles, indexed};
use crate::{
    appearance::{LayerField, LayerStack, SlotTable, align},
    mesh::{HealthReport, Solid, TriangleMesh},
    optics::{ResinId, Stack},
    slice::{ObjectField, Slicer},
    voxel::{Lattice, MaterialId},
    watch::Unwatched,
};

/// Checks that every directed edge has its reverse exactly once.
fn assert_closed(triangles: impl IntoIterator<Item = [u32; 3]>, what: &str) {
    let mut edges = HashMap::new();
    for [a, b, c] in triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0_u32) += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(count, 1, "{what}: edge {a}–{b} runs {count} times in one direction");
        assert!(edges.contains_key(&(b, a)), "{what}: edge {a}–{b} has no reverse");
    }
}

/// The laws of every result: closed, vertices shared and apart, triangles with area.
fn assert_sound(meshes: &MaterialMeshes) {
    for part in &meshes.parts {
        assert_closed(part.triangles.iter().copied(), &part.name);
        let used: BTreeSet<u32> = part.triangles.iter().flatten().copied().collect();
        let places: BTreeSet<_> = used.iter().map(|&v| meshes.positions[v as usize].map(f32::to_bits)).collect();
        assert_eq!(used.len(), places.len(), "{}: two vertices in one place", part.name);
        for triangle in &part.triangles {
            let [a, b, c] = triangle.map(|v| DVec3::from(meshes.positions[v as usize].map(f64::from)));
            assert!((b - a).cross(c - a).length() > 0.0, "{}: a triangle without area", part.name);
        }
        assert!(part.triangles.is_empty() || part.volume_mm3 > 0.0, "{}: turned inside out", part.name);
    }
}

/// Where materials a and b meet, every triangle of the one is the reverse of one of the other. Returns the triangles
/// that remain, which border on voids.
fn outer_triangles(meshes: &MaterialMeshes) -> Vec<[u32; 3]> {
    let canonical = |[a, b, c]: [u32; 3]| {
        let first = a.min(b).min(c);
        if first == a {
            [a, b, c]
        } else if first == b {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    let all: BTreeSet<_> = meshes.parts.iter().flat_map(|part| part.triangles.iter().map(|t| canonical(*t))).collect();
    let count: usize = meshes.parts.iter().map(|part| part.triangles.len()).sum();
    assert_eq!(all.len(), count, "two materials have the same triangle");
    all.iter().copied().filter(|&[a, b, c]| !all.contains(&canonical([a, c, b]))).collect()
}

/// A closed mesh as a solid.
fn solid(mesh: TriangleMesh) -> Solid {
    Solid { mesh, caps: Vec::new(), whole: None, health: HealthReport::default() }
}

/// A box.
fn cuboid(low: DVec3, high: DVec3) -> TriangleMesh {
    let (positions, triangles) = indexed(&box_triangles(low, high));
    TriangleMesh { positions, triangles, ..Default::default() }
}

/// A sphere of stacks and slices, with longitude and latitude as texture coordinates.
fn sphere(centre: DVec3, radius: f64, stacks: u32) -> TriangleMesh {
    let slices = 2 * stacks;
    let mut mesh = TriangleMesh::default();
    let angle = std::f64::consts::PI / f64::from(stacks);
    mesh.positions.push(centre - DVec3::Z * radius);
    for stack in 1..stacks {
        for slice in 0..slices {
            let (polar, azimuth) = (f64::from(stack) * angle, f64::from(slice) * angle);
            let direction = DVec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), -polar.cos());
            mesh.positions.push(centre + direction * radius);
        }
    }
    mesh.positions.push(centre + DVec3::Z * radius);
    let (south, north) = (0, mesh.positions.len() as u32 - 1);
    let at = |stack: u32, slice: u32| 1 + (stack - 1) * slices + slice % slices;
    let vertex = |(stack, slice): (u32, u32)| match stack {
        0 => south,
        n if n == stacks => north,
        n => at(n, slice),
    };
    let uv = |(stack, slice): (u32, u32)| Vec2::new(slice as f32 / slices as f32, stack as f32 / stacks as f32);
    for stack in 0..stacks {
        for slice in 0..slices {
            let [a, b] = [(stack, slice), (stack, slice + 1)];
            let [c, d] = [(stack + 1, slice), (stack + 1, slice + 1)];
            let lower = (stack > 0).then_some([a, b, d]);
            let upper = (stack + 1 < stacks).then_some([a, d, c]);
            for corners in lower.into_iter().chain(upper) {
                mesh.triangles.push(corners.map(vertex));
                mesh.uvs.push(corners.map(uv));
            }
        }
    }
    mesh
}

const WHITE: MaterialId = MaterialId(1);
const SUPPORT: MaterialId = MaterialId(2);
const BLACK: MaterialId = MaterialId(3);
const CYAN: MaterialId = MaterialId(4);

fn resins(ids: &[MaterialId]) -> Vec<(MaterialId, String)> {
    ids.iter().map(|&id| (id, ["air", "white", "support", "black", "cyan"][usize::from(id.0)].to_owned())).collect()
}

fn stack(layers: &[(MaterialId, f64)], core: MaterialId) -> LayerField {
    LayerField::Uniform(LayerStack::new(layers.iter().copied(), core))
}

/// Three stackings that share no layer, over cyan.
fn three_stackings() -> SlotTable {
    // Resins by index: 0 white, 1 support, 2 black.
    let of = |layers: &[(usize, f64)]| Stack::new(layers.iter().map(|&(resin, mm)| (ResinId(resin), mm)));
    let stackings = align(&[of(&[(0, 0.4), (1, 1.2), (0, 0.6)]), of(&[(0, 0.8), (2, 0.7)]), of(&[(2, 0.5), (1, 0.5)])]);
    let ids: Vec<_> = stackings.sequence.iter().map(|resin| MaterialId::from_resin(resin.0)).collect();
    SlotTable::new(&ids, &stackings, &[], CYAN).unwrap()
}

/// Objects on a lattice of cubic voxels that covers `extent`.
fn slicer(objects: Vec<(TriangleMesh, LayerField)>, extent: DVec3, voxel_mm: f64) -> Slicer {
    let lattice = Lattice::covering(extent, DVec3::splat(voxel_mm)).unwrap();
    let objects =
        objects.into_iter().map(|(mesh, layers)| ObjectField::new(&solid(mesh), lattice, layers).unwrap()).collect();
    Slicer::new(lattice, objects)
}

/// Volume of every id's voxels, mm³.
fn voxel_volumes(slicer: &Slicer) -> [f64; 256] {
    let lattice = *slicer.lattice();
    let mut counts = [0_u64; 256];
    let mut row = vec![0; lattice.dims[0] as usize];
    slicer
        .for_each_slab(0..lattice.dims[2], |slab| -> Result<(), std::convert::Infallible> {
            for k in slab.slices() {
                for j in 0..lattice.dims[1] {
                    slab.read_row(j, k, &mut row);
                    row.iter().for_each(|&id| counts[usize::from(id)] += 1);
                }
            }
            Ok(())
        })
        .unwrap();
    counts.map(|count| count as f64 * lattice.voxel_volume())
}

fn mesh(slicer: &Slicer, pitch_mm: f64, ids: &[MaterialId]) -> MaterialMeshes {
    simplified(slicer, pitch_mm, 0.0, ids)
}

fn simplified(slicer: &Slicer, pitch_mm: f64, error_mm: f64, ids: &[MaterialId]) -> MaterialMeshes {
    MaterialMesher { pitch_mm, error_mm }.mesh(slicer.objects(), &resins(ids), &Unwatched).unwrap()
}

/// Checks every part's volume against its voxels; prints the deviations.
fn assert_volumes(meshes: &MaterialMeshes, slicer: &Slicer, tolerance: f64) {
    let voxels = voxel_volumes(slicer);
    for part in &meshes.parts {
        let expected = voxels[usize::from(part.id.0)];
        let deviation = part.volume_mm3 / expected - 1.0;
        println!(
            "{}: {} triangles, {:.4} mm³, voxels {expected:.4} mm³, {:+.3}%",
            part.name,
            part.triangles.len(),
            part.volume_mm3,
            100.0 * deviation
        );
        assert!(deviation.abs() < tolerance, "{}: off by {:.2}%", part.name, 100.0 * deviation);
    }
}
