//! Spots on the surfaces of a job, and what is asked for and promised there.

use glam::DVec3;
use rand_xoshiro::{
    Xoshiro256PlusPlus,
    rand_core::{Rng, SeedableRng},
};

use super::{ByArea, SurfacePoint};
use crate::{
    job::{Prepared, PreparedObject},
    look::{Scene, Site, Spot},
    slice::ObjectField,
};

/// Radius of a spot, mm: wide enough for the rings that a layer of one voxel makes on a slope to average out, narrow
/// enough for a texture.
pub(in crate::job) const SPOT_RADIUS_MM: f64 = 0.25;
/// Points that stand for a spot.
const SITES: usize = 64;
/// Cosine between the normals of a spot's middle and of a site of it, and between a site's normal and the way to it
/// from the plane of the spot: an edge ends the spot.
const SAME_FACE: f64 = 0.7;
/// Distances that rounding makes, mm: a site in the plane of its spot is at none.
const ROUNDING_MM: f64 = 1e-6;
/// Places that are tried for one spot.
const TRIES: usize = 64;

/// A spot of an object.
#[derive(Debug, Clone)]
pub(in crate::job) struct SurfaceSpot {
    pub object: usize,
    pub middle: Site,
    pub spot: Spot,
}

/// What a surface should show and what its stacking was promised to, per channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::job) struct Expected {
    /// Albedo that is asked for; `None` where a stacking was given.
    pub asked: Option<Vec<f64>>,
    /// The albedo predicted for the stacking as an endless flat slab.
    pub predicted: Vec<f64>,
}

/// What stands for the albedo that a texel, counted through the pages of the atlas, asks for, by channel.
type Goal<'a> = dyn Fn(usize, &[f64]) -> Vec<f64> + 'a;

fn as_asked(_: usize, albedo: &[f64]) -> Vec<f64> {
    albedo.to_vec()
}

/// Adds `share` of `values` to `sum`.
fn add(sum: &mut Vec<f64>, values: &[f64], share: f64) {
    sum.resize(values.len(), 0.0);
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += share * value);
}

impl Prepared {
    fn with_field(&self, object: usize) -> (&PreparedObject, &ObjectField) {
        (&self.objects[object], &self.slicer().objects()[object])
    }

    /// What is expected at a point of an object's surface.
    pub(in crate::job) fn expected_at(&self, object: usize, triangle: u32, point: DVec3) -> Expected {
        self.expected_by(object, triangle, point, &as_asked)
    }

    fn expected_by(&self, object: usize, triangle: u32, point: DVec3, goal: &Goal<'_>) -> Expected {
        let (object, field) = self.with_field(object);
        let (mut asked, mut predicted) = (Some(Vec::new()), Vec::new());
        for shared in field.shares(triangle, point).into_iter().filter(|shared| shared.share > 0.0) {
            let share = f64::from(shared.share);
            let Some((entry, promised)) = object.stackings.of_label(shared.stacking) else { continue };
            add(&mut predicted, promised, share);
            let of_texel = object.asked.of(shared.texel).map(|asked| &asked.albedo);
            match (of_texel.or(entry.target_albedo.as_ref()), &mut asked) {
                (Some(albedo), Some(sum)) => {
                    add(sum, &goal(shared.texel, &object.asked.shown(shared.texel, albedo)), share);
                }
                _ => asked = None,
            }
        }
        Expected { asked, predicted }
    }

    /// The label of the target at a point of an object's surface, and the albedo that is asked for there, the mean of
    /// the channels.
    pub(in crate::job) fn wanted_at(&self, object: usize, triangle: u32, point: DVec3) -> (u16, f64) {
        let shares = self.slicer().objects()[object].shares(triangle, point);
        let most = shares.iter().fold(&shares[0], |best, next| if next.share > best.share { next } else { best });
        let asked = self.expected_at(object, triangle, point).asked.unwrap_or_default();
        let cluster = self.objects[object].stackings.cluster_of(most.stacking);
        (cluster, asked.iter().sum::<f64>() / asked.len().max(1) as f64)
    }

    /// What is expected of a spot: the mean over its sites.
    pub(in crate::job) fn expected(&self, spot: &SurfaceSpot) -> Expected {
        self.expected_as(spot, &as_asked)
    }

    /// [`Self::expected`], where `goal` says what stands for the albedo that a texel asks for.
    pub(in crate::job) fn expected_as(&self, spot: &SurfaceSpot, goal: &Goal<'_>) -> Expected {
        let surface = self.slicer().objects()[spot.object].surface();
        let mut mean = Expected { asked: Some(Vec::new()), predicted: Vec::new() };
        let share = 1.0 / spot.spot.sites.len() as f64;
        for site in &spot.spot.sites {
            let found = surface.closest(site.point);
            let here = self.expected_by(spot.object, found.triangle, found.point, goal);
            add(&mut mean.predicted, &here.predicted, share);
            match (&here.asked, &mut mean.asked) {
                (Some(albedo), Some(sum)) => add(sum, albedo, share),
                _ => mean.asked = None,
            }
        }
        mean
    }

    /// `count` spots at random, evenly over the area of all surfaces that can be seen from outside.
    pub(super) fn random_spots(&self, scene: &Scene, count: usize, seed: u64) -> Vec<SurfaceSpot> {
        let areas = ByArea::new(self);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut uniform = || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let mut spots = Vec::with_capacity(count);
        for _ in 0..count {
            let found = (0..TRIES).find_map(|_| {
                let SurfacePoint { object, triangle, point, .. } =
                    areas.point(uniform() * areas.total, [uniform(), uniform()])?;
                self.spot(scene, object, triangle, point)
            });
            spots.extend(found);
        }
        spots
    }

    /// The spot nearest to a position.
    pub(super) fn spot_near(&self, scene: &Scene, position: DVec3) -> Option<SurfaceSpot> {
        let near = self.slicer().objects().iter().enumerate().map(|(n, field)| (n, field.surface().closest(position)));
        let (object, found) = near.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))?;
        self.spot(scene, object, found.triangle, found.point)
    }

    /// The spot around a surface point; `None` where the surface lies inside of the print, or has no normal.
    pub(in crate::job) fn spot(
        &self,
        scene: &Scene,
        object: usize,
        triangle: u32,
        point: DVec3,
    ) -> Option<SurfaceSpot> {
        self.spot_of(scene, object, triangle, point, SPOT_RADIUS_MM)
    }

    /// [`Self::spot`] of a radius in mm.
    pub(in crate::job) fn spot_of(
        &self,
        scene: &Scene,
        object: usize,
        triangle: u32,
        point: DVec3,
        radius_mm: f64,
    ) -> Option<SurfaceSpot> {
        let surface = self.slicer().objects()[object].surface();
        let normal = |triangle: u32| normal_and_area(&surface.triangles()[triangle as usize]).map(|(normal, _)| normal);
        let middle = Site { point, normal: normal(triangle)? };
        let beside = |aside: DVec3| {
            let found = surface.closest(aside);
            let normal = normal(found.triangle)?;
            // What lies beyond an edge has the edge for its nearest point; all of that there would weigh too much.
            let way = aside - found.point;
            (way.dot(normal).abs() + ROUNDING_MM > SAME_FACE * way.length())
                .then_some(Site { point: found.point, normal })
        };
        spot_around(scene, object, middle, radius_mm, beside)
    }
}

/// The spot of `radius_mm` around a site; `beside` finds the surface next to a position in the plane of the site.
/// `None` where the surface lies inside of the print.
pub(super) fn spot_around(
    scene: &Scene,
    object: usize,
    middle: Site,
    radius_mm: f64,
    beside: impl Fn(DVec3) -> Option<Site>,
) -> Option<SurfaceSpot> {
    if !scene.is_open(&middle) {
        return None;
    }
    let across = middle.normal.any_orthonormal_vector();
    let along = middle.normal.cross(across);
    let mut sites = vec![middle];
    for n in 1..SITES {
        // Even over the disc: radii by equal areas, turned by the golden angle.
        let radius = radius_mm * (n as f64 / SITES as f64).sqrt();
        let turn = n as f64 * GOLDEN_ANGLE;
        let aside = middle.point + (across * libm::cos(turn) + along * libm::sin(turn)) * radius;
        sites.extend(beside(aside).filter(|site| {
            site.normal.dot(middle.normal) > SAME_FACE
                && site.point.distance(middle.point) <= 1.5 * radius_mm
                && scene.is_open(site)
        }));
    }
    let site_radius_mm = radius_mm / (SITES as f64).sqrt();
    Some(SurfaceSpot { object, middle, spot: Spot { sites, site_radius_mm } })
}

/// π(3 − √5): no two multiples of it point the same way.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Outward unit normal and area of a triangle.
pub(in crate::job) fn normal_and_area([a, b, c]: &[DVec3; 3]) -> Option<(DVec3, f64)> {
    let double = (*b - *a).cross(*c - *a);
    double.try_normalize().map(|normal| (normal, 0.5 * double.length()))
}
