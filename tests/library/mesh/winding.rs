//! The law of closing: mesh and caps together have an integer winding number at every point, whatever was wrong, and
//! away from the damage it is the sound mesh's.

use std::collections::HashMap;

use glam::DVec3;
use lumislice::mesh::{Solid, close};
use proptest::prelude::*;

use super::shapes::{box_triangles, mesh_of, sphere, winding};

/// Every directed edge, by the bits of its ends, has its reverse as often.
fn assert_no_boundary(surface: &[[DVec3; 3]]) {
    let bits = |p: DVec3| p.to_array().map(|c| (c + 0.0).to_bits());
    let mut balance: HashMap<_, i32> = HashMap::new();
    for [a, b, c] in surface {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *balance.entry((bits(*p), bits(*q))).or_default() += 1;
            *balance.entry((bits(*q), bits(*p))).or_default() -= 1;
        }
    }
    assert!(
        balance.values().all(|&n| n == 0),
        "{} edges without reverse",
        balance.values().filter(|n| **n > 0).count()
    );
}

fn closed_surface(solid: &Solid) -> Vec<[DVec3; 3]> {
    solid.outline().collect()
}

fn assert_integer(surface: &[[DVec3; 3]], p: DVec3) -> i64 {
    let w = winding(surface, p);
    assert!((w - w.round()).abs() < 1e-9, "{w} at {p}");
    w.round() as i64
}

/// What may happen to one triangle.
#[derive(Debug, Clone, Copy)]
enum Damage {
    Remove,
    Flip,
    Double,
    DoubleFlipped,
    Collapse,
}

fn damage() -> impl Strategy<Value = Damage> {
    use Damage::*;
    prop_oneof![Just(Remove), Just(Flip), Just(Double), Just(DoubleFlipped), Just(Collapse)]
}

fn point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-2.5..2.5f64).prop_map(DVec3::from_array)
}

proptest! {
    #[test]
    fn damaged_spheres(
        hits in prop::collection::vec((any::<prop::sample::Index>(), damage()), 0..25),
        points in prop::collection::vec(point(), 20),
        inside_out in any::<bool>(),
    ) {
        let sound = sphere(DVec3::new(0.1, -0.2, 0.05), 1.5, 16);
        let mut damaged = sound.clone();
        for (index, damage) in hits {
            let i = index.index(damaged.len());
            let [a, b, c] = damaged[i];
            match damage {
                Damage::Remove => { damaged.swap_remove(i); }
                Damage::Flip => damaged[i] = [a, c, b],
                Damage::Double => damaged.push([b, c, a]),
                Damage::DoubleFlipped => damaged.push([c, b, a]),
                Damage::Collapse => damaged[i] = [a, b, a],
            }
        }
        if inside_out {
            damaged.iter_mut().for_each(|t| t.swap(0, 1));
        }
        let solid = close(mesh_of(&damaged)).unwrap();
        let surface = closed_surface(&solid);
        assert_no_boundary(&surface);
        for p in points {
            let w = assert_integer(&surface, p);
            // A cap is flatter than the sphere it replaces: with holes of up to a few triangles it stays within 0.4 mm
            // of it.
            let d = p.distance(DVec3::new(0.1, -0.2, 0.05));
            if !(1.1..=1.51).contains(&d) {
                prop_assert_eq!(w, i64::from(d < 1.5));
            }
        }
    }

    #[test]
    fn soups_without_any_sense(
        triangles in prop::collection::vec([0..9u32, 0..9u32, 0..9u32], 1..60),
        points in prop::collection::vec(point(), 8),
    ) {
        // Nine fixed vertices in general position, any triangles between them: non-manifold in every way.
        let vertex = |i: u32| {
            let i = f64::from(i);
            DVec3::new((1.3 * i).sin(), (2.1 * i + 0.5).cos(), (0.7 * i * i + 0.2).sin())
        };
        let soup: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(vertex)).collect();
        if let Ok(solid) = close(mesh_of(&soup)) {
            let surface = closed_surface(&solid);
            assert_no_boundary(&surface);
            for p in points {
                assert_integer(&surface, p);
            }
        }
    }
}

#[test]
fn a_box_with_one_triangle_missing_is_the_whole_box() {
    let sound = box_triangles(DVec3::ZERO, DVec3::ONE);
    for missing in 0..12 {
        let mut punctured = sound.clone();
        punctured.remove(missing);
        let solid = close(mesh_of(&punctured)).unwrap();
        assert_eq!((solid.health.holes, solid.health.open_edges, solid.caps.len()), (1, 3, 1));
        assert!((solid.health.volume_mm3 - 1.0).abs() < 1e-12);
        assert_no_boundary(&closed_surface(&solid));
    }
}

#[test]
fn caps_use_the_rim_bit_for_bit() {
    let mut punctured = sphere(DVec3::new(0.1, 0.2, 0.3), 10.0, 24);
    punctured.retain(|t| t.iter().any(|p| p.z < 9.0));
    let mesh = mesh_of(&punctured);
    let solid = close(mesh).unwrap();
    assert_eq!(solid.health.holes, 1);
    assert!(solid.caps.iter().flatten().all(|p| solid.mesh.positions.contains(p)));
    assert_no_boundary(&closed_surface(&solid));
}
