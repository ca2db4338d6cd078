//! Patches that belong together without sharing edges: rims split differently, hairlines between them, domes that sit
//! on a body.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DVec3, Vec2};
use lumislice::mesh::{HealthReport, MeshError, Solid, close};

use super::shapes::{box_triangles, mesh_of, reversed};

type Faces = Vec<[DVec3; 3]>;
type Ring = Vec<[f64; 2]>;

fn health(faces: &Faces) -> HealthReport {
    close(mesh_of(faces)).unwrap().health
}

/// A square from `low` to `high`, each side in so many pieces.
fn square(low: f64, high: f64, pieces: usize) -> Ring {
    let corners = [[low, low], [high, low], [high, high], [low, high]];
    let at = |k: usize, i: usize| {
        let (a, b, t) = (corners[k], corners[(k + 1) % 4], i as f64 / pieces as f64);
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    };
    (0..4).flat_map(|k| (0..pieces).map(move |i| at(k, i))).collect()
}

/// A circle in the middle of the plate.
fn circle(radius: f64, chords: usize, turn: f64) -> Ring {
    let at = |i: usize| TAU * i as f64 / chords as f64 - 3.0 * FRAC_PI_4 + turn;
    (0..chords).map(|i| [5.0 + radius * at(i).cos(), 5.0 + radius * at(i).sin()]).collect()
}

/// The plate's face at this height, 10 mm square, around a hole.
fn around(hole: &Ring, z: f64) -> Faces {
    let outer = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]].map(|[x, y]| DVec3::new(x, y, z));
    let per = hole.len() / 4;
    let inner = |i: usize| DVec3::new(hole[i % hole.len()][0], hole[i % hole.len()][1], z);
    let mut faces = Vec::new();
    for k in 0..4 {
        faces.extend((0..per).map(|i| [outer[k], inner(k * per + i + 1), inner(k * per + i)]));
        faces.push([outer[k], outer[(k + 1) % 4], inner((k + 1) * per)]);
    }
    faces
}

/// Walls over a ring, facing outwards.
fn walls(ring: &Ring, low: f64, high: f64) -> Faces {
    let at = |i: usize, z: f64| DVec3::new(ring[i % ring.len()][0], ring[i % ring.len()][1], z);
    let wall = |i: usize| {
        let [a, b, c, d] = [at(i, low), at(i + 1, low), at(i + 1, high), at(i, high)];
        [[a, b, c], [a, c, d]]
    };
    (0..ring.len()).flat_map(wall).collect()
}

fn lid(ring: &Ring, z: f64) -> Faces {
    let at = |i: usize| DVec3::new(ring[i][0], ring[i][1], z);
    (2..ring.len()).map(|i| [at(0), at(i - 1), at(i)]).collect()
}

/// A plate 4 mm thick with a hole whose rims and walls are drawn by unlike rings.
fn through_hole(rim: &Ring, wall: &Ring) -> Faces {
    let outside = square(0.0, 10.0, 1);
    let wall = reversed(&walls(wall, 0.0, 4.0));
    [walls(&outside, 0.0, 4.0), around(rim, 4.0), reversed(&around(rim, 0.0)), wall].concat()
}

/// A plate 2 mm thick with a boss on it.
fn boss(rim: &Ring, wall: &Ring, height: f64) -> Faces {
    let outside = square(0.0, 10.0, 1);
    let floor = reversed(&lid(&outside, 0.0));
    let boss = [walls(wall, 2.0, 2.0 + height), lid(wall, 2.0 + height)].concat();
    [walls(&outside, 0.0, 2.0), floor, around(rim, 2.0), boss].concat()
}

#[test]
fn holes_whose_rims_are_split_unlike_their_walls_stay_holes() {
    for low in [4.0, 3.5, 3.0, 2.0] {
        for pieces in [[2, 1], [1, 2], [3, 2]] {
            let [rim, wall] = pieces.map(|pieces| square(low, 10.0 - low, pieces));
            let found = health(&through_hole(&rim, &wall));
            let expected = 400.0 - 4.0 * (10.0 - 2.0 * low).powi(2);
            assert!((found.volume_mm3 - expected).abs() < 1e-9, "{low} {pieces:?}: {found:?}");
            assert_eq!((found.open_edges, found.holes, found.shells, found.turned_shells), (0, 0, 1, 0));
            assert!(found.split_edges > 0 && found.warnings()[0].contains("split"), "{:?}", found.warnings());
        }
    }
    let alike = health(&through_hole(&square(4.0, 6.0, 1), &square(4.0, 6.0, 1)));
    assert_eq!(alike.warnings(), Vec::<String>::new());
}

#[test]
fn a_wall_that_faces_the_wrong_way_turns_with_its_rim() {
    let (rim, wall) = (square(4.0, 6.0, 2), square(4.0, 6.0, 1));
    let mut faces = through_hole(&rim, &wall);
    let first = faces.len() - 8;
    let turned = reversed(&faces[first..]);
    faces.splice(first.., turned);
    let found = health(&faces);
    assert!((found.volume_mm3 - 384.0).abs() < 1e-9, "{found:?}");
    // Eight triangles, each split once.
    assert_eq!(found.flipped_triangles, 16);
}

#[test]
fn bosses_whose_rims_are_split_unlike_stay() {
    for (low, height) in [(2.0, 0.2), (2.0, 1.0), (2.0, 3.0), (4.0, 0.4), (1.0, 1.0), (0.5, 0.5)] {
        let found = health(&boss(&square(low, 10.0 - low, 2), &square(low, 10.0 - low, 1), height));
        let expected = 200.0 + height * (10.0 - 2.0 * low).powi(2);
        assert!((found.volume_mm3 - expected).abs() < 1e-9, "{low} {height}: {found:?}");
        assert_eq!((found.holes, found.dropped_sheets), (0, 0));
    }
}

/// A piece that its writer's digits moved.
#[test]
fn rims_split_unlike_are_joined_in_spite_of_rounding() {
    let mut faces = boss(&square(2.0, 8.0, 2), &square(2.0, 8.0, 1), 1.0);
    let plate = faces.len() - 10;
    faces[plate..].iter_mut().flatten().for_each(|p| *p += DVec3::new(1e-5, -1e-5, 1e-5));
    let found = health(&faces);
    assert!((found.volume_mm3 - 236.0).abs() < 1e-2, "{found:?}");
    assert_eq!((found.holes, found.open_edges), (0, 0));
}

#[test]
fn what_is_split_keeps_its_coordinates() {
    let mut mesh = mesh_of(&boss(&square(2.0, 8.0, 1), &square(2.0, 8.0, 3), 1.0));
    // Of all faces but the upright ones, which these coordinates would flatten, too.
    let uv = |p: DVec3| Vec2::new((0.1 * p.x + 0.05 * p.z) as f32, (0.1 * p.y) as f32);
    mesh.uvs = mesh.triangles.iter().map(|t| t.map(|v| uv(mesh.positions[v as usize]))).collect();
    mesh.corner_colors =
        mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize].as_vec3().to_array())).collect();
    mesh.material_of = (0..mesh.triangles.len() as u16).collect();
    let before = mesh.triangles.len();
    let Solid { mesh, health, .. } = close(mesh).unwrap();
    assert!(health.split_edges == 4 && mesh.triangles.len() + health.degenerate_triangles == before + 8, "{health:?}");
    assert_eq!((mesh.uvs.len(), mesh.material_of.len()), (mesh.triangles.len(), mesh.triangles.len()));
    for ((corners, uvs), colors) in mesh.corners().zip(&mesh.uvs).zip(&mesh.corner_colors) {
        for c in 0..3 {
            assert!(uvs[c].distance(uv(corners[c])) < 1e-6);
            assert!((DVec3::from(colors[c].map(f64::from)) - corners[c]).length() < 1e-5);
        }
    }
}

#[test]
fn rims_a_hairline_apart_are_one_body() {
    for (radius, chords, turn) in [
        (1.5, 24, 0.0),
        (3.0, 24, 0.0),
        (1.0, 24, 0.0),
        (0.5, 24, 0.0),
        (1.0, 48, 0.01),
        (1.0, 12, 0.0),
        (1.2, 48, 0.03),
    ] {
        let [rim, wall] = [circle(radius, 48, 0.0), circle(radius, chords, turn)];
        let prism = 0.5 * chords as f64 * radius * radius * (TAU / chords as f64).sin();
        let found = health(&through_hole(&rim, &wall));
        assert!((found.volume_mm3 - (400.0 - 4.0 * prism)).abs() < 1e-6, "hole {radius} {chords}: {found:?}");
        assert_eq!((found.turned_shells, found.joint_shells, found.dropped_sheets), (0, 2, 0));
        assert!(found.rim_gap_mm > 0.0 && found.rim_gap_mm < 0.05, "{found:?}");
        assert!(found.warnings().iter().any(|said| said.contains("run along each other")), "{:?}", found.warnings());
        // A low boss was dropped as a sheet.
        if radius > 1.5 {
            continue;
        }
        let found = health(&boss(&rim, &wall, 0.3));
        assert!((found.volume_mm3 - (200.0 + 0.3 * prism)).abs() < 1e-6, "boss {radius} {chords}: {found:?}");
        assert_eq!((found.joint_shells, found.dropped_sheets), (2, 0));
    }
}

/// Circles that are turned against each other have no corner in common, and those of unlike radius no point.
#[test]
fn rims_without_a_common_corner_are_one_curve() {
    let prism = |radius: f64, chords: usize| 0.5 * chords as f64 * radius * radius * (TAU / chords as f64).sin();
    for (radius, chords, turn) in
        [(4.5, 24, 0.03), (4.5, 48, PI / 48.0), (4.5, 24, 0.1), (4.45, 48, 0.0), (4.5, 12, 0.2)]
    {
        let [rim, wall] = [circle(4.5, 48, 0.0), circle(radius, chords, turn)];
        let found = health(&through_hole(&rim, &wall));
        let expected = 400.0 - 4.0 * prism(radius, chords);
        assert!((found.volume_mm3 - expected).abs() < 1e-6, "hole {radius} {chords}: {found:?}");
        assert_eq!((found.turned_shells, found.joint_shells, found.dropped_sheets), (0, 2, 0));
        let found = health(&boss(&rim, &wall, 2.0));
        assert!(
            (found.volume_mm3 - 200.0 - 2.0 * prism(radius, chords)).abs() < 1e-6,
            "boss {radius} {chords}: {found:?}"
        );
        assert!(found.rim_gap_mm < 0.2, "{found:?}");
    }
    // So far apart they may be a hole and a sleeve.
    for (wall, gap) in [(circle(4.3, 48, 0.0), 0.2), (circle(4.0, 24, 0.0), 0.0)] {
        match close(mesh_of(&through_hole(&circle(4.5, 48, 0.0), &wall))) {
            Err(MeshError::OpenSheet { unjoined_rim_gap_mm, .. }) => {
                assert!((unjoined_rim_gap_mm - gap).abs() < 1e-3, "{unjoined_rim_gap_mm}");
            }
            found => panic!("{found:?}"),
        }
    }
    // What is refused for an open box is not advised on rims that fit.
    let fits = through_hole(&circle(4.5, 48, 0.0), &circle(4.5, 48, 0.03));
    assert!(health(&fits).rim_gap_mm > 0.0);
    let open_box = &box_triangles(DVec3::splat(20.0), DVec3::splat(40.0))[..10];
    let refused = close(mesh_of(&[&fits, open_box].concat())).unwrap_err();
    assert!(matches!(refused, MeshError::OpenSheet { unjoined_rim_gap_mm: 0.0, .. }), "{refused:?}");
    assert!(refused.to_string().ends_with("give the sheet a thickness or close it in a modeller"), "{refused}");
}

/// A sleeve that does not fit its hole: the wall of another hole, or a body inside out.
#[test]
fn an_open_piece_that_faces_inwards_is_refused() {
    let faces = through_hole(&square(4.0, 6.0, 1), &square(4.3, 5.7, 1));
    let found = close(mesh_of(&faces));
    assert!(matches!(found, Err(MeshError::Facing { triangles: 8, .. })), "{found:?}");
    // Outwards it is a body.
    let mut faces = faces;
    let first = faces.len() - 8;
    let turned = reversed(&faces[first..]);
    faces.splice(first.., turned);
    assert!(close(mesh_of(&faces)).is_ok());
}

/// The part of a sphere around its top, to this angle from it.
fn dome(radius: f64, center: DVec3, angle: f64) -> Faces {
    let (around, down) = (24, 8);
    let at = |i: usize, k: usize| {
        let (polar, turn) = (angle * i as f64 / down as f64, TAU * (k % around) as f64 / around as f64);
        center + radius * DVec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos())
    };
    let mut faces = Vec::new();
    for k in 0..around {
        faces.push([at(0, 0), at(1, k), at(1, k + 1)]);
        for i in 1..down {
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    faces
}

#[test]
fn domes_and_studs_that_sit_on_a_body_count() {
    let body = || box_triangles(DVec3::ZERO, DVec3::new(10.0, 10.0, 4.0));
    let at = |z: f64| DVec3::new(5.0, 5.0, z);
    let half = 2.0 / 3.0 * PI * 1.5f64.powi(3);
    let round = circle(1.5, 48, 0.0);
    let stud = [walls(&round, 3.9, 4.7), lid(&round, 4.7)].concat();
    let shallow = PI * 1.5f64.powi(2) * (3.0 * 3.0 - 1.5) / 3.0;
    for (name, part, more) in [
        ("buried", dome(1.5, at(3.9), FRAC_PI_2), half - 0.1 * PI * 2.25),
        ("on the face", dome(1.5, at(4.0), FRAC_PI_2), half),
        ("shallow", dome(3.0, at(2.5), PI / 3.0), shallow),
        ("stud", stud, 0.7 * PI * 2.25),
        ("inside out", reversed(&dome(1.5, at(3.9), FRAC_PI_2)), half - 0.1 * PI * 2.25),
    ] {
        let found = health(&[body(), part].concat());
        // Facets cut some off.
        assert!((found.volume_mm3 - 400.0 - more).abs() < 0.04 * more, "{name}: {} {more}", found.volume_mm3 - 400.0);
        assert_eq!((found.seated_shells, found.dropped_sheets, found.open_shells), (1, 0, 0), "{name}");
        assert!(found.warnings().iter().any(|said| said.contains("sit on others")), "{:?}", found.warnings());
    }
}

#[test]
fn what_is_seated_may_bear_what_is_seated() {
    let body = box_triangles(DVec3::ZERO, DVec3::new(10.0, 10.0, 4.0));
    let head = dome(3.0, DVec3::new(5.0, 5.0, 3.9), FRAC_PI_2);
    let eye = dome(1.0, DVec3::new(5.0, 5.0, 6.6), FRAC_PI_2);
    let both = health(&[eye.clone(), head.clone(), body.clone()].concat());
    let one = health(&[head, body.clone()].concat());
    assert_eq!((both.seated_shells, both.dropped_sheets), (2, 0));
    assert!(both.volume_mm3 > one.volume_mm3 + 1.0, "{} {}", both.volume_mm3, one.volume_mm3);
    // Without the head it hangs in the air.
    let loose = health(&[eye, body].concat());
    assert_eq!((loose.seated_shells, loose.dropped_sheets), (0, 1));
    assert!(loose.dropped_sheet_volume_mm3 > 1.9 && loose.warnings().iter().any(|said| said.contains("hangs open")));
    assert!((loose.volume_mm3 - 400.0).abs() < 1e-9);
}

/// A fin through a body, and a bent sheet within it, are sheets still.
#[test]
fn sheets_in_a_body_are_not_seated() {
    let body = box_triangles(DVec3::ZERO, DVec3::splat(4.0));
    let buried = dome(1.0, DVec3::splat(2.0), PI / 3.0);
    let found = health(&[body.clone(), reversed(&buried)].concat());
    assert_eq!((found.seated_shells, found.dropped_sheets), (0, 1));
    assert!((found.volume_mm3 - 64.0).abs() < 1e-9);
    let [a, b, c, d] = [[1.0, 2.0, 2.0], [3.0, 2.0, 2.0], [3.0, 2.0, 6.0], [1.0, 2.0, 6.0]].map(DVec3::from);
    let found = health(&[body, vec![[a, b, c], [a, c, d]]].concat());
    assert_eq!((found.seated_shells, found.dropped_sheets), (0, 1));
}

/// A level ring between two circles of as many chords, seen from above.
fn ring(inner: &Ring, outer: &Ring, z: f64) -> Faces {
    let at = |ring: &Ring, i: usize| DVec3::new(ring[i % ring.len()][0], ring[i % ring.len()][1], z);
    let quad = |i: usize| [at(inner, i), at(outer, i), at(outer, i + 1), at(inner, i + 1)];
    (0..inner.len()).map(quad).flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

/// A ring without thickness around a can, which hangs on it by edges of three triangles: at its foot, so that the
/// bottom is bounded by such edges alone, or half way up. It was the bottom that went, or the lower half.
#[test]
fn brims_and_collars_without_thickness_are_left_out() {
    for (reach, height) in [(5.0, 10.0), (5.0, 100.0), (9.0, 10.0), (9.0, 100.0)] {
        let (inner, outer) = (circle(4.5, 24, 0.0), circle(reach, 24, 0.0));
        let ends = [reversed(&lid(&inner, 0.0)), lid(&inner, height)].concat();
        let base = 0.5 * 24.0 * 4.5 * 4.5 * (TAU / 24.0).sin();
        let side = 48.0 * 4.5 * (PI / 24.0).sin() * height;
        let halves = [walls(&inner, 0.0, 0.5 * height), walls(&inner, 0.5 * height, height)].concat();
        for (name, body, z) in [("brim", walls(&inner, 0.0, height), 0.0), ("collar", halves, 0.5 * height)] {
            let sheet = ring(&inner, &outer, z);
            for sheet in [reversed(&sheet), sheet] {
                let found = health(&[body.clone(), ends.clone(), sheet].concat());
                assert!((found.volume_mm3 - base * height).abs() < 1e-6, "{name} {reach} {height}: {found:?}");
                assert!((found.area_mm2 - 2.0 * base - side).abs() < 1e-6, "{name} {reach} {height}: {found:?}");
                assert_eq!((found.dropped_sheets, found.holes, found.flipped_triangles), (1, 0, 0), "{name}");
            }
        }
    }
}

/// What is above the wall has a hole in its lid, and hangs on the rest as a sheet would.
#[test]
fn walls_go_from_a_can_with_a_hole_too() {
    let (rim, hole) = (circle(4.5, 24, 0.0), circle(0.5, 24, 0.0));
    let base = 0.5 * 24.0 * 4.5 * 4.5 * (TAU / 24.0).sin();
    for wall in [2.0, 5.0, 9.0] {
        let body = [walls(&rim, 0.0, wall), walls(&rim, wall, 10.0), reversed(&lid(&rim, 0.0))].concat();
        for inner in [lid(&rim, wall), reversed(&lid(&rim, wall))] {
            let found = health(&[body.clone(), ring(&hole, &rim, 10.0), inner].concat());
            assert!((found.volume_mm3 - 10.0 * base).abs() < 1e-6, "{wall}: {found:?}");
            assert!((found.buried_area_mm2 - base).abs() < 1e-6, "{wall}: {found:?}");
            assert_eq!((found.dropped_sheets, found.holes), (0, 1), "{wall}: {found:?}");
        }
    }
}
