//! Objects that touch or overlap are one body: every voxel has the layers of the object whose face is nearest, at its
//! depth below the surface of them all.
//!
//! The referee has the surface of all of them as one mesh, and asks every triangle of it.

use glam::{DMat3, DVec3};
use lumislice::{
    appearance::{LayerField, LayerStack},
    mesh::{InCommon, Solid, unite},
    sdf::closest_point,
    slice::{DistanceKind, ObjectField, Slicer, join},
    voxel::{Lattice, MaterialId},
};

use crate::support::{Random, Triangles, box_triangles, corners, distance, indices, solid_of, sphere, voxels, winding};

/// Depths and places that are as near as this may be either.
const SLACK: f64 = 2e-5;

/// Layers of ids that are the object's own, and none thicker than half a millimetre.
fn layers(object: usize) -> LayerStack {
    let id = |n: usize| MaterialId((10 * object + n) as u8 + 1);
    let thick = 0.1 * object as f64;
    LayerStack::new([(id(0), 0.3 + thick), (id(1), 0.45), (id(2), 0.2 + thick)], id(3))
}

fn lattice(pitch: f64) -> Lattice {
    Lattice { origin: DVec3::ZERO, pitch: DVec3::new(pitch, 1.1 * pitch, 0.9 * pitch), dims: [64, 58, 70] }
}

/// The objects on the lattice, as a job lays them; and which are one body.
fn slicer(bodies: &[Triangles], lattice: Lattice, kind: DistanceKind) -> (Slicer, InCommon) {
    let mut solids: Vec<Solid> = bodies.iter().map(|body| solid_of(body)).collect();
    let found = unite(&mut solids.iter_mut().collect::<Vec<_>>());
    let field = |(n, solid): (usize, &Solid)| {
        ObjectField::new(solid, lattice, LayerField::Uniform(layers(n))).expect("some of every object can be seen")
    };
    let mut fields: Vec<_> = solids.iter().enumerate().map(field).collect();
    join(&mut fields, &found.bodies);
    let fields = fields.into_iter().map(|field| field.with_distance(kind)).collect();
    (Slicer::new(lattice, fields), found)
}

/// What may lie at `p`: every object that has a face as near as any, at every depth that may be.
fn may_be(p: DVec3, bodies: &[Triangles], surface: &[[DVec3; 3]]) -> Vec<u8> {
    let depth = distance(surface, p);
    let mut found = Vec::new();
    for triangle in surface {
        let nearest = closest_point(p, triangle);
        if nearest.distance_squared.sqrt() > depth + SLACK {
            continue;
        }
        let on = |body: &Triangles| distance(body, nearest.point) < SLACK;
        for owner in (0..bodies.len()).filter(|&n| on(&bodies[n])) {
            found.extend([-SLACK, SLACK].map(|off| layers(owner).material((depth + off).max(0.0), 0).0));
        }
    }
    found
}

/// Holds every `step`th voxel against the referee; how many of them lie inside.
fn check(name: &str, bodies: &[Triangles], step: usize) -> usize {
    let lattice = lattice(0.137);
    let (slicer, _) = slicer(bodies, lattice, DistanceKind::Exact);
    let whole = solid_of(&bodies.concat());
    let surface = corners(&whole.mesh);
    let (mut inside, mut wrong) = (0, Vec::new());
    for (at, id) in indices(&lattice).zip(voxels(&slicer)).step_by(step) {
        let p = lattice.centre(at);
        if distance(&surface, p) < SLACK {
            continue;
        }
        if !bodies.iter().any(|body| winding(body, p) > 0.5) {
            assert_eq!(id, 0, "{name}: {at:?} lies outside");
            continue;
        }
        inside += 1;
        let expected = may_be(p, bodies, &surface);
        if !expected.contains(&id) {
            wrong.push((at, id, expected));
        }
    }
    assert!(wrong.is_empty(), "{name}: {} of {inside} voxels are wrong: {:?}", wrong.len(), &wrong[..1]);
    inside
}

fn cuboid(low: [f64; 3], high: [f64; 3]) -> Triangles {
    box_triangles(DVec3::from(low), DVec3::from(high))
}

#[test]
fn touching_and_overlapping_objects_are_one_body() {
    let row = [0.5, 2.9, 5.1].map(|x| cuboid([x, 0.4, 0.5], [x + if x < 2.0 { 2.4 } else { 2.2 }, 3.6, 3.9]));
    let l = [cuboid([0.3, 0.3, 0.3], [6.2, 2.1, 3.0]), cuboid([0.3, 2.1, 0.3], [2.2, 6.0, 4.4])];
    let plate = [cuboid([0.4, 0.4, 0.4], [6.5, 6.1, 3.6]), cuboid([1.5, 1.7, 3.6], [5.0, 4.9, 3.85])];
    let spheres = [sphere(DVec3::new(2.4, 3.0, 3.0), 2.1, 10), sphere(DVec3::new(4.9, 3.3, 3.2), 1.7, 9)];
    let seated = [cuboid([0.4, 0.4, 0.4], [6.5, 6.1, 2.6]), sphere(DVec3::new(3.2, 3.1, 3.4), 1.4, 9)];
    for (name, bodies) in
        [("row", &row[..]), ("L", &l), ("plate", &plate), ("spheres", &spheres), ("ball in a block", &seated)]
    {
        assert!(check(name, bodies, 7) > 2_000);
    }
}

/// Boxes between whole numbers, which share planes and edges, and some turned ones and balls.
#[test]
fn random_objects_are_one_body() {
    let mut random = Random::new(12);
    let mut tried = 0;
    while tried < 10 {
        let mut bodies: Vec<Triangles> = (0..2 + random.below(3))
            .map(|_| match random.below(4) {
                0 => sphere(DVec3::splat(4.0) + 1.5 * random.vector(), random.between(1.0, 2.0), 6),
                1 => {
                    let (turn, at) = (random.rotation(), DVec3::splat(4.0) + 1.5 * random.vector());
                    box_triangles(DVec3::splat(-1.3), DVec3::splat(1.4))
                        .iter()
                        .map(|t| t.map(|p| turn * p + at))
                        .collect()
                }
                _ => {
                    let low = DVec3::from([0; 3].map(|_| 1.0 + random.below(4) as f64));
                    box_triangles(low, low + DVec3::from([0; 3].map(|_| 1.0 + random.below(3) as f64)))
                }
            })
            .collect();
        let turn = DMat3::from_rotation_z(if random.below(2) == 0 { 0.0 } else { 0.1 });
        bodies.iter_mut().flatten().flatten().for_each(|p| *p = turn * *p + DVec3::X);
        let mut solids: Vec<Solid> = bodies.iter().map(|body| solid_of(body)).collect();
        unite(&mut solids.iter_mut().collect::<Vec<_>>());
        if solids.iter().all(|solid| !solid.mesh.triangles.is_empty()) {
            check(&format!("set {tried}"), &bodies, 31);
            tried += 1;
        }
    }
}

/// With layers that are the same for all, a body of several objects is what one mesh of it is, by every distance.
#[test]
fn a_body_of_alike_objects_is_what_one_mesh_is() {
    let parts = [0.5, 2.9, 5.1].map(|x| cuboid([x, 0.4, 0.5], [x + if x < 2.0 { 2.4 } else { 2.2 }, 3.6, 3.9]));
    let whole = cuboid([0.5, 0.4, 0.5], [7.3, 3.6, 3.9]);
    let lattice = lattice(0.137);
    for kind in [DistanceKind::Exact, DistanceKind::Grid, DistanceKind::Lp { exponent: 6.0 }] {
        let alike = |bodies: &[Triangles]| {
            let mut solids: Vec<Solid> = bodies.iter().map(|body| solid_of(body)).collect();
            let groups = unite(&mut solids.iter_mut().collect::<Vec<_>>()).bodies;
            let field = |solid: &Solid| ObjectField::new(solid, lattice, LayerField::Uniform(layers(0))).unwrap();
            let mut fields: Vec<_> = solids.iter().map(field).collect();
            join(&mut fields, &groups);
            voxels(&Slicer::new(lattice, fields.into_iter().map(|field| field.with_distance(kind)).collect()))
        };
        let (one, several) = (alike(std::slice::from_ref(&whole)), alike(&parts));
        let differ = one.iter().zip(&several).filter(|(a, b)| a != b).count();
        // By weight 1/r⁶ the whole's few large triangles and the parts' many are the same surface but for rounding.
        assert!(
            differ <= if kind == (DistanceKind::Lp { exponent: 6.0 }) { 3 } else { 0 },
            "{kind:?}: {differ} differ"
        );
    }
}

#[test]
fn only_what_touches_is_one_body() {
    let apart = [cuboid([0.5; 3], [2.0; 3]), cuboid([2.5, 0.5, 0.5], [4.0, 2.0, 2.0])];
    let edge = [cuboid([0.5; 3], [2.0; 3]), cuboid([2.0, 2.0, 0.5], [4.0, 4.0, 2.0])];
    let frame = [cuboid([0.5; 3], [6.0; 3]), cuboid([1.0; 3], [5.5; 3])];
    let hollow: Triangles = frame[0].iter().copied().chain(frame[1].iter().map(|&[a, b, c]| [a, c, b])).collect();
    let within = [hollow, cuboid([2.0; 3], [4.0; 3])];
    for bodies in [&apart, &edge, &within] {
        assert_eq!(slicer(bodies, lattice(0.2), DistanceKind::Exact).1, InCommon::default());
    }
    let row = [cuboid([0.5; 3], [2.0; 3]), apart[1].clone(), cuboid([2.0, 0.5, 0.5], [2.5, 2.0, 2.0])];
    let found = slicer(&row, lattice(0.2), DistanceKind::Exact).1;
    assert_eq!(found, InCommon { space: vec![], bodies: vec![vec![0, 1, 2]] });
}
