//! What was asked for, under the lamps of a picture: Hašan et al. 2010, equation 7, over the surface of the mesh.
//!
//! ```text
//!   B(xₒ) = A(xₒ) · Σ E(xᵢ) w(xᵢ, xₒ) / Σ w(xᵢ, xₒ)      w = √(Pᵢ(r) Pₒ(r)) · area,  r = |xᵢ − xₒ|
//! ```
//!
//! P is the profile of the target at either end and A the albedo that is asked for. The sum over the weights stands in
//! for the albedo that they come to on a flat sheet, so that even light shows the asked albedo wherever the surface is:
//! on a thin ear, where light from the other side would come on top, and on an edge, where half of the sheet is not
//! there. Irradiance comes from the lamps, the ground, and by a guess (that they are lit alike) from other parts of the
//! surface.

use std::{collections::HashMap, sync::Arc};

use glam::DVec3;
use rand_xoshiro::{
    Xoshiro256PlusPlus,
    rand_core::{Rng, SeedableRng},
};

use super::{ByArea, SurfacePoint};
use crate::{
    job::Prepared,
    look::{LAMPS, Lamps, Stage},
    optics::InverseHankel,
    parallel,
};

/// Every so many of the points counts far off.
const FAR_STEP: usize = 5;
/// Most points: larger objects have fewer per mm².
const MAX_POINTS: f64 = 200_000.0;
/// How far near by is, mm, and how far profiles are followed.
const NEAR_MM: f64 = 0.8;
const REACH_MM: f64 = 5.0;
/// Entries of a table of √P over √r.
const BINS: usize = 96;

/// How finely the light on the surface is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detail {
    /// Points of the surface, of which every [`FAR_STEP`]th counts far off.
    pub points_per_mm2: f64,
    /// Directions that a point looks into.
    pub rays: usize,
}

/// A point of the surface with the light that falls on it.
#[derive(Debug, Clone, Copy)]
struct Lit {
    point: DVec3,
    label: u16,
    object: u16,
    irradiance: [f32; LAMPS],
}

/// The light on all surfaces of a job, and the profiles that spread it.
pub(super) struct AskedLight {
    near: Arc<Cells>,
    far: Arc<Cells>,
    /// √P by object and label, channel and bin.
    roots: Vec<Vec<Vec<[f32; BINS]>>>,
    channels: usize,
}

/// Points sorted into cubes.
struct Cells {
    points: Vec<Lit>,
    of: HashMap<[i32; 3], std::ops::Range<usize>>,
    edge: f64,
}

impl Cells {
    fn new(mut points: Vec<Lit>, edge: f64) -> Self {
        let cell = |p: DVec3| (p / edge).floor().to_array().map(|at| at as i32);
        points.sort_by_key(|lit| cell(lit.point)); // a stable sort: the same order every time
        let mut of = HashMap::new();
        let mut start = 0;
        for run in points.chunk_by(|a, b| cell(a.point) == cell(b.point)) {
            of.insert(cell(run[0].point), start..start + run.len());
            start += run.len();
        }
        Self { points, of, edge }
    }

    /// Visits the points within a cell of `p` on every side, in a fixed order.
    fn around(&self, p: DVec3, mut visit: impl FnMut(&Lit)) {
        let [x, y, z] = (p / self.edge).floor().to_array().map(|at| at as i32);
        for cell in (-1..=1).flat_map(|k| (-1..=1).flat_map(move |j| (-1..=1).map(move |i| [x + i, y + j, z + k]))) {
            if let Some(range) = self.of.get(&cell) {
                self.points[range.clone()].iter().for_each(&mut visit);
            }
        }
    }
}

/// The bin of a distance, mm.
#[inline]
fn bin(r_squared: f64) -> usize {
    ((r_squared.sqrt() / REACH_MM).sqrt() * BINS as f64) as usize
}

/// √P in every bin of a profile given by its Hankel transform.
fn root(spectrum: &[f64], grid: &crate::optics::FrequencyGrid) -> [f32; BINS] {
    let profile = InverseHankel::new(spectrum, grid);
    let edge = |bin: usize| (bin as f64 / BINS as f64).powi(2) * REACH_MM;
    let within: Vec<f64> = (0..=BINS).map(|bin| profile.energy_within(edge(bin))).collect();
    std::array::from_fn(|bin| {
        let area = std::f64::consts::PI * (edge(bin + 1).powi(2) - edge(bin).powi(2));
        ((within[bin + 1] - within[bin]).max(0.0) / area).sqrt() as f32
    })
}

/// Tables of √P of Hankel transforms by object, label and channel.
fn roots(prepared: &Prepared, spectra: &[Vec<Vec<Vec<f64>>>]) -> Vec<Vec<Vec<[f32; BINS]>>> {
    let grid = &prepared.materials.grid;
    let table = |channels: &Vec<Vec<f64>>| channels.iter().map(|spectrum| root(spectrum, grid)).collect();
    spectra.iter().map(|labels| parallel::map_all(labels, table)).collect()
}

impl AskedLight {
    /// Lights the surfaces of a job; `None` if it asks for nothing.
    pub fn new(prepared: &Prepared, stage: &Stage<'_>, detail: &Detail, seed: u64) -> Option<Self> {
        if prepared.objects.iter().any(|object| object.asked.targets.is_empty()) {
            return None;
        }
        let of_object = |object: &crate::job::PreparedObject| -> Vec<Vec<Vec<f64>>> {
            object.asked.targets.iter().map(|target| target.channels.clone()).collect()
        };
        let roots = roots(prepared, &prepared.objects.iter().map(of_object).collect::<Vec<_>>());
        let mut points = lit_points(prepared, stage, detail, seed);
        let far: Vec<_> = points.iter().copied().step_by(FAR_STEP).collect();
        points.shrink_to_fit();
        Some(Self {
            near: Arc::new(Cells::new(points, NEAR_MM)),
            far: Arc::new(Cells::new(far, REACH_MM)),
            roots,
            channels: prepared.materials.channels.len(),
        })
    }

    /// The same light spread by other profiles: Hankel transforms by object, label of the target and channel.
    pub fn by_profiles(&self, prepared: &Prepared, spectra: &[Vec<Vec<Vec<f64>>>]) -> Self {
        let (near, far) = (Arc::clone(&self.near), Arc::clone(&self.far));
        Self { near, far, roots: roots(prepared, spectra), channels: self.channels }
    }

    /// Radiosity at a surface point under every lamp, by channel and lamp, per the albedo there.
    pub fn spread_at(&self, object: usize, label: u16, p: DVec3) -> Vec<[f32; LAMPS]> {
        let mut sums = vec![([0.0_f32; LAMPS], 0.0_f32); self.channels];
        let here = &self.roots[object][usize::from(label)];
        let mut add = |lit: &Lit, r_squared: f64, area: f32| {
            let bin = bin(r_squared).min(BINS - 1);
            let there = &self.roots[usize::from(lit.object)][usize::from(lit.label)];
            for ((sum, total), (here, there)) in sums.iter_mut().zip(here.iter().zip(there)) {
                let weight = area * here[bin] * there[bin];
                sum.iter_mut().zip(lit.irradiance).for_each(|(sum, light)| *sum += weight * light);
                *total += weight;
            }
        };
        let near = NEAR_MM * NEAR_MM;
        self.near.around(p, |lit| {
            let r_squared = lit.point.distance_squared(p);
            if r_squared < near {
                add(lit, r_squared, 1.0);
            }
        });
        self.far.around(p, |lit| {
            let r_squared = lit.point.distance_squared(p);
            if (near..REACH_MM * REACH_MM).contains(&r_squared) {
                add(lit, r_squared, FAR_STEP as f32);
            }
        });
        let mean = |(sum, total): &([f32; LAMPS], f32)| sum.map(|sum| if *total > 0.0 { sum / total } else { 0.0 });
        sums.iter().map(mean).collect()
    }
}

/// Points at random, evenly over all surfaces, with the light that falls on them.
fn lit_points(prepared: &Prepared, stage: &Stage<'_>, detail: &Detail, seed: u64) -> Vec<Lit> {
    let areas = ByArea::new(prepared);
    let count = (areas.total * detail.points_per_mm2).min(MAX_POINTS) as usize;
    let lit = |n: usize| {
        let stream = seed ^ (n as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream);
        let mut uniform = || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        // Strata of equal area, in the order of the triangles, turned so that every few of them are even too.
        let share = (n as f64 * 0.618_033_988_749_894_9 + uniform() / count as f64).fract();
        let found = areas.point(share * areas.total, [uniform(), uniform()])?;
        let SurfacePoint { object, triangle, point, normal } = found;
        let (label, albedo) = prepared.wanted_at(object, triangle, point);
        let irradiance = irradiance(stage, [point, normal], albedo, detail.rays, &mut uniform);
        Some(Lit { point, label, object: object as u16, irradiance })
    };
    parallel::map(count, lit).into_iter().flatten().collect()
}

/// Irradiance under every lamp.
fn irradiance(
    stage: &Stage<'_>,
    [point, normal]: [DVec3; 2],
    albedo: f64,
    rays: usize,
    uniform: &mut impl FnMut() -> f64,
) -> [f32; LAMPS] {
    let scene = stage.scene;
    // Over the steps that voxels make.
    let over = point + normal * scene.volume().lattice().pitch.length();
    let mut open = [0.0; LAMPS];
    for (lamp, beam) in stage.lamps.beams.iter().enumerate() {
        let cosine = normal.dot(beam.toward);
        if cosine > 0.0 && beam.lights(point) && scene.meets(over, beam.toward).is_none() {
            open[lamp + 1] = cosine;
        }
    }
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    let mut hidden = 0.0;
    for ray in 0..rays {
        let sine = ((ray as f64 + uniform()) / rays as f64).sqrt();
        let turn = std::f64::consts::TAU * (ray as f64 * 0.618_033_988_749_894_9 + uniform() / rays as f64);
        let flat = across * (sine * libm::cos(turn)) + along * (sine * libm::sin(turn));
        let direction = flat + normal * (1.0 - sine * sine).max(0.0).sqrt();
        if scene.meets(over, direction).is_some() {
            hidden += 1.0 / rays as f64;
            continue;
        }
        if direction.z >= 0.0 {
            open[0] += std::f64::consts::PI * Lamps::sky(direction) / rays as f64;
            continue;
        }
        let ground = over + direction * ((stage.ground.z - over.z) / direction.z);
        let share = stage.ground.albedo / rays as f64;
        // The sky over the ground, in one direction.
        let (height, turn) = (uniform().sqrt(), std::f64::consts::TAU * uniform());
        let flat = (1.0 - height * height).max(0.0).sqrt();
        let up = DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), height.max(1e-6));
        if scene.meets(ground, up).is_none() {
            open[0] += share * std::f64::consts::PI * Lamps::sky(up);
        }
        for (lamp, beam) in stage.lamps.beams.iter().enumerate() {
            if beam.lights(ground) && scene.meets(ground, beam.toward).is_none() {
                open[lamp + 1] += share * beam.toward.z.max(0.0);
            }
        }
    }
    // What is hidden sends back its own light, as if it had the same.
    open.map(|open| (open / (1.0 - albedo * hidden)) as f32)
}
