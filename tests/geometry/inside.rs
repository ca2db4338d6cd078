//! Inside and outside: rows through vertices and edges, damaged meshes, nested and crossing shells.

use super::support::*;
use glam::DVec3;
use lumislice::{
    mesh::{HealthReport, LoadOptions, Placement, Size, Solid, TriangleMesh, close, load, place},
    sdf::{InsideRows, SliceRuns},
    voxel::Lattice,
};

/// What the rows say about every voxel, x fastest.
fn inside(solid: &Solid, lattice: Lattice) -> Vec<bool> {
    let rows = InsideRows::new(solid, lattice, 16);
    let mut found = Vec::new();
    let mut slice = SliceRuns::default();
    for k in 0..lattice.dims[2] {
        rows.fill_slice(k, &mut slice);
        for j in 0..lattice.dims[1] {
            let row = found.len();
            found.resize(row + lattice.dims[0] as usize, false);
            for &[start, end] in slice.row(j) {
                assert!(start < end && end <= lattice.dims[0]);
                found[row + start as usize..row + end as usize].fill(true);
            }
        }
    }
    found
}

/// A solid as it stands, without the mending of [`close`].
fn as_is(triangles: &[[DVec3; 3]]) -> Solid {
    Solid { mesh: mesh_of(triangles), caps: Vec::new(), whole: None, health: HealthReport::default() }
}

/// A lattice whose voxel centres are the points of whole coordinates from 0 to `size` − 1.
fn whole_numbers(size: u32) -> Lattice {
    Lattice { origin: DVec3::splat(-0.5), pitch: DVec3::ONE, dims: [size; 3] }
}

/// Voxels clear of the surface that are misjudged, and (voxels on the surface, those of them found outside).
fn misjudged(triangles: &[[DVec3; 3]], lattice: Lattice, found: &[bool]) -> (usize, [usize; 2]) {
    let (mut wrong, mut touching) = (0, [0; 2]);
    for (index, &inside) in indices(&lattice).zip(found) {
        let p = lattice.centre(index);
        if distance(triangles, p) < 1e-9 {
            touching[0] += 1;
            touching[1] += usize::from(!inside);
        } else {
            wrong += usize::from((winding(triangles, p) > 0.5) != inside);
        }
    }
    (wrong, touching)
}

#[test]
fn an_octahedron_on_voxel_centres_is_exact() {
    let mut on_surface = 0;
    for reach in [1.0, 2.0, 4.0, 8.0] {
        // Vertices, edges and whole faces lie on voxel centres; powers of two keep the slopes free of rounding.
        let lattice = whole_numbers(18);
        let centre = DVec3::splat(8.0);
        let found = inside(&solid_of(&octahedron(centre, reach)), lattice);
        for (index, inside) in indices(&lattice).zip(found) {
            let norm = (lattice.centre(index) - centre).abs().element_sum();
            assert_eq!(inside, norm <= reach, "{index:?}, reach {reach}");
            on_surface += usize::from(norm == reach);
        }
    }
    println!("{} voxels, {on_surface} of them on the surface, 0 misjudged", 4 * 18 * 18 * 18);
}

#[test]
fn a_vertex_on_a_voxel_centre_is_inside_wherever_it_is() {
    let mut random = Random::new(6);
    for _ in 0..300 {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: j750(), dims: [40, 24, 60] };
        let voxel = [8 + random.below(24) as u32, 6 + random.below(12) as u32, 10 + random.below(40) as u32];
        let tip = lattice.centre(voxel);
        // A tetrahedron with one corner there, its others around the centre of the lattice.
        let middle = DVec3::new(0.8, 1.0, 0.8);
        let mut t = [0, 1, 2].map(|_| middle + random.vector() * 0.7);
        if (t[1] - t[0]).cross(t[2] - t[0]).dot(tip - t[0]) > 0.0 {
            t.swap(1, 2);
        }
        if (t[1] - t[0]).cross(t[2] - t[0]).dot(tip - t[0]) > -1e-3 {
            continue;
        }
        let [a, b, c] = t;
        let triangles = [[a, b, c], [a, tip, b], [b, tip, c], [c, tip, a]];
        let found = inside(&as_is(&triangles), lattice);
        let index = (voxel[0] + 40 * (voxel[1] + 24 * voxel[2])) as usize;
        assert!(found[index], "{voxel:?} of {triangles:?}");
    }
}

#[test]
fn rows_through_vertices_and_edges_do_not_leak() {
    let mut random = Random::new(7);
    let lattice = whole_numbers(12);
    let (mut voxels, mut touching) = (0, [0; 2]);
    for _ in 0..60 {
        // A union of tetrahedra with whole coordinates: rows meet corners, edges and faces exactly.
        let mut triangles = Vec::new();
        for _ in 0..1 + random.below(5) {
            let mut corner = || (random.vector() * 7.0 + 5.5).round().clamp(DVec3::ZERO, DVec3::splat(11.0));
            let [a, mut b, mut c, d] = [corner(), corner(), corner(), corner()];
            let volume = (b - a).cross(c - a).dot(d - a);
            if volume > 0.0 {
                std::mem::swap(&mut b, &mut c);
            }
            if volume != 0.0 {
                triangles.extend([[a, b, c], [a, d, b], [b, d, c], [c, d, a]]);
            }
        }
        if triangles.is_empty() {
            continue;
        }
        let found = inside(&as_is(&triangles), lattice);
        let (wrong, on_surface) = misjudged(&triangles, lattice, &found);
        assert_eq!(wrong, 0, "{triangles:?}");
        for vertex in triangles.iter().flatten() {
            let [i, j, k] = vertex.to_array().map(|v| v as usize);
            assert!(found[i + 12 * (j + 12 * k)], "vertex {vertex} of {triangles:?}");
        }
        voxels += lattice.voxels();
        touching = [touching[0] + on_surface[0], touching[1] + on_surface[1]];
    }
    println!("{voxels} voxels, {} on a surface, {} of those outside by rounding", touching[0], touching[1]);
    // Where a slanted face passes through a voxel's centre, rounding decides.
    assert!(touching[1] * 4 < touching[0]);
}

#[test]
fn a_twisted_star_does_not_leak() {
    let mut random = Random::new(8);
    let lattice = whole_numbers(14);
    let mut touching = 0;
    for _ in 0..25 {
        // A sphere whose vertices are moved to whole coordinates at random: it crosses itself.
        let mut mesh = mesh_of(&sphere(DVec3::splat(6.5), 4.0, 4));
        mesh.positions.iter_mut().for_each(|p| *p = (*p + random.vector() * 3.0).round());
        let triangles = corners(&mesh);
        let solid = Solid { mesh, caps: Vec::new(), whole: None, health: HealthReport::default() };
        let (wrong, on_surface) = misjudged(&triangles, lattice, &inside(&solid, lattice));
        assert_eq!(wrong, 0, "{triangles:?}");
        touching += on_surface[0] as u64;
    }
    println!("{} voxels clear of the surface, 0 misjudged", 25 * lattice.voxels() - touching);
}

/// A mesh to damage: positions are kept, so that the damaged one compares with it.
struct Case {
    name: &'static str,
    mesh: TriangleMesh,
    lattice: Lattice,
    clean: Vec<bool>,
}

fn cases() -> Vec<Case> {
    let mut meshes = vec![
        ("sphere", mesh_of(&sphere(DVec3::splat(5.0), 4.6, 24))),
        ("box", {
            let mut triangles = box_triangles(DVec3::splat(0.4), DVec3::new(9.3, 8.1, 7.2));
            for _ in 0..3 {
                let quarter = |[a, b, c]: [DVec3; 3]| {
                    let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                };
                triangles = triangles.into_iter().flat_map(quarter).collect();
            }
            mesh_of(&triangles)
        }),
    ];
    if let Some(path) = shared_mesh("spot/spot_triangulated.obj") {
        let loaded = load(&path, &LoadOptions::default()).unwrap();
        let placement = Placement { size: Size::HeightMm(10.0), ..Placement::default() };
        let mut mesh = place(loaded.mesh, &placement).unwrap().0;
        mesh.uvs.clear();
        meshes.push(("spot", mesh));
    }
    let case = |(name, mesh): (_, TriangleMesh)| {
        let extent = mesh.positions.iter().fold(DVec3::ZERO, |extent, p| extent.max(*p));
        let lattice = Lattice::covering(extent + 0.3, DVec3::splat(0.13)).unwrap();
        let clean = inside(&close(mesh.clone()).unwrap(), lattice);
        Case { name, mesh, lattice, clean }
    };
    meshes.into_iter().map(case).collect()
}

impl Case {
    /// Voxels that a damaged mesh is judged differently at.
    fn differences(&self, mesh: TriangleMesh) -> Vec<DVec3> {
        let found = inside(&close(mesh).unwrap(), self.lattice);
        let pairs = indices(&self.lattice).zip(found.iter().zip(&self.clean));
        pairs.filter(|(_, (a, b))| a != b).map(|(index, _)| self.lattice.centre(index)).collect()
    }

    /// The mesh with only those triangles that `keep` says.
    fn without(&self, drop: impl Fn(usize) -> bool) -> (TriangleMesh, Triangles) {
        let mut mesh = self.mesh.clone();
        let all = corners(&mesh);
        let dropped = (0..all.len()).filter(|t| drop(*t)).map(|t| all[t]).collect();
        let mut t = 0;
        mesh.triangles.retain(|_| {
            t += 1;
            !drop(t - 1)
        });
        (mesh, dropped)
    }
}

#[test]
fn turned_triangles_change_nothing() {
    for case in cases() {
        for share in [40, 6] {
            let mut random = Random::new(share as u64);
            let mut mesh = case.mesh.clone();
            for triangle in &mut mesh.triangles {
                if random.below(share) == 0 {
                    triangle.swap(1, 2);
                }
            }
            assert_eq!(case.differences(mesh), [], "{}", case.name);
        }
        // All of them: the solid is inside out.
        let mut mesh = case.mesh.clone();
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(case.differences(mesh), [], "{}", case.name);
    }
}

#[test]
fn doubled_triangles_change_nothing() {
    for case in cases() {
        let mut random = Random::new(9);
        let mut mesh = case.mesh.clone();
        for t in 0..case.mesh.triangles.len() {
            if random.below(10) == 0 {
                let [a, b, c] = mesh.triangles[t];
                mesh.triangles.push(if random.below(2) == 0 { [b, c, a] } else { [a, c, b] });
            }
        }
        assert_eq!(case.differences(mesh), [], "{}", case.name);
    }
}

#[test]
fn the_order_of_triangles_changes_nothing() {
    for case in cases() {
        let mut random = Random::new(10);
        let mut mesh = case.mesh.clone();
        for t in (1..mesh.triangles.len()).rev() {
            mesh.triangles.swap(t, random.below(t + 1));
        }
        assert_eq!(case.differences(mesh), [], "{}", case.name);
    }
}

#[test]
fn a_missing_triangle_changes_nothing() {
    for case in cases() {
        let mut random = Random::new(11);
        let gone: Vec<usize> = (0..5).map(|_| random.below(case.mesh.triangles.len())).collect();
        let (mesh, _) = case.without(|t| gone.contains(&t));
        // Neighbours may be among them; then the cap may differ from what was there, in the plane of a fan.
        let differences = case.differences(mesh);
        println!("{}: {} voxels differ for 5 missing triangles", case.name, differences.len());
        assert!(differences.len() <= 10, "{}: {differences:?}", case.name);
    }
}

#[test]
fn a_hole_changes_only_what_lies_under_it() {
    for case in cases() {
        let mut random = Random::new(12);
        let center = case.mesh.positions[random.below(case.mesh.positions.len())];
        let size = if case.name == "spot" { 0.8 } else { 1.3 };
        let all = corners(&case.mesh);
        let near: Vec<bool> = all.iter().map(|t| t.iter().any(|p| (*p - center).length() < size)).collect();
        let (mesh, dropped) = case.without(|t| near[t]);
        assert!(dropped.len() > 4);
        let differences = case.differences(mesh);
        // A cap spans the hole's border: it stays within the border's box, and so does what it changes.
        let low = dropped.iter().flatten().fold(DVec3::MAX, |low, p| low.min(*p)) - 1e-9;
        let high = dropped.iter().flatten().fold(DVec3::MIN, |high, p| high.max(*p)) + 1e-9;
        let in_box = indices(&case.lattice)
            .map(|index| case.lattice.centre(index))
            .filter(|p| p.cmpge(low).all() && p.cmple(high).all())
            .count();
        println!(
            "{}: {} voxels differ of {in_box} in the box of the {} missing triangles, {} in all",
            case.name,
            differences.len(),
            dropped.len(),
            case.clean.iter().filter(|inside| **inside).count()
        );
        assert!(differences.iter().all(|p| p.cmpge(low).all() && p.cmple(high).all()), "{}", case.name);
        assert!(differences.len() <= in_box / 2, "{}", case.name);
    }
}

#[test]
fn shells_within_shells_are_what_their_winding_says() {
    let (outer, inner) = (sphere(DVec3::splat(5.0), 4.6, 24), sphere(DVec3::new(5.3, 4.8, 5.1), 2.0, 16));
    let lattice = Lattice::covering(DVec3::splat(10.0), DVec3::splat(0.1)).unwrap();
    let solid = inside(&solid_of(&outer), lattice);
    let hollow = inside(&solid_of(&[outer.clone(), reversed(&inner)].concat()), lattice);
    let filled = inside(&solid_of(&[outer.clone(), inner.clone()].concat()), lattice);
    let ball = inside(&solid_of(&inner), lattice);
    assert_eq!(filled, solid, "a shell that faces outwards within another adds nothing");
    // Depth 0 is inside: a voxel exactly on the inner shell would be in both. There is none here.
    for ((hollow, solid), ball) in hollow.iter().zip(&solid).zip(&ball) {
        assert_eq!(*hollow, *solid && !*ball);
    }
    assert!(hollow.iter().filter(|inside| **inside).count() < solid.iter().filter(|inside| **inside).count());
}

#[test]
fn crossing_spheres_are_their_union() {
    let (a, b, radius) = (DVec3::new(4.0, 4.0, 4.0), DVec3::new(6.1, 5.2, 4.7), 3.0);
    let (first, second) = (sphere(a, radius, 40), sphere(b, radius, 40));
    let lattice = Lattice::covering(DVec3::splat(10.0), DVec3::splat(0.1)).unwrap();
    let union = inside(&solid_of(&[first.clone(), second.clone()].concat()), lattice);
    let parts = [inside(&solid_of(&first), lattice), inside(&solid_of(&second), lattice)];
    for (n, found) in union.iter().enumerate() {
        assert_eq!(*found, parts[0][n] || parts[1][n]);
    }
}
