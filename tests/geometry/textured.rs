//! Laws of textured layers: what is certain is so, charts do not mix, limits hold, whatever the texture and the atlas.

use super::support::*;
use glam::{DVec3, Vec2};
use lumislice::{
    appearance::{
        Atlas, ClusterId, Filling, LabelMap, LayerField, SlotTable, TexturedLayers, align, align_mixtures,
        enforce_limits,
    },
    mesh::{Solid, TriangleMesh, close},
    optics::{Mixture, ResinId, Stack},
    sdf::{DepthRange, Surface},
    search::ResinLimit,
    slice::{ObjectField, Slicer},
    voxel::{Lattice, MaterialId, ThresholdMask},
};
use proptest::prelude::*;

/// White, support, black.
const RESINS: usize = 3;

fn ids(resins: &[ResinId]) -> Vec<MaterialId> {
    resins.iter().map(|resin| MaterialId::from_resin(resin.0)).collect()
}

fn core() -> MaterialId {
    MaterialId::from_resin(RESINS)
}

/// Stackings that keep `limits`; some have no layer at all.
fn stackings(random: &mut Random, count: usize, limits: &[ResinLimit]) -> Vec<Stack> {
    let one = |random: &mut Random| {
        let layers: Vec<(ResinId, f64)> =
            (0..random.below(6)).map(|_| (ResinId(random.below(RESINS)), random.between(0.0, 0.8))).collect();
        let draft = Stack::joined(layers);
        let sequence: Vec<ResinId> = draft.layers.iter().map(|layer| layer.resin).collect();
        let mut depth = 0.0;
        let mut bottoms: Vec<f32> = draft
            .layers
            .iter()
            .map(|layer| {
                depth += layer.thickness_mm as f32;
                depth
            })
            .collect();
        enforce_limits(&mut bottoms, &sequence, limits);
        let mut top = 0.0;
        Stack::joined(sequence.into_iter().zip(bottoms).map(|(resin, bottom)| {
            let thickness = f64::from(bottom) - top;
            top = f64::from(bottom);
            (resin, thickness)
        }))
    };
    (0..count).map(|_| one(random)).collect()
}

/// Stackings of one family: white with shares of black and support's stand-in, then support, then white; some slots are
/// skipped.
fn family(random: &mut Random, count: usize, limits: &[ResinLimit]) -> Vec<Stack<Mixture>> {
    let deep = limits[1].min_depth_mm;
    let one = |random: &mut Random| {
        let dark = [0.0, 0.1, 0.3 * random.unit()][random.below(3)];
        let grey = Mixture::new([(ResinId(0), 1.0 - dark), (ResinId(2), dark)]).unwrap();
        let mut mm = |least: f64| if random.below(3) == 0 { least } else { random.between(least, least + 0.8) };
        let layers = [(grey, mm(deep)), (ResinId(1).into(), mm(0.0)), (ResinId(0).into(), mm(0.0))];
        Stack::new(layers)
    };
    (0..count).map(|_| one(random)).collect()
}

fn random_limits(random: &mut Random) -> Vec<ResinLimit> {
    let mut limits = vec![ResinLimit::NONE; RESINS];
    match random.below(4) {
        0 => {}
        1 => limits[1].min_depth_mm = 0.2,
        2 => {
            limits[1].min_depth_mm = random.between(0.0, 0.5);
            limits[random.below(RESINS)].min_mm = random.between(0.0, 0.2);
        }
        _ => {
            limits[1].min_depth_mm = random.between(0.0, 0.5);
            limits[random.below(RESINS)].max_mm = random.between(0.3, 1.0);
        }
    }
    limits
}

/// Support at some depth or anywhere.
fn min_depths(random: &mut Random) -> Vec<ResinLimit> {
    let mut limits = vec![ResinLimit::NONE; RESINS];
    limits[1].min_depth_mm = [0.0, 0.2][random.below(2)];
    limits
}

/// Strips of quads with texture coordinates thrown anywhere: charts that share edges, overlap, wrap around, repeat,
/// turn over.
fn patchwork(random: &mut Random, quads: usize, pages: usize) -> (TriangleMesh, Vec<u16>) {
    let (mut mesh, mut page_of) = (TriangleMesh::default(), Vec::new());
    let mut page = 0;
    let mut edge = [Vec2::ZERO; 2];
    let point = |random: &mut Random, spread: f64| {
        Vec2::new(random.between(-spread, 1.0 + spread) as f32, random.between(-spread, 1.0 + spread) as f32)
    };
    for quad in 0..quads {
        let spread = [0.0, 0.5, 4.0][random.below(3)];
        if quad == 0 || random.below(3) == 0 {
            page = random.below(pages) as u16;
            edge = [point(random, spread), point(random, spread)]; // a new chart
        }
        let next = match random.below(5) {
            0 => [point(random, spread), point(random, spread)],
            1 => edge, // no area
            _ => edge.map(|uv| uv + Vec2::new(random.between(-0.3, 0.3) as f32, random.between(-0.3, 0.3) as f32)),
        };
        let x = quad as f64;
        let start = mesh.positions.len() as u32;
        if quad == 0 {
            mesh.positions.extend([DVec3::ZERO, DVec3::Y]);
        }
        mesh.positions.extend([DVec3::new(x + 1.0, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 0.0)]);
        let first = if quad == 0 { 0 } else { start - 2 };
        mesh.triangles.extend([[first, first + 2, first + 1], [first + 1, first + 2, first + 3]]);
        mesh.uvs.extend([[edge[0], next[0], edge[1]], [edge[1], next[0], next[1]]]);
        page_of.extend([page; 2]);
        edge = next;
    }
    (mesh, page_of)
}

pub struct Textured {
    pub mesh: TriangleMesh,
    pub layers: TexturedLayers,
    limits: Vec<ResinLimit>,
}

/// Anything that can go together.
pub fn anything(random: &mut Random) -> Textured {
    let mixed = random.below(2) == 0;
    let limits = if mixed { min_depths(random) } else { random_limits(random) };
    let pages = 1 + random.below(3);
    let quads = 1 + random.below(6);
    let (mesh, page_of) = patchwork(random, quads, pages);
    let sizes: Vec<(u32, u32)> =
        (0..pages).map(|_| (1 + random.below(24) as u32, 1 + random.below(24) as u32)).collect();
    let atlas = Atlas::new(&mesh, &sizes, &page_of);
    let count = 1 + random.below(5);
    let stackings: Vec<Stack<Mixture>> = if mixed {
        family(random, count, &limits)
    } else {
        stackings(random, count, &limits).into_iter().map(Into::into).collect()
    };
    let aligned = align_mixtures(&stackings);
    let id = |resin: ResinId| MaterialId::from_resin(resin.0);
    let slots = SlotTable::with_mixtures(id, &aligned, &limits, core()).unwrap();
    let patch = 1 + random.below(6) as u32;
    let labels: Vec<LabelMap> = sizes
        .iter()
        .map(|&(width, height)| {
            // Patches of one label, so that certain stretches are long, with noise in some.
            let noise = random.below(3) == 0;
            let mut of_patch = vec![ClusterId(0); 600];
            of_patch.iter_mut().for_each(|label| *label = ClusterId(random.below(stackings.len()) as u16));
            let label = |texel: u32| {
                let (x, y) = (texel % width, texel / width);
                if noise {
                    of_patch[(texel * 7 % 599) as usize]
                } else {
                    of_patch[(x / patch + 24 * (y / patch)) as usize]
                }
            };
            LabelMap((0..width * height).map(label).collect())
        })
        .collect();
    let mut layers = TexturedLayers::new(&mesh, &atlas, &labels, slots);
    if random.below(2) == 0 {
        let albedo: Vec<Vec<f64>> = (0..stackings.len()).map(|_| vec![random.unit(), random.unit()]).collect();
        layers = layers.parted(&albedo);
    }
    Textured { mesh, layers, limits }
}

impl Textured {
    /// Texture coordinates somewhere on a triangle, its corners and edges among them.
    pub fn uv_on(&self, random: &mut Random, triangle: u32) -> Vec2 {
        let [a, b, c] = self.mesh.uvs[triangle as usize];
        let (mut v, mut w) = (random.unit() as f32, random.unit() as f32);
        if v + w > 1.0 {
            (v, w) = (1.0 - v, 1.0 - w);
        }
        match random.below(6) {
            0 => w = 0.0,
            1 => (v, w) = (1.0, 0.0),
            2 => v = 1.0 - w,
            _ => {}
        }
        a + (b - a) * v + (c - a) * w
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    /// `uniform_over` speaks for every point of its triangles and every depth of its range.
    #[test]
    fn what_is_uniform_is_so_at_every_point(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let textured = anything(&mut random);
        let triangles = textured.mesh.triangles.len();
        for _ in 0..20 {
            let some: Vec<u32> = (0..1 + random.below(3)).map(|_| random.below(triangles) as u32).collect();
            let min = random.between(-0.1, 3.0);
            let range = DepthRange { min, max: min.max(0.0) + random.unit().powi(3) };
            let Some(filling) = textured.layers.uniform_over(&some, range) else { continue };
            for _ in 0..30 {
                let triangle = some[random.below(some.len())];
                let uv = textured.uv_on(&mut random, triangle);
                let depth = random.between(range.min.max(0.0), range.max) as f32;
                let rank = random.below(ThresholdMask::LEVELS) as u16;
                let found = textured.layers.material(triangle, uv, depth, rank);
                let id = match filling {
                    Filling::Pure(id) => id,
                    Filling::Mixed(blend) => textured.layers.blend(blend).at(rank),
                };
                prop_assert_eq!(found, id, "{:?} at {} on {}, depth {}, limits \
                    {:?}", range, uv, triangle, depth, &textured.limits);
            }
        }
    }

    /// The material at a depth is what the bottoms there say, limits included.
    #[test]
    fn materials_agree_with_bottoms(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let textured = anything(&mut random);
        let mut row = Vec::new();
        for _ in 0..20 {
            let triangle = random.below(textured.mesh.triangles.len()) as u32;
            let uv = textured.uv_on(&mut random, triangle);
            textured.layers.bottoms(triangle, uv, &mut row);
            for _ in 0..20 {
                let depth = random.between(0.0, 3.0) as f32;
                if row.iter().any(|bottom| (bottom - depth).abs() < 1e-4) {
                    continue;
                }
                let slot = row.iter().filter(|bottom| depth >= **bottom).count();
                let found = textured.layers.material(triangle, uv, depth, random.below(ThresholdMask::LEVELS) as u16);
                if textured.layers.is_mixed() && slot == 0 {
                    prop_assert!([0, 2].map(MaterialId::from_resin).contains(&found), "{:?} in a grey", found);
                } else {
                    prop_assert_eq!(found, textured.layers.slot_ids()[slot]);
                }
            }
        }
    }

    /// No interpolated stacking violates a limit.
    #[test]
    fn limits_hold_between_texels(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let textured = anything(&mut random);
        let mut row = Vec::new();
        for _ in 0..20 {
            let triangle = random.below(textured.mesh.triangles.len()) as u32;
            let uv = textured.uv_on(&mut random, triangle);
            textured.layers.bottoms(triangle, uv, &mut row);
            let mut top = 0.0;
            let layers = textured.layers.slot_ids().iter().zip(&row).map(|(id, &bottom)| {
                let thickness = f64::from(bottom) - top;
                top = f64::from(bottom);
                (id.resin().unwrap(), thickness)
            });
            let mut depth = 0.0;
            for layer in Stack::joined(layers).layers {
                let limit = textured.limits[layer.resin];
                prop_assert!(depth > limit.min_depth_mm - 5e-4, "{:?} {:?}", row, limit);
                prop_assert!(layer.thickness_mm > limit.min_mm - 5e-4, "{:?} {:?}", row, limit);
                prop_assert!(layer.thickness_mm < limit.max_mm + 5e-4, "{:?} {:?}", row, limit);
                depth += layer.thickness_mm;
            }
        }
    }
}

/// White 1 mm or black 1 mm per label, over the core.
fn two_labels(mesh: &TriangleMesh, size: u32, labels: impl Fn(u32, u32) -> u16) -> TexturedLayers {
    let stackings = [0, 2].map(|resin| Stack::new([(ResinId(resin), 1.0)]));
    let aligned = align(&stackings);
    let slots = SlotTable::new(&ids(&aligned.sequence), &aligned, &[], core()).unwrap();
    let atlas = Atlas::new(mesh, &[(size, size)], &[]);
    let labels = (0..size * size).map(|texel| ClusterId(labels(texel % size, texel / size))).collect();
    TexturedLayers::new(mesh, &atlas, &[LabelMap(labels)], slots)
}

/// Two charts that meet in the middle of the image and lie apart on the object.
#[test]
fn charts_that_touch_in_the_atlas_do_not_mix() {
    let quad = |x: f64| {
        [DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 0.0), DVec3::new(x, 1.0, 0.0)]
    };
    let mut mesh = TriangleMesh::default();
    for (chart, x) in [0.0, 5.0].into_iter().enumerate() {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(quad(x));
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let [left, right] = [0.5 * chart as f32, 0.5 * chart as f32 + 0.5];
        let [a, b, c, d] = [[left, 0.0], [right, 0.0], [right, 1.0], [left, 1.0]].map(Vec2::from);
        mesh.uvs.extend([[a, b, c], [a, c, d]]);
    }
    let layers = two_labels(&mesh, 16, |x, _| u16::from(x >= 8));
    let mut random = Random::new(20);
    for _ in 0..2000 {
        // Also a hair from the border, where half the footprint is the neighbour's.
        let near = 0.5 * (random.unit() as f32).powi(4);
        let v = random.unit() as f32;
        let depth = random.between(0.0, 0.999) as f32;
        for triangle in 0..4 {
            let u = if triangle < 2 { 0.5 - near } else { 0.5 + near };
            let expected = MaterialId::from_resin(if triangle < 2 { 0 } else { 2 });
            assert_eq!(layers.material(triangle, Vec2::new(u, v), depth, 0), expected, "({u}, {v}) of {triangle}");
        }
    }
    let whole = DepthRange { min: 0.0, max: 0.999 };
    assert_eq!(layers.uniform_over(&[0, 1], whole), Some(Filling::Pure(MaterialId::from_resin(0))));
    assert_eq!(layers.uniform_over(&[2, 3], whole), Some(Filling::Pure(MaterialId::from_resin(2))));
    assert_eq!(layers.uniform_over(&[1, 2], whole), None);
}

/// A square of one chart.
fn square() -> TriangleMesh {
    TriangleMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(Vec2::from),
            [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from),
        ],
        ..TriangleMesh::default()
    }
}

/// Materials of unlike albedo end where their texels do; those of like albedo are interpolated.
#[test]
fn unlike_materials_do_not_fade_into_each_other() {
    let mesh = square();
    let layers = two_labels(&mesh, 16, |x, _| u16::from(x >= 8));
    let [unlike, alike] = [[0.6, 0.2], [0.3, 0.25]].map(|albedo| layers.clone().parted(&albedo.map(|one| vec![one])));
    for step in 0..200 {
        let u = (7.0 + 0.01 * (f64::from(step) + 0.5)) as f32 / 16.0;
        let expected = MaterialId::from_resin(if step < 100 { 0 } else { 2 });
        // A diagonal parts the triangles, and what is on either side is the same.
        for (triangle, v) in [(0, 0.3), (1, 0.7)] {
            let uv = Vec2::new(u, v);
            assert_eq!(unlike.material(triangle, uv, 0.5, 0), expected, "{uv} of {triangle}");
            assert_eq!(alike.material(triangle, uv, 0.5, 0), layers.material(triangle, uv, 0.5, 0));
        }
    }
}

/// Half way between two texels lies half of each, and the change is continuous.
#[test]
fn thickness_is_interpolated_within_a_chart() {
    let mesh = square();
    let layers = two_labels(&mesh, 16, |x, _| u16::from(x >= 8));
    let mut row = Vec::new();
    for step in 0..=100 {
        let share = step as f32 / 100.0;
        let u = (7.5 + share) / 16.0;
        layers.bottoms(0, Vec2::new(u, 0.4), &mut row);
        // White ends where it has lost its share; black goes on to 1 mm.
        assert!(
            (row[0] - (1.0 - share)).abs() < 1e-5 && (row.last().unwrap() - 1.0).abs() < 1e-5,
            "{row:?} at {share}"
        );
    }
}

/// A texture that repeats four times over a triangle: all of it is under the triangle.
#[test]
fn a_repeated_texture_is_seen_whole() {
    let mesh = TriangleMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::ONE],
        triangles: vec![[0, 1, 2]],
        // A band that runs diagonally through four images; the first image alone shows only a corner of it.
        uvs: vec![[[0.1, 0.1], [3.9, 3.2], [3.2, 3.9]].map(Vec2::from)],
        ..TriangleMesh::default()
    };
    for dark in 0..256 {
        let layers = two_labels(&mesh, 16, |x, y| u16::from(x + 16 * y == dark));
        let mut seen = false;
        for i in 0..=200 {
            for j in 0..=200 - i {
                let (v, w) = (i as f32 / 200.0, j as f32 / 200.0);
                let [a, b, c] = mesh.uvs[0];
                seen |= layers.material(0, a + (b - a) * v + (c - a) * w, 0.9, 0) == MaterialId::from_resin(2);
            }
        }
        let claimed = layers.uniform_over(&[0], DepthRange { min: 0.85, max: 0.9 });
        assert!(!(seen && claimed.is_some()), "texel {dark} is under the triangle, but only {claimed:?} is known of");
    }
}

/// A box of 12 triangles with a chart for every face, in a texture of noise.
pub fn noisy_box(high: DVec3, size: u32, mixed: bool) -> (Solid, TexturedLayers) {
    let mut mesh = mesh_of(&box_triangles(DVec3::ZERO, high));
    mesh.uvs = (0..6)
        .flat_map(|face| {
            let corner = Vec2::new((face % 3) as f32 / 3.0, (face / 3) as f32 / 2.0);
            let [a, b, c, d] = [[0.02, 0.02], [0.3, 0.02], [0.3, 0.45], [0.02, 0.45]].map(|uv| corner + Vec2::from(uv));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let solid = close(mesh).unwrap();
    let mut random = Random::new(21);
    let limits = [ResinLimit::NONE, ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE }, ResinLimit::NONE];
    let stackings: Vec<Stack<Mixture>> = if mixed {
        family(&mut random, 20, &limits)
    } else {
        stackings(&mut random, 20, &limits).into_iter().map(Into::into).collect()
    };
    let aligned = align_mixtures(&stackings);
    let id = |resin: ResinId| MaterialId::from_resin(resin.0);
    let slots = SlotTable::with_mixtures(id, &aligned, &limits, core()).unwrap();
    let atlas = Atlas::new(&solid.mesh, &[(size, size)], &[]);
    let label = |texel: u32| ClusterId(((texel / 5 + texel / size / 5 * 31) * 7919 % 20) as u16);
    let labels = (0..size * size).map(label).collect();
    let layers = TexturedLayers::new(&solid.mesh, &atlas, &[LabelMap(labels)], slots);
    (solid, layers)
}

/// Every voxel against the nearest triangle of all and the texels there: uniform tiles, certain stretches and lookups
/// agree.
#[test]
fn voxels_are_what_the_nearest_texels_say() {
    compare_with_nearest_texels(false);
}

/// The same where a slot's shares vary from texel to texel: the voxel's rank decides, by its global index.
#[test]
fn voxels_of_mixtures_are_what_the_nearest_texels_say() {
    compare_with_nearest_texels(true);
}

fn compare_with_nearest_texels(mixed: bool) {
    let high = DVec3::new(3.0, 2.6, 2.2);
    let (solid, layers) = noisy_box(high, 96, mixed);
    assert_eq!(layers.is_mixed(), mixed);
    let mask = ThresholdMask::shared(j750());
    let lattice = Lattice::covering(high, j750()).unwrap();
    let slicer = Slicer::new(
        lattice,
        vec![ObjectField::new(&solid, lattice, LayerField::Textured(Box::new(layers.clone()))).unwrap()],
    );
    let found = voxels(&slicer);
    let surface = Surface::new(&solid.mesh).unwrap();
    let (mut compared, mut near, mut row) = (0, 0, Vec::new());
    for (index, id) in indices(&lattice).zip(found).step_by(7) {
        let p = lattice.centre(index);
        if p.cmpgt(high).any() {
            assert_eq!(id, 0);
            continue;
        }
        let nearest = surface.closest(p);
        // Where another face is as near, either may be asked.
        let depths = [p.x, high.x - p.x, p.y, high.y - p.y, p.z, high.z - p.z];
        let ties = depths.iter().filter(|depth| **depth < nearest.distance + 1e-5).count();
        let [a, b, c] = solid.mesh.uvs[nearest.triangle as usize];
        let [wa, wb, wc] = nearest.barycentric.map(|w| w as f32);
        let uv = a * wa + b * wb + c * wc;
        layers.bottoms(nearest.triangle, uv, &mut row);
        if ties > 1 || row.iter().any(|bottom| (f64::from(*bottom) - nearest.distance).abs() < 1e-4) {
            near += 1;
            continue;
        }
        let rank = mask.rank(index);
        let by = |rank: u16| layers.material(nearest.triangle, uv, nearest.distance as f32, rank);
        // Rounded texture coordinates move shares by some ranks.
        if mixed && by(rank.saturating_sub(4)) != by(rank + 4) {
            near += 1;
            continue;
        }
        let expected = by(rank);
        assert_eq!(id, expected.0, "{index:?}, depth {}, {row:?}", nearest.distance);
        compared += 1;
    }
    println!("{compared} voxels compared, {near} within 1e-4 mm of a boundary or between faces");
    assert!(near * 50 < compared);
}
