//! Layers laid by the exact, the grid and the Lp-averaged distance.

use std::{collections::BTreeSet, ops::Range};

use glam::{DVec3, IVec3, Vec2};

use crate::{
    appearance::{Atlas, ClusterId, LabelMap, LayerField, LayerStack, SlotTable, TexturedLayers, align},
    mesh::{HealthReport, Solid, TriangleMesh},
    optics::{ResinId, Stack},
    sdf::{Cells, RELATIVE_ERROR, cell_centre, for_cells},
    search::ResinLimit,
    slice::{DistanceKind, ObjectField, Slicer, join},
    voxel::{Lattice, MaterialId},
};

const KINDS: [DistanceKind; 3] = [DistanceKind::Exact, DistanceKind::Grid, DistanceKind::Lp { exponent: 8.0 }];
const PITCH: DVec3 = DVec3::new(0.06, 0.09, 0.05);
const RADIUS: f64 = 2.2;
const BOTTOMS: [f64; 3] = [0.2, 0.55, 1.1];

/// A ball of latitude and longitude, with texture coordinates, in the positive octant.
fn ball() -> Solid {
    const RINGS: usize = 24;
    let place = |ring: usize, step: usize| {
        let angle = |n: usize| n as f64 / RINGS as f64 * std::f64::consts::PI;
        let (polar, around) = (angle(ring), angle(step % (2 * RINGS)));
        // The poles exactly once.
        let sine = if ring == 0 || ring == RINGS { 0.0 } else { polar.sin() };
        let uv = Vec2::new(step as f32 / (2 * RINGS) as f32, ring as f32 / RINGS as f32);
        (DVec3::splat(RADIUS) + RADIUS * DVec3::new(sine * around.cos(), sine * around.sin(), polar.cos()), uv)
    };
    let mut mesh = TriangleMesh::default();
    for ring in 0..RINGS {
        for step in 0..2 * RINGS {
            let square = [place(ring, step), place(ring + 1, step), place(ring + 1, step + 1), place(ring, step + 1)];
            for corners in [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|n: usize| square[n])) {
                let [a, b, c] = corners.map(|corner| corner.0);
                let first = mesh.positions.len() as u32;
                if a != b && b != c && c != a {
                    mesh.positions.extend([a, b, c]);
                    mesh.uvs.push(corners.map(|corner| corner.1));
                    mesh.triangles.push([first, first + 1, first + 2]);
                }
            }
        }
    }
    Solid { mesh, caps: Vec::new(), whole: None, health: HealthReport::default() }
}

fn lattice() -> Lattice {
    Lattice::covering(DVec3::splat(2.0 * RADIUS), PITCH).unwrap()
}

fn stack(_: &Solid) -> LayerField {
    let id = MaterialId::from_resin;
    let thickness = [BOTTOMS[0], BOTTOMS[1] - BOTTOMS[0], BOTTOMS[2] - BOTTOMS[1]];
    LayerField::Uniform(LayerStack::new((0..3).map(|n| (id(n), thickness[n])), id(3)))
}

/// Two stackings in a chequerboard of 8 × 8 texels.
fn textured(solid: &Solid) -> LayerField {
    let layers = [[(0, 0.3), (1, 0.8)], [(1, 0.7), (0, 0.4)]];
    let stackings = layers.map(|layers| Stack::new(layers.map(|(resin, mm)| (ResinId(resin), mm))));
    let aligned = align(&stackings);
    let ids: Vec<_> = aligned.sequence.iter().map(|resin| MaterialId::from_resin(resin.0)).collect();
    let slots = SlotTable::new(&ids, &aligned, &[ResinLimit::NONE; 2], MaterialId::from_resin(3)).unwrap();
    let labels = LabelMap((0..64 * 32).map(|texel: u16| ClusterId((texel / 8 + texel / 64 / 8) % 2)).collect());
    let atlas = Atlas::new(&solid.mesh, &[(64, 32)], &vec![0; solid.mesh.triangles.len()]);
    LayerField::Textured(Box::new(TexturedLayers::new(&solid.mesh, &atlas, &[labels], slots)))
}

fn slicer(kind: DistanceKind, layers: fn(&Solid) -> LayerField) -> Slicer {
    let solid = ball();
    let field = ObjectField::new(&solid, lattice(), layers(&solid)).unwrap();
    Slicer::new(lattice(), vec![field.with_distance(kind)])
}

/// Material ids of `slices`.
fn voxels(slicer: &Slicer, slices: Range<u32>) -> Vec<u8> {
    let [width, height, _] = slicer.lattice().dims;
    let mut ids = Vec::new();
    let mut row = vec![0; width as usize];
    let collected = slicer.for_each_slab(slices.clone(), |slab| {
        for k in slab.slices().filter(|k| slices.contains(k)) {
            for j in 0..height {
                slab.read_row(j, k, &mut row);
                ids.extend_from_slice(&row);
            }
        }
        Ok::<(), ()>(())
    });
    collected.unwrap();
    ids
}

/// Centres of the inside voxels, with their ids.
fn inside(slicer: &Slicer) -> Vec<(DVec3, u8)> {
    let lattice = slicer.lattice();
    let [width, height, depth] = lattice.dims.map(|n| n as usize);
    let ids = voxels(slicer, 0..depth as u32);
    let centre = |n: usize| lattice.centre([n % width, n / width % height, n / (width * height)].map(|i| i as u32));
    ids.iter().enumerate().filter(|(_, id)| **id != 0).map(|(n, &id)| (centre(n), id)).collect()
}

fn from_boundary(depth: f64) -> f64 {
    BOTTOMS.iter().map(|bottom| (bottom - depth).abs()).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_grid_changes_only_voxels_near_a_boundary() {
    let [exact, grid] = [DistanceKind::Exact, DistanceKind::Grid].map(|kind| slicer(kind, stack));
    let surface = exact.objects()[0].surface();
    let (before, after) = (inside(&exact), inside(&grid));
    assert_eq!(before.len(), after.len());
    let mut changed = 0;
    for ((p, before), (_, after)) in before.iter().zip(&after) {
        if before != after {
            changed += 1;
            assert!(from_boundary(surface.closest(*p).distance) <= PITCH.length() / 2.0 + 1e-6);
        }
    }
    println!("the grid changes {changed} of {} inside voxels", before.len());
    assert!(changed > before.len() / 100, "{changed}");
}

#[test]
fn voxels_hold_what_the_depth_at_their_centre_says() {
    let LayerField::Uniform(layers) = stack(&ball()) else { unreachable!() };
    for kind in KINDS {
        let slicer = slicer(kind, stack);
        let sample: Vec<_> = inside(&slicer).into_iter().step_by(41).collect();
        let positions: Vec<_> = sample.iter().map(|(p, _)| *p).collect();
        let mut depths = vec![0.0; positions.len()];
        slicer.objects()[0].depth_over(&positions, &mut depths);
        for ((p, id), &depth) in sample.iter().zip(&depths) {
            let error = if let DistanceKind::Lp { .. } = kind { 2.0 * RELATIVE_ERROR * depth } else { 1e-6 };
            if from_boundary(depth) > error {
                assert_eq!(layers.material(depth, 0).0, *id, "{kind:?} at {p}, depth {depth}");
            }
        }
    }
}

/// A voxel takes the layers of one of the surface voxels nearest to it.
#[test]
fn textures_are_read_where_the_nearest_surface_voxel_is() {
    let solid = ball();
    let slicer = slicer(DistanceKind::Grid, textured);
    let field = &slicer.objects()[0];
    let LayerField::Textured(layers) = field.layers() else { unreachable!() };
    let mut cells = BTreeSet::new();
    let everywhere = Cells { low: IVec3::MIN, high: IVec3::MAX };
    for triangle in field.surface().triangles() {
        for_cells(
            &lattice(),
            triangle,
            &everywhere,
            |_, _| true,
            |cell| {
                cells.insert(cell.to_array());
            },
        );
    }
    let centres: Vec<DVec3> = cells.iter().map(|&cell| cell_centre(&lattice(), cell.into())).collect();
    let found = inside(&slicer);
    assert!([1, 2, 4].iter().all(|id| found.iter().any(|(_, found)| found == id)));
    for (p, id) in found.iter().step_by(307) {
        let distance = centres.iter().map(|c| c.distance(*p)).fold(f64::INFINITY, f64::min);
        let nearest = centres.iter().filter(|c| c.distance(*p) <= distance + 1e-9);
        let ids: Vec<u8> = nearest
            .map(|&c| {
                let point = field.surface().closest(c);
                let uvs = solid.mesh.uvs[point.triangle as usize];
                let uv = (0..3).fold(Vec2::ZERO, |uv, n| uv + uvs[n] * point.barycentric[n] as f32);
                layers.material(point.triangle, uv, distance as f32, 0).0
            })
            .collect();
        assert!(ids.contains(id), "{id} at {p}, {distance} mm deep: expected one of {ids:?}");
    }
}

#[test]
fn slices_alone_have_the_same_bytes() {
    let [width, height, depth] = lattice().dims.map(|n| n as usize);
    for kind in KINDS {
        let slicer = slicer(kind, textured);
        let whole = voxels(&slicer, 0..depth as u32);
        for slices in [3..5, 30..41, 70..depth as u32] {
            let part = slices.start as usize * width * height..slices.end as usize * width * height;
            assert!(voxels(&slicer, slices) == whole[part], "{kind:?}");
        }
    }
}

#[test]
fn threads_do_not_change_bytes() {
    for kind in KINDS {
        let slicer = slicer(kind, textured);
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| voxels(&slicer, 0..lattice().dims[2]))
        });
        assert!(one == two, "{kind:?}");
    }
}

#[test]
fn dither_is_of_the_distance_and_the_faces_that_it_was_asked_for() {
    let solid = ball();
    let field = || ObjectField::new(&solid, lattice(), stack(&solid)).unwrap();
    let ids = |fields: Vec<ObjectField>| {
        let slicer = Slicer::new(lattice(), fields);
        voxels(&slicer, 0..lattice().dims[2])
    };
    for kind in KINDS {
        let before = field().with_dithered_boundaries().with_distance(kind);
        let after = field().with_distance(kind).with_dithered_boundaries();
        assert_eq!(
            [before.is_drawn_by_lot(), after.is_drawn_by_lot()],
            [false, kind == DistanceKind::Exact],
            "{kind:?}"
        );
        assert!(ids(vec![before]) == ids(vec![field().with_distance(kind)]), "{kind:?}");
    }
    // Twice the same ball: the second one's faces come after all of the first one's.
    let joined = |prepare: fn(ObjectField) -> ObjectField, then: fn(ObjectField) -> ObjectField| {
        let mut fields = [field(), field()].map(prepare);
        join(&mut fields, &[vec![0, 1]]);
        Vec::from(fields.map(then))
    };
    let dithered = ObjectField::with_dithered_boundaries;
    let averaged = |field: ObjectField| field.with_distance(DistanceKind::Lp { exponent: 8.0 });
    let plain = ids(joined(|field| field, |field| field));
    for prepare in [dithered, averaged] {
        let before = joined(prepare, |field| field);
        assert!(!before.iter().any(ObjectField::is_drawn_by_lot));
        assert!(ids(before) == plain);
    }
    let after = joined(|field| field, dithered);
    assert!(after.iter().all(ObjectField::is_drawn_by_lot));
    assert!(ids(after) == ids(joined(dithered, dithered)));
}
