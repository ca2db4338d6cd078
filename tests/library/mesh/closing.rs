//! What closing decides: orientation, cavities, walls, sheets; and what it counts.

use glam::DVec3;
use lumislice::mesh::{HealthReport, MeshError, Solid, close};

use super::shapes::{box_triangles, box_uvs, corners, mesh_of, reversed, sphere};

fn closed(triangles: &[[DVec3; 3]]) -> Solid {
    close(mesh_of(triangles)).unwrap()
}

fn cube(low: f64, high: f64) -> Vec<[DVec3; 3]> {
    box_triangles(DVec3::splat(low), DVec3::splat(high))
}

fn shifted(triangles: &[[DVec3; 3]], by: DVec3) -> Vec<[DVec3; 3]> {
    triangles.iter().map(|t| t.map(|p| p + by)).collect()
}

#[test]
fn a_sound_mesh_stays_as_it_is() {
    let triangles = sphere(DVec3::splat(3.0), 2.0, 12);
    let mesh = mesh_of(&triangles);
    let solid = close(mesh.clone()).unwrap();
    assert_eq!((solid.mesh.positions, solid.mesh.triangles), (mesh.positions, mesh.triangles));
    assert_eq!(solid.health.warnings(), Vec::<String>::new());
    let analytic = 4.0 / 3.0 * std::f64::consts::PI * 8.0;
    assert!((solid.health.volume_mm3 / analytic - 1.0).abs() < 0.03);
}

#[test]
fn a_flipped_triangle_turns_back_with_its_coordinates() {
    let mut mesh = mesh_of(&cube(0.0, 1.0));
    mesh.uvs = box_uvs();
    let sound = mesh.clone();
    for t in [3, 4, 7] {
        mesh.triangles[t].swap(1, 2);
        mesh.uvs[t].swap(1, 2);
    }
    let solid = close(mesh).unwrap();
    assert_eq!((solid.mesh.triangles, solid.mesh.uvs), (sound.triangles, sound.uvs));
    assert_eq!(solid.health.flipped_triangles, 3);
}

#[test]
fn cavities_stay_and_mistakes_turn() {
    let (outer, inner) = (cube(0.0, 10.0), cube(3.0, 5.0));
    let far = shifted(&inner, DVec3::X * 20.0);
    let cases = [
        ("cavity", [outer.clone(), reversed(&inner)].concat(), 1000.0 - 8.0, 0),
        ("all inside out", reversed(&[outer.clone(), reversed(&inner)].concat()), 1000.0 - 8.0, 2),
        ("solid in solid", [outer.clone(), inner.clone()].concat(), 1000.0, 0),
        ("stray one inside out", [outer.clone(), reversed(&far)].concat(), 1000.0 + 8.0, 1),
        ("main one inside out", [reversed(&outer), far.clone()].concat(), 1000.0 + 8.0, 1),
    ];
    for (name, triangles, volume, turned) in cases {
        let solid = closed(&triangles);
        assert!((solid.health.volume_mm3 - volume).abs() < 1e-9, "{name}: {}", solid.health.volume_mm3);
        assert_eq!((solid.health.turned_shells, solid.health.shells), (turned, 2), "{name}");
    }
}

/// What faces inwards is judged by where most of it lies, whatever the order of its triangles.
#[test]
fn pockets_and_cavities_that_meet_are_judged_by_most_of_their_faces() {
    let body = cube(0.0, 4.0);
    let of = |low: [f64; 3], high: [f64; 3]| reversed(&box_triangles(low.into(), high.into()));
    for (name, parts, volume) in [
        ("pocket", vec![of([1.0, 1.0, 2.0], [3.0, 3.0, 4.0])], 64.0 - 8.0),
        ("hole", vec![of([1.0, 1.0, 0.0], [3.0, 3.0, 4.0])], 64.0 - 16.0),
        ("pocket that sticks out", vec![of([1.0, 1.0, 2.0], [3.0, 3.0, 5.0])], 64.0 - 8.0),
        ("body inside out", vec![of([3.0, 1.0, 1.0], [7.0, 3.0, 3.0])], 64.0 + 12.0),
        ("cavities", vec![of([1.0; 3], [2.5; 3]), of([2.0; 3], [3.0; 3])], 64.0 - 1.5f64.powi(3) - 1.0 + 0.125),
    ] {
        for first in 0..12 {
            let turned = parts.iter().flat_map(|part| [&part[first..], &part[..first]].concat());
            let triangles: Vec<_> = body.iter().copied().chain(turned).collect();
            let found = closed(&triangles).health.volume_mm3;
            assert!((found - volume).abs() < 1e-9, "{name}, from triangle {first}: {found}");
        }
    }
}

/// A wall whose edges are edges of the body: three triangles meet there.
#[test]
fn walls_that_share_their_rims_with_a_body_are_no_surface() {
    let body = || cube(0.0, 4.0);
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    // Along the diagonals that the faces below and above are split by.
    let wall = |x: [f64; 2], y: [f64; 2]| {
        let [a, b, c, d] = [at(x[0], y[0], 0.0), at(x[1], y[1], 0.0), at(x[1], y[1], 4.0), at(x[0], y[0], 4.0)];
        vec![[a, b, c], [a, c, d]]
    };
    // A body whose lower and upper face are split at their middle, so that two walls may cross there.
    let split = || {
        let mut faces: Vec<_> = body().into_iter().filter(|t| t.iter().any(|p| p.z != t[0].z)).collect();
        for (z, turns) in [(0.0, false), (4.0, true)] {
            let rim = [at(0.0, 0.0, z), at(4.0, 0.0, z), at(4.0, 4.0, z), at(0.0, 4.0, z)];
            let fan = (0..4).map(|i| [at(2.0, 2.0, z), rim[i], rim[(i + 1) % 4]]);
            faces.extend(fan.map(|[a, b, c]| if turns { [a, b, c] } else { [a, c, b] }));
        }
        faces
    };
    let quarters = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[x, y]| wall([2.0, x], [2.0, y]));
    let diagonal = wall([0.0, 4.0], [0.0, 4.0]);
    for (name, triangles, walls) in [
        ("one", [body(), diagonal.clone()].concat(), 32.0f64.sqrt() * 4.0),
        ("the other way round", [reversed(&diagonal), body()].concat(), 32.0f64.sqrt() * 4.0),
        ("half a cross", [split(), quarters[0].clone(), quarters[1].clone()].concat(), 8.0f64.sqrt() * 8.0),
        ("a cross", [split(), quarters.concat()].concat(), 8.0f64.sqrt() * 16.0),
        ("none", split(), 0.0),
    ] {
        let health = closed(&triangles).health;
        assert!((health.volume_mm3 - 64.0).abs() < 1e-9, "{name}: {health:?}");
        assert!(
            (health.area_mm2 - 96.0).abs() < 1e-9 && (health.buried_area_mm2 - walls).abs() < 1e-9,
            "{name}: {health:?}"
        );
        assert_eq!((health.holes, health.caps), (0, 0), "{name}: {health:?}");
    }
}

/// A face of the body drawn again with its other diagonal, facing either way.
#[test]
fn faces_drawn_again_on_others_go() {
    let body = cube(0.0, 4.0);
    let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 4.0));
    for again in [vec![[a, b, c], [a, c, d]], vec![[b, c, d], [b, d, a]]] {
        for again in [reversed(&again), again] {
            for triangles in [[body.clone(), again.clone()].concat(), [again.clone(), body.clone()].concat()] {
                let health = closed(&triangles).health;
                assert!((health.volume_mm3 - 64.0).abs() < 1e-9 && (health.area_mm2 - 96.0).abs() < 1e-9, "{health:?}");
                assert_eq!(health.holes, 0);
            }
        }
    }
}

/// A box whose upper face dips below its lower one, so that edges cross edges and no edge crosses a face.
#[test]
fn faces_that_cross_at_edges_alone_are_met() {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let low = [at(0.0, 0.0, 0.0), at(4.0, 0.0, 0.0), at(4.0, 4.0, 0.0), at(0.0, 4.0, 0.0)];
    let high = [at(0.0, 0.0, 2.0), at(4.0, 0.0, 2.0), at(4.0, 4.0, -1.0), at(0.0, 4.0, -1.0)];
    let mut faces = vec![[low[0], low[2], low[1]], [low[0], low[3], low[2]]];
    faces.extend([[high[0], high[1], high[2]], [high[0], high[2], high[3]]]);
    for i in 0..4 {
        let j = (i + 1) % 4;
        faces.extend([[low[i], low[j], high[j]], [low[i], high[j], high[i]]]);
    }
    let health = closed(&faces).health;
    assert!(health.inside_out && health.buried_area_mm2 > 1.0, "{health:?}");
    // A wedge 8/3 long.
    assert!((health.volume_mm3 - 0.5 * 2.0 * 8.0 / 3.0 * 4.0).abs() < 1e-6, "{health:?}");
}

#[test]
fn a_solid_in_a_cavity_in_a_solid() {
    let triangles = [cube(0.0, 10.0), reversed(&cube(1.0, 9.0)), cube(2.0, 8.0), reversed(&cube(3.0, 7.0))].concat();
    let solid = closed(&triangles);
    assert!((solid.health.volume_mm3 - (1000.0 - 512.0 + 216.0 - 64.0)).abs() < 1e-9);
    assert_eq!(solid.health.turned_shells, 0);
}

#[test]
fn a_wall_between_two_boxes_goes_and_a_doubled_face_stays() {
    let left = cube(0.0, 1.0);
    let both = [left.clone(), shifted(&left, DVec3::X)].concat();
    // The second box's face at x = 1 has the other diagonal unless it is a mirror image; make it one.
    let mirror: Vec<_> = left.iter().map(|&[a, b, c]| [a, c, b].map(|p| DVec3::new(2.0 - p.x, p.y, p.z))).collect();
    let walled = closed(&[left.clone(), mirror].concat());
    assert_eq!((walled.health.doubled_triangles, walled.mesh.triangles.len()), (4, 20));
    assert_eq!((walled.health.holes, walled.health.non_manifold_edges), (0, 0));
    assert!((walled.health.volume_mm3 - 2.0).abs() < 1e-12);
    assert!((closed(&both).health.volume_mm3 - 2.0).abs() < 1e-12);

    let mut doubled = left.clone();
    doubled.extend(reversed(&left[4..5]));
    doubled.extend([left[9], left[9]]);
    let solid = closed(&doubled);
    assert_eq!((solid.health.doubled_triangles, solid.mesh.triangles.len(), solid.health.holes), (3, 12, 0));
}

#[test]
fn a_double_sided_sphere_is_a_sphere() {
    let front = sphere(DVec3::ZERO, 1.0, 10);
    let solid = closed(&[front.clone(), reversed(&front)].concat());
    assert_eq!(solid.health.doubled_triangles, front.len());
    assert_eq!(solid.mesh.triangles.len(), front.len());
    assert!(solid.health.volume_mm3 > 3.8);
}

#[test]
fn needles_close_the_surface_but_carry_no_depth() {
    // The top face's diagonal is split on one side only; a needle fills the seam.
    let mut triangles = cube(0.0, 1.0);
    let [a, b, c] = triangles[11];
    let middle = 0.5 * (a + b);
    triangles.splice(11.., [[a, middle, c], [middle, b, c], [a, b, middle]]);
    let solid = closed(&triangles);
    assert_eq!((solid.health.degenerate_triangles, solid.health.holes), (1, 0));
    assert_eq!((solid.mesh.triangles.len(), solid.caps.len()), (13, 1));
    // Without the needle the seam is a hole of no area.
    triangles.pop();
    let solid = closed(&triangles);
    assert_eq!((solid.health.holes, solid.caps.len()), (1, 1));
    assert!((solid.health.volume_mm3 - 1.0).abs() < 1e-12);
}

#[test]
fn sheets_are_refused_with_their_share() {
    let bowl: Vec<_> = sphere(DVec3::ZERO, 10.0, 24).into_iter().filter(|t| t.iter().all(|p| p.z < 1e-9)).collect();
    let without_lid = cube(0.0, 1.0)[..10].to_vec();
    let sheet = vec![[DVec3::ZERO, DVec3::X, DVec3::Y]];
    for (name, triangles, share) in [("bowl", bowl, 50.0), ("box", without_lid, 20.0), ("triangle", sheet, 100.0)] {
        match close(mesh_of(&triangles)) {
            Err(MeshError::OpenSheet { percent, holes: 1, .. }) => {
                assert!((percent - share).abs() < 0.5, "{name}: {percent}")
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

/// A box without its lid, and a closed one through its floor: what is open encloses more than a sheet does.
#[test]
fn an_open_box_is_no_sheet_beside_a_solid() {
    let mut triangles = cube(0.0, 4.0)[..10].to_vec();
    triangles.extend(box_triangles(DVec3::new(1.0, 1.0, -2.0), DVec3::new(3.0, 3.0, 2.0)));
    let found = close(mesh_of(&triangles));
    assert!(matches!(found, Err(MeshError::OpenSheet { .. })), "{found:?}");
}

/// A prism over a bow tie of unlike lobes: one of them goes round the wrong way, which is said.
#[test]
fn what_is_inside_out_is_named() {
    let rim = [[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 2.0]];
    let at = |i: usize, z: f64| DVec3::new(rim[i % 4][0], rim[i % 4][1], z);
    let mut triangles = vec![[at(0, 1.0), at(1, 1.0), at(2, 1.0)], [at(0, 1.0), at(2, 1.0), at(3, 1.0)]];
    triangles.extend([[at(0, 0.0), at(2, 0.0), at(1, 0.0)], [at(0, 0.0), at(3, 0.0), at(2, 0.0)]]);
    for i in 0..4 {
        let [a, b, c, d] = [at(i, 0.0), at(i + 1, 0.0), at(i + 1, 1.0), at(i, 1.0)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let solid = close(mesh_of(&triangles)).unwrap();
    assert!(solid.health.inside_out, "{:?}", solid.health);
    assert!(solid.health.warnings().iter().any(|said| said.contains("inside out")), "{:?}", solid.health.warnings());
    assert!(!closed(&cube(0.0, 1.0)).health.inside_out);
}

#[test]
fn surfaces_without_volume_are_refused() {
    let plate = [[DVec3::ZERO, DVec3::X, DVec3::Y], [DVec3::ZERO, DVec3::Y, DVec3::X]];
    assert!(matches!(close(mesh_of(&plate)), Err(MeshError::OpenSheet { .. })));
    let flat = box_triangles(DVec3::ZERO, DVec3::new(1.0, 1.0, 1e-9));
    assert!(matches!(close(mesh_of(&flat)), Err(MeshError::NoVolume { .. })));
    let point = [[DVec3::X; 3]];
    assert!(matches!(close(mesh_of(&point)), Err(MeshError::NoSurface { triangles: 1 })));
    // A plate of 0.1 mm is thin but real.
    closed(&box_triangles(DVec3::ZERO, DVec3::new(100.0, 100.0, 0.1)));
}

#[test]
fn a_moebius_band_is_refused_and_a_klein_bottle_does_not_hang() {
    // n quads, the last joined to the first upside down.
    let n = 40;
    let rim = |i: usize, side: f64| {
        let t = std::f64::consts::TAU * i as f64 / n as f64;
        let r = 3.0 + side * (0.5 * t).cos();
        DVec3::new(r * t.cos(), r * t.sin(), side * (0.5 * t).sin())
    };
    let mut band = Vec::new();
    for i in 0..n {
        let (a, b) = (rim(i, -1.0), rim(i, 1.0));
        let (c, d) = if i + 1 < n { (rim(i + 1, 1.0), rim(i + 1, -1.0)) } else { (rim(0, -1.0), rim(0, 1.0)) };
        band.extend([[a, b, c], [a, c, d]]);
    }
    assert!(matches!(close(mesh_of(&band)), Err(MeshError::OpenSheet { .. })));
}

#[test]
fn crossing_pieces_are_counted_and_touching_ones_are_not() {
    let one = cube(0.0, 1.0);
    let touching = closed(&[one.clone(), shifted(&one, DVec3::new(1.0, 0.25, 0.3))].concat());
    assert_eq!(touching.health.self_intersections, Some(0));
    let crossing = closed(&[one.clone(), shifted(&one, DVec3::new(0.5, 0.25, 0.3))].concat());
    assert!(crossing.health.self_intersections.is_some_and(|n| n > 0));
    assert!((crossing.health.volume_mm3 - (2.0 - 0.5 * 0.75 * 0.7)).abs() < 1e-12);
}

#[test]
fn attributes_follow_their_triangles() {
    let mut mesh = mesh_of(&cube(0.0, 1.0));
    mesh.uvs = box_uvs();
    mesh.material_of = (0..12).collect();
    // A degenerate and a doubled one in between.
    mesh.triangles.splice(5..5, [[0, 0, 1], mesh.triangles[2]]);
    mesh.uvs.splice(5..5, [mesh.uvs[0]; 2]);
    mesh.material_of.splice(5..5, [77, 78]);
    let before = corners(&mesh);
    let solid = close(mesh).unwrap();
    assert_eq!(solid.mesh.material_of, (0..12).collect::<Vec<_>>());
    assert_eq!(solid.mesh.uvs, box_uvs());
    assert_eq!(corners(&solid.mesh), [&before[..5], &before[7..]].concat());
}

#[test]
fn the_report_speaks_in_sentences() {
    let mut triangles = cube(0.0, 1.0);
    triangles.remove(0);
    let [a, b, c] = triangles[5];
    triangles[5] = [a, c, b];
    let warnings = closed(&triangles).health.warnings();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings[0]
            .starts_with("The mesh has 1 hole with 3 open edges; closed for the inside test by 1 triangle of 0.50 mm²")
    );
    assert_eq!(warnings[1], "1 triangle was turned to agree with their neighbours.");
    assert_eq!(HealthReport::default().warnings(), Vec::<String>::new());
}

#[test]
#[ignore = "a million triangles, run alone to time it"]
fn a_million_triangles() {
    let mut triangles = sphere(DVec3::ZERO, 30.0, 500);
    triangles.retain(|t| t[0].z < 29.9);
    let mesh = {
        // mesh_of compares all pairs; here the vertices are shared by their bits.
        let mut index = std::collections::HashMap::new();
        let mut mesh = lumislice::mesh::TriangleMesh::default();
        for t in &triangles {
            mesh.triangles.push(t.map(|p| {
                *index.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                    mesh.positions.push(p);
                    mesh.positions.len() as u32 - 1
                })
            }));
        }
        mesh
    };
    let start = std::time::Instant::now();
    let solid = close(mesh).unwrap();
    println!("{} triangles: {:.2} s", solid.health.triangles, start.elapsed().as_secs_f64());
    assert!(start.elapsed().as_secs_f64() < 2.0);
}

/// A sphere whose triangles miss each other's corners by up to this, each corner by itself.
fn cracked(gap: f64) -> Vec<[DVec3; 3]> {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5
    };
    let mut miss = || gap / 3.0_f64.sqrt() * DVec3::new(random(), random(), random());
    sphere(DVec3::ZERO, 5.0, 12).into_iter().map(|t| t.map(|p| p + miss())).collect()
}

#[test]
fn corners_that_miss_each_other_by_rounding_are_joined() {
    let whole = close(mesh_of(&sphere(DVec3::ZERO, 5.0, 12))).unwrap().health;
    assert_eq!(whole.joined_corners, 0);
    let solid = close(mesh_of(&cracked(3e-5))).unwrap();
    let health = &solid.health;
    assert_eq!((health.open_edges, health.holes, health.shells, solid.caps.len()), (0, 0, 1, 0));
    assert!((health.volume_mm3 / whole.volume_mm3 - 1.0).abs() < 1e-5);
    assert!(health.warnings()[0].contains("joined with others"), "{:?}", health.warnings());
    // A ten-thousandth is no rounding.
    assert!(close(mesh_of(&cracked(1e-3))).is_err());
}

#[test]
fn sheets_beside_a_solid_are_left_out() {
    let cube = || box_triangles(DVec3::ZERO, DVec3::ONE);
    let square = |x: f64| {
        let [a, b, c, d] = [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 1.0, 1.0], [x, 0.0, 1.0]].map(DVec3::from);
        vec![[a, b, c], [a, c, d]]
    };
    // Half a tube: a sheet that is not flat.
    let bent: Vec<[DVec3; 3]> = (0..6)
        .flat_map(|i| {
            let at = |i: i32, z: f64| {
                let (sin, cos) = (f64::from(i) * 0.5).sin_cos();
                DVec3::new(3.0 + cos, sin, z)
            };
            let [a, b, c, d] = [at(i, 0.0), at(i + 1, 0.0), at(i + 1, 1.0), at(i, 1.0)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    // The square's two sides, cut along unlike diagonals, and a fin that hangs on an edge of the cube.
    let [a, b, c, d] = [[2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 1.0], [2.0, 0.0, 1.0]].map(DVec3::from);
    let both_sides = vec![[a, b, c], [a, c, d], [b, a, d], [b, d, c]];
    let [e, f] = [[2.0, 0.0, 0.0], [2.0, 0.0, 1.0]].map(DVec3::from);
    let fin = vec![[DVec3::X, e, f], [DVec3::X, f, DVec3::new(1.0, 0.0, 1.0)]];
    for (sheet, triangles) in [
        (square(0.5), 2),
        (square(7.0), 2),
        (bent.clone(), 12),
        (both_sides, 4),
        (fin, 2),
        ([square(0.5), square(7.0), bent].concat(), 16),
    ] {
        let solid = close(mesh_of(&[sheet, cube()].concat())).unwrap();
        let health = &solid.health;
        assert_eq!((solid.mesh.triangles.len(), health.dropped_sheet_triangles), (12, triangles));
        assert!((health.volume_mm3 - 1.0).abs() < 1e-12);
        assert_eq!((health.area_mm2, health.holes, health.shells), (6.0, 0, 1));
        assert!(health.warnings()[0].starts_with("Left out beside the solid: "), "{:?}", health.warnings());
    }
    // A loose lid closes a cup, and is a surface; so is a wall of a box that is all loose.
    let cup = [box_triangles(DVec3::ZERO, DVec3::splat(4.0))[..10].to_vec()].concat();
    let lid: Vec<_> = box_triangles(DVec3::ZERO, DVec3::splat(4.0))[10..].to_vec();
    let lifted = |by: f64| {
        let lifted = lid.iter().map(|t| t.map(|p| p + DVec3::Z * by));
        close(mesh_of(&cup.iter().copied().chain(lifted).collect::<Vec<_>>()))
    };
    let refused = lifted(0.1).unwrap_err().to_string();
    assert!(refused.contains("closing its 2 holes (8 open edges)"), "{refused}");
    assert!(refused.contains("up to 0.100 mm apart") && refused.contains("merge by distance"), "{refused}");
    let refused = lifted(2.0).unwrap_err().to_string();
    assert!(refused.ends_with("give the sheet a thickness or close it in a modeller"), "{refused}");
    // A slit is none.
    let health = lifted(0.01).unwrap().health;
    assert!((health.volume_mm3 - 64.0).abs() < 0.2 && (health.area_mm2 - 96.0).abs() < 1e-9, "{health:?}");
    assert_eq!((health.dropped_sheets, health.joint_shells), (0, 2));
    assert_eq!(close(mesh_of(&cube())).unwrap().health.dropped_sheets, 0);
}
