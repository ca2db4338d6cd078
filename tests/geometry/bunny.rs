//! The 60 mm bunny against brute force: nearest of all triangles, winding number by solid angles, at the pitch of a
//! J750.
//!
//! A stack of 125 layers of 0.04 mm makes the material of a voxel say its depth.

use super::support::*;
use glam::DVec3;
use lumislice::{
    mesh::{LoadOptions, Solid, close, load},
    sdf::{BlockBox, BrickOffsets, BrickSurface, CullScratch, Surface, closest_point, cull, nearest_in_brick},
    voxel::Lattice,
};
use rayon::prelude::*;

const LAYER_MM: f64 = 0.04;
const LAYERS: usize = 125;

fn bunny() -> Option<(Solid, Lattice)> {
    let mesh = load(&shared_mesh("bunny_60mm_watertight.ply")?, &LoadOptions::default()).unwrap().mesh;
    let mut solid = close(mesh).unwrap();
    let low = solid.mesh.positions.iter().fold(DVec3::MAX, |low, p| low.min(*p));
    solid.mesh.positions.iter_mut().for_each(|p| *p -= low);
    let extent = solid.mesh.positions.iter().fold(DVec3::ZERO, |extent, p| extent.max(*p));
    let lattice = Lattice::covering(extent, j750()).unwrap();
    Some((solid, lattice))
}

/// A voxel and the material the slicer gave it.
struct Sample {
    index: [u32; 3],
    id: u8,
}

/// Voxels at random in `slices`: inside ones, and (one in ten) any.
fn samples(solid: &Solid, lattice: Lattice, slices: std::ops::Range<u32>, share: f64) -> (Vec<Sample>, Vec<Sample>) {
    let slicer = slicer_of(solid, lattice, stack(&[LAYER_MM; LAYERS]));
    let mut random = Random::new(30);
    let (mut inside, mut any) = (Vec::new(), Vec::new());
    voxels_of(&slicer, slices, |j, k, row| {
        // The gaps between picks are geometric, so every voxel has the same chance.
        let mut i = 0;
        while i < row.len() {
            i += (-(1.0 - random.unit()).ln() / share) as usize;
            if let Some(&id) = row.get(i) {
                let sample = Sample { index: [i as u32, j, k], id };
                if random.below(10) == 0 {
                    any.push(sample)
                } else if id != 0 {
                    inside.push(sample)
                }
            }
            i += 1;
        }
    });
    (inside, any)
}

/// The distance that the slicer's own steps give a voxel: candidates of its brick, cull, kernel.
fn piped_distance(surface: &Surface, lattice: &Lattice, offsets: &BrickOffsets, index: [u32; 3]) -> f64 {
    let ends = [0, 7].map(|end| lattice.centre(index.map(|n| n / 8 * 8 + end)));
    let block = BlockBox { centre: (ends[0] + ends[1]) / 2.0, half: (ends[1] - ends[0]) / 2.0 };
    let mut list = Vec::new();
    let nearest = surface.closest(block.centre).distance;
    surface.within(block.centre, nearest + 2.0 * block.radius() + 1e-7, &mut list);
    let whole = 0..list.len();
    cull(surface.triangles(), &block, whole.clone(), 0.0, &mut list, &mut CullScratch::default());
    let mut found = BrickSurface::default();
    nearest_in_brick(surface.triangles(), &list[whole.end..], block.centre, offsets, &mut found);
    let [x, y, z] = index.map(|n| (n % 8) as usize);
    f64::from(found.distance[x + 8 * y + 64 * z])
}

/// Distance to the nearest of all triangles; those whose bounding sphere is further than one already seen are only
/// looked at.
struct Nearest(Vec<([DVec3; 3], DVec3, f64)>);

impl Nearest {
    fn new(triangles: &[[DVec3; 3]]) -> Self {
        let sphere = |t: &[DVec3; 3]| {
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            (*t, middle, t.iter().map(|p| (*p - middle).length()).fold(0.0, f64::max) + 1e-9)
        };
        Self(triangles.iter().map(sphere).collect())
    }

    fn distance(&self, p: DVec3) -> f64 {
        let least = |least: f64, (triangle, middle, radius): &([DVec3; 3], DVec3, f64)| {
            let reach = least + radius;
            if (p - *middle).length_squared() > reach * reach {
                return least;
            }
            least.min(closest_point(p, triangle).distance_squared.sqrt())
        };
        self.0.iter().fold(f64::INFINITY, least)
    }
}

fn prove(slices: impl Fn(&Lattice) -> std::ops::Range<u32>, share: f64, whole: bool) {
    let Some((solid, lattice)) = bunny() else { return };
    let surface = Surface::new(&solid.mesh).unwrap();
    let offsets = BrickOffsets::new(&lattice);
    let triangles = corners(&solid.mesh);
    let spheres = Nearest::new(&triangles);
    let layers = stack(&[LAYER_MM; LAYERS]);
    let (inside, any) = samples(&solid, lattice, slices(&lattice), share);
    let bottom = LAYER_MM * LAYERS as f64;
    let checked: Vec<(f64, f64, bool)> = inside
        .par_iter()
        .map(|&Sample { index, id }| {
            let p = lattice.centre(index);
            let expected = if whole { distance(&triangles, p) } else { spheres.distance(p) };
            let near_boundary = expected < bottom + 1e-4 && {
                let layer = expected / LAYER_MM;
                (layer - layer.round()).abs() * LAYER_MM < 1e-4
            };
            assert!(near_boundary || id == layers.material(expected, 0).0, "{index:?}, depth {expected}: {id}");
            let exact = (surface.closest(p).distance - expected).abs();
            (exact, (piped_distance(&surface, &lattice, &offsets, index) - expected).abs(), near_boundary)
        })
        .collect();
    let worst = checked.iter().fold((0.0_f64, 0.0_f64), |worst, c| (worst.0.max(c.0), worst.1.max(c.1)));
    println!(
        "{} inside voxels: hierarchy at most {:.1e} mm off, bricks {:.1e} mm; {} within 1e-4 mm of a boundary",
        inside.len(),
        worst.0,
        worst.1,
        checked.iter().filter(|c| c.2).count()
    );
    assert!(worst.0 < 1e-12 && worst.1 < 1e-4);
    let judged: Vec<&Sample> = inside.iter().chain(&any).step_by(if whole { 1 } else { 8 }).collect();
    let wrong = judged.par_iter().filter(|sample| {
        let p = lattice.centre(sample.index);
        (winding(&triangles, p) > 0.5) != (sample.id != 0) && distance(&triangles, p) > 1e-9
    });
    assert_eq!(wrong.count(), 0);
    println!(
        "{} voxels judged by their solid angles, {} of them outside",
        judged.len(),
        judged.iter().filter(|s| s.id == 0).count()
    );
}

#[test]
fn a_sample_of_the_bunny_is_exact() {
    // A slab through the ears' roots, one through the body.
    prove(|lattice| lattice.dims[2] / 2..lattice.dims[2] / 2 + 64, 1.2e-4, false);
}

#[test]
#[ignore = "slow: 100,000 voxels against 70,000 triangles take minutes"]
fn the_bunny_is_exact() {
    prove(|lattice| 0..lattice.dims[2], 2.43e-4, true);
}
