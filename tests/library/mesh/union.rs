//! Bodies that overlap, touch, lie in each other or cross themselves: what is left is the surface of their union.
//!
//! The referee knows bodies as such and asks solid angles, body by body; it cuts nothing.

use glam::{DMat3, DVec3};
use lumislice::{
    mesh::{Solid, close},
    sdf::closest_point,
};

use super::shapes::{box_triangles, corners, mesh_of, reversed, sphere, winding};

type Body = Vec<[DVec3; 3]>;

/// A stream of numbers that is the same on every machine.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, end: usize) -> usize {
        ((self.unit() * end as f64) as usize).min(end - 1)
    }

    fn vector(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::from([0; 3].map(|_| low + (high - low) * self.unit()))
    }

    fn rotation(&mut self) -> DMat3 {
        let [x, y, z] = self.vector(0.0, std::f64::consts::TAU).to_array();
        DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
    }
}

/// Two to four bodies: boxes between whole numbers, which share planes, edges and corners; balls, boxes and rings at
/// any angle; and all of it turned and rounded to single precision, so that what lay on each other does so no more.
fn bodies(random: &mut Random) -> Vec<Body> {
    let count = 2 + random.below(3);
    let mut bodies: Vec<Body> = (0..count)
        .map(|_| match random.below(6) {
            0..3 => {
                let low = DVec3::from([0; 3].map(|_| random.below(4) as f64));
                let size = DVec3::from([0; 3].map(|_| 1.0 + random.below(3) as f64));
                box_triangles(low, low + size)
            }
            3 => sphere(random.vector(1.0, 4.0), 0.6 + random.unit(), 5),
            4 => {
                let (turn, at) = (random.rotation(), random.vector(1.0, 4.0));
                box_triangles(DVec3::splat(-0.8), DVec3::new(0.8, 1.1, 0.6))
                    .iter()
                    .map(|t| t.map(|p| turn * p + at))
                    .collect()
            }
            // A ring whose tube is wider than its hole crosses itself and winds twice around its middle.
            _ => ring(random.vector(2.0, 3.0), 0.7, 0.5 + 0.5 * random.unit()),
        })
        .collect();
    match random.below(3) {
        0 => {}
        1 => round(&mut bodies, DMat3::IDENTITY),
        _ => round(&mut bodies, random.rotation()),
    }
    bodies
}

fn round(bodies: &mut [Body], turn: DMat3) {
    for p in bodies.iter_mut().flatten().flatten() {
        *p = (turn * *p * 1.1).as_vec3().as_dvec3();
    }
}

/// A torus, coarse.
fn ring(center: DVec3, large: f64, small: f64) -> Body {
    let (around, across) = (8, 6);
    let at = |i: usize, j: usize| {
        let angle = |n: usize, of: usize| (n % of) as f64 / of as f64 * std::f64::consts::TAU + 0.1;
        let ((sa, ca), (sb, cb)) = (angle(i, around).sin_cos(), angle(j, across).sin_cos());
        let reach = large + small * cb;
        center + DVec3::new(reach * ca, reach * sa, small * sb)
    };
    let quads = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

fn is_inside(bodies: &[Body], p: DVec3) -> bool {
    bodies.iter().any(|body| winding(body, p) > 0.5)
}

fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// Height above the longest side.
fn width([a, b, c]: &[DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length() / (b - a).length().max((c - b).length()).max((a - c).length())
}

fn point_of([a, b, c]: &[DVec3; 3], random: &mut Random) -> DVec3 {
    let (s, t) = (random.unit().sqrt(), random.unit());
    *a * (1.0 - s) + (*b * (1.0 - t) + *c * t) * s
}

fn distance(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    surface.iter().map(|t| closest_point(p, t).distance_squared).fold(f64::INFINITY, f64::min).sqrt()
}

/// How far off a face its sides are asked for, of the extent: a little above the gap that counts as touching. From
/// farther off, what lies across a gap would be taken for touching.
const OFF_SHARE: f64 = 5e-6;
/// How far what is left may be from what is surface.
const OFF: f64 = 1e-4;
/// Faces may be misjudged this near to where others meet them.
const NEAR: f64 = 3e-4;

/// Every face that is left has inside behind it alone, and every point of a face that has is on one that is left.
fn check(name: &str, bodies: &[Body], solid: &Solid, random: &mut Random) {
    let left = corners(&solid.mesh);
    let all: Body = bodies.concat();
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = all.as_flattened().iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
    let off = OFF_SHARE * (high - low).max_element();
    let sides = |t: &[DVec3; 3], p: DVec3| [1.0, -1.0].map(|side| is_inside(bodies, p + side * off * normal(t)));
    for t in left.iter().filter(|t| width(t) > NEAR) {
        for _ in 0..3 {
            let p = point_of(t, random);
            if (0..3).all(|i| closest_point(p, &[t[i], t[(i + 1) % 3], t[i]]).distance_squared > NEAR * NEAR) {
                assert_eq!(sides(t, p), [false, true], "{name}: {p} of {t:?} is left");
                let again = left.iter().filter(|o| closest_point(p, o).distance_squared < 1e-10).count();
                assert_eq!(again, 1, "{name}: {p} of {t:?} is there {again} times");
            }
        }
    }
    for t in &all {
        for _ in 0..20 {
            let p = point_of(t, random);
            let [before, behind] = sides(t, p);
            let gap = distance(&left, p);
            if before != behind {
                assert!(gap < OFF, "{name}: {p} of {t:?} is surface, and {gap} mm from what is left");
            }
        }
    }
    // Depth: the nearest point of what is left is surface, and no surface is nearer.
    for _ in 0..20 {
        let p = random.vector(0.0, 6.0);
        let depth = distance(&left, p);
        for t in &all {
            let nearest = closest_point(p, t);
            let on = nearest.point;
            let inner = nearest.barycentric.iter().all(|w| *w > 1e-3);
            if inner && nearest.distance_squared.sqrt() < depth - OFF {
                let [before, behind] = sides(t, on);
                assert_eq!(before, behind, "{name}: {on} of {t:?} is surface and nearer to {p} than {depth}");
            }
        }
    }
}

fn random_bodies(seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        for _ in 0..8 {
            random.unit();
        }
        let bodies = bodies(&mut random);
        let solid = close(mesh_of(&bodies.concat())).unwrap_or_else(|error| panic!("{seed}: {error}"));
        check(&seed.to_string(), &bodies, &solid, &mut random);
    }
}

#[test]
fn random_bodies_leave_the_surface_of_their_union() {
    random_bodies(0..60);
}

#[test]
#[ignore = "a thousand, some minutes"]
fn a_thousand_random_bodies_leave_the_surface_of_their_union() {
    random_bodies(1000..2000);
}

#[test]
#[ignore = "writes what scripts/union-check reads"]
fn unions_for_another_kernel() {
    let folder = std::path::PathBuf::from(std::env::var_os("LUMISLICE_UNIONS_OUT").expect("a folder to write to"));
    let list = |body: &[[DVec3; 3]]| -> Vec<[[f64; 3]; 3]> { body.iter().map(|t| t.map(|p| p.to_array())).collect() };
    for seed in 5000..6000_u64 {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        // Bodies that cross themselves wind twice, which manifold does not take.
        let bodies: Vec<Body> = bodies(&mut random).into_iter().filter(|body| body.len() != 96).collect();
        if bodies.is_empty() {
            continue;
        }
        let solid = close(mesh_of(&bodies.concat())).unwrap();
        let bodies: Vec<_> = bodies.iter().map(|body| list(body)).collect();
        let surface =
            serde_json::json!({ "triangles": list(&corners(&solid.mesh)), "volume_mm3": solid.health.volume_mm3 });
        std::fs::write(folder.join(format!("{seed}.bodies.json")), serde_json::json!(bodies).to_string()).unwrap();
        std::fs::write(folder.join(format!("{seed}.surface.json")), surface.to_string()).unwrap();
    }
}

fn cube(low: [f64; 3], high: [f64; 3]) -> Body {
    box_triangles(DVec3::from(low), DVec3::from(high))
}

fn other_diagonals(body: &Body) -> Body {
    // Quads are pairs of triangles a b c, a c d.
    body.chunks(2)
        .flat_map(|pair| {
            let ([a, b, c], [_, _, d]) = (pair[0], pair[1]);
            [[a, b, d], [b, c, d]]
        })
        .collect()
}

#[test]
fn areas_and_volumes() {
    let large = cube([0.0; 3], [4.0; 3]);
    let beside = cube([4.0, 0.0, 0.0], [8.0, 4.0, 4.0]);
    for (name, bodies, area, volume) in [
        ("overlap", vec![large.clone(), cube([2.0, 0.5, 0.5], [6.0, 3.5, 3.5])], 96.0 + 24.0, 64.0 + 18.0),
        ("touch, unlike diagonals", vec![large.clone(), other_diagonals(&beside)], 160.0, 128.0),
        ("touch, like diagonals", vec![large.clone(), beside.clone()], 160.0, 128.0),
        ("touch in part", vec![large.clone(), cube([4.0, 1.0, 1.0], [6.0, 2.0, 2.0])], 96.0 + 8.0, 66.0),
        ("coplanar", vec![large.clone(), cube([2.0, 0.0, 0.0], [6.0, 4.0, 4.0])], 128.0, 96.0),
        ("nested", vec![large.clone(), cube([1.0; 3], [3.0; 3])], 96.0, 64.0),
        ("nested on a face", vec![large.clone(), cube([0.0, 1.0, 1.0], [3.0; 3])], 96.0, 64.0),
        ("twice", vec![large.clone(), other_diagonals(&large)], 96.0, 64.0),
        ("on an edge", vec![large.clone(), cube([4.0, 4.0, 0.0], [6.0, 6.0, 4.0])], 96.0 + 40.0, 80.0),
        ("a sheet inside", vec![large.clone(), cube([1.0, 1.0, 2.0], [3.0, 3.0, 2.0])], 96.0, 64.0),
    ] {
        for turned in [false, true] {
            let mut bodies = bodies.clone();
            if turned {
                let turn = Random(7).rotation();
                round(&mut bodies, turn);
            }
            let scale: f64 = if turned { 1.1 } else { 1.0 };
            let solid = close(mesh_of(&bodies.concat())).unwrap();
            let (found, expected) = (solid.health.area_mm2, area * scale.powi(2));
            assert!((found / expected - 1.0).abs() < 2e-5, "{name}, turned {turned}: {found} mm², not {expected}");
            let (found, expected) = (solid.health.volume_mm3, volume * scale.powi(3));
            assert!((found / expected - 1.0).abs() < 2e-5, "{name}, turned {turned}: {found} mm³, not {expected}");
        }
    }
}

/// Two pyramids over one closed line, top above and below.
fn double_pyramid(line: &[DVec3], tops: [DVec3; 2]) -> Body {
    let sides = (0..line.len()).flat_map(|i| {
        let (a, b) = (line[i], line[(i + 1) % line.len()]);
        [[a, b, tops[0]], [b, a, tops[1]]]
    });
    sides.collect()
}

/// A star of `n` points drawn in one line that leaves out `step - 1` of them each time.
fn star(n: usize, step: usize) -> Vec<DVec3> {
    let angle = |i: usize| (i * step % n) as f64 / n as f64 * std::f64::consts::TAU + 0.3;
    (0..n).map(|i| DVec3::new(angle(i).cos(), angle(i).sin(), 0.0)).collect()
}

/// Triangles that pass through each other from a common corner on, and nowhere else.
#[test]
fn sides_of_a_star_pass_through_each_other_from_the_top_on() {
    use std::f64::consts::PI;
    for (n, step) in [(5, 2), (7, 2), (7, 3), (8, 3)] {
        // The outline: n tips at a distance of 1, n corners between them nearer to the middle.
        let part = |of: usize| (PI * of as f64 / n as f64).cos();
        let nearer = part(step) / part(step - 1);
        let volume = 2.0 / 3.0 * n as f64 * nearer * (PI / n as f64).sin();
        for turned in [false, true] {
            let name = format!("{n}/{step}, turned {turned}");
            let mut bodies = vec![double_pyramid(&star(n, step), [DVec3::Z, -DVec3::Z])];
            if turned {
                let turn = Random(n as u64).rotation();
                round(&mut bodies, turn);
            }
            let solid = close(mesh_of(&bodies[0])).unwrap();
            let expected = volume * if turned { 1.1_f64.powi(3) } else { 1.0 };
            let found = solid.health.volume_mm3;
            assert!((found / expected - 1.0).abs() < 2e-5, "{name}: {found} mm³, not {expected}");
            assert!(solid.health.buried_area_mm2 > 0.5, "{name}");
            check(&name, &bodies, &solid, &mut Random(step as u64));
        }
    }
}

/// Lines that cross themselves anyhow, flat and not: they go round some parts twice, and round some the wrong way.
#[test]
fn double_pyramids_over_any_line_leave_the_surface_of_what_they_hold() {
    let mut crossed = 0;
    for seed in 0..60_u64 {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        for _ in 0..8 {
            random.unit();
        }
        let rise = if seed % 2 == 0 { 0.0 } else { 0.6 };
        let corners = 4 + random.below(5);
        let line: Vec<DVec3> =
            (0..corners).map(|_| random.vector(0.0, 3.0) * DVec3::new(1.0, 1.0, rise / 3.0)).collect();
        let mut body = double_pyramid(&line, [DVec3::new(1.5, 1.5, 2.0), DVec3::new(1.4, 1.6, -1.5)]);
        let volume: f64 = body.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum();
        if volume.abs() < 0.1 {
            continue;
        }
        if volume < 0.0 {
            body = reversed(&body);
        }
        let solid = close(mesh_of(&body)).unwrap_or_else(|error| panic!("{seed}: {error}"));
        crossed += usize::from(solid.health.buried_area_mm2 > 0.1);
        check(&seed.to_string(), &[body], &solid, &mut random);
    }
    assert!(crossed > 20, "{crossed}");
}

/// Bricks that miss each other by rounding have cracks between them, in which the faces of others show.
#[test]
fn nothing_is_left_of_faces_that_show_in_the_cracks_between_bricks() {
    let places = || (0..36).map(|i| DVec3::new((i % 4) as f64, (i / 4 % 3) as f64, (i / 12) as f64));
    for (miss, turned) in [(1e-8, false), (1e-7, false), (3e-6, false), (1e-7, true), (1e-6, true)] {
        let mut random = Random(36);
        let mut bricks: Vec<Body> = places()
            .map(|at| {
                let at = at + random.vector(-miss, miss);
                box_triangles(at, at + DVec3::ONE)
            })
            .collect();
        let turn = if turned { random.rotation() } else { DMat3::IDENTITY };
        if turned {
            round(&mut bricks, turn);
        } else {
            bricks.iter_mut().flatten().flatten().for_each(|p| *p *= 1.1);
        }
        let solid = close(mesh_of(&bricks.concat())).unwrap();
        let outside: Body = box_triangles(DVec3::ZERO, DVec3::new(4.0, 3.0, 3.0));
        let outside: Body = outside.iter().map(|t| t.map(|p| turn * p * 1.1)).collect();
        for p in corners(&solid.mesh).concat() {
            let gap = distance(&outside, p);
            assert!(gap < 2e-5, "{miss}, turned {turned}: {p} is left, {gap} mm within");
        }
        for (found, expected) in [(solid.health.area_mm2, 66.0 * 1.21), (solid.health.volume_mm3, 36.0 * 1.331)] {
            assert!((found / expected - 1.0).abs() < 2e-5, "{miss}, turned {turned}: {found}, not {expected}");
        }
    }
}

/// Two bodies with a face in common, of which one reaches out of a third: no part of a wall within them.
#[test]
fn what_reaches_out_of_another_body_is_no_wall_within_it() {
    let tall = cube([2.0, 3.0, 1.0], [3.0, 5.0, 3.0]);
    let short = cube([2.0, 3.0, 2.0], [3.0, 5.0, 3.0]);
    let around = cube([2.0; 3], [4.0, 5.0, 4.0]);
    for (bodies, area, volume) in [
        (vec![tall.clone(), short.clone(), around.clone()], 32.0 + 6.0, 12.0 + 2.0),
        (vec![short.clone(), around.clone(), tall.clone()], 32.0 + 6.0, 12.0 + 2.0),
        (vec![tall, short], 16.0, 4.0),
    ] {
        let health = close(mesh_of(&bodies.concat())).unwrap().health;
        let found = (health.area_mm2, health.volume_mm3);
        assert!((found.0 - area).abs() < 1e-9 && (found.1 - volume).abs() < 1e-9, "{found:?}, not {area}, {volume}");
    }
}

#[test]
fn what_does_not_meet_stays_as_it_is() {
    let shell =
        [sphere(DVec3::ZERO, 3.0, 8), reversed(&sphere(DVec3::ZERO, 2.0, 8)), sphere(DVec3::ZERO, 1.0, 8)].concat();
    let mesh = mesh_of(&shell);
    let solid = close(mesh.clone()).unwrap();
    assert_eq!((solid.mesh.positions, solid.mesh.triangles), (mesh.positions, mesh.triangles));
    assert!(solid.whole.is_none() && solid.health.warnings().is_empty());
}
