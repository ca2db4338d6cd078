//! Walls and wires: how thick an object is at points of its surface, and what lies there.

use glam::DVec3;
use serde::Serialize;

use crate::{
    appearance::{PointOfSurface, SurfacePoints},
    job::{
        Prepared, RunError,
        file::{DepthFrom, OutputFormat, StackingModel, TargetSpec},
        look::normal_and_area,
    },
    optics::Layer,
    parallel,
    sdf::{Surface, ball_inside},
    watch::Watch,
};

/// Walls and wires of so many voxels hold.
pub(super) const VOXELS: u32 = 3;
/// Distance of the points, mm, and how many there are at most.
const SPACING_MM: f64 = 0.5;
const MOST_POINTS: usize = 20_000;
/// Cosine between the normal and the way to where a ball is limited, above which that is the other side of a wall: at
/// an edge of 90° it is 0.71.
const OPPOSITE: f64 = 0.8;

/// Of the limit: nearer is there.
const THERE: f64 = 1e-3;
/// Cosine between a normal and that of what lies opposite, below which it is the other side of a wall.
const FACING: f64 = -0.5;
/// How far points are drawn from a triangle's edges to its middle, where edges would limit what is seen.
const INWARD: f64 = 0.3;
/// Steps of a way through a wall.
const STEPS: usize = 64;

/// Walls and wires of an object.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Walls {
    /// Its mesh as the job writes it.
    pub mesh: String,
    /// Walls and wires thinner than this, three voxels by their longest edge, are thin, mm.
    pub limit_mm: f64,
    /// Share of the surface that is on thin walls and wires, 0 to 1.
    pub thin_share: f64,
    /// The thinnest that was found, mm; `None` where none is thin.
    pub thinnest_mm: Option<f64>,
    /// Where, mm in the lattice's frame.
    pub thinnest_at_mm: Option<[f64; 3]>,
    /// Share of the surface that is on parts thinner than their layers, from both sides or from the top, where the
    /// object has no stackings for such parts.
    pub shallow_share: f64,
    /// Whether `appearance.thin-parts` would give it such.
    #[serde(skip)]
    pub(in crate::job) takes_thin_parts: bool,
    /// Share on which what prints as background lies bare.
    pub bare_share: f64,
    /// Share on walls whose middle is what prints as background.
    pub hollow_share: f64,
    /// The points, and what is wrong there.
    #[serde(skip)]
    pub(in crate::job) marks: Option<Marks>,
}

/// What is wrong at points of a surface: thin, shallow, bare or hollow, 0 or 1 each.
#[derive(Debug, Clone)]
pub(in crate::job) struct Marks {
    pub points: SurfacePoints,
    pub values: Vec<[f64; 3]>,
}

impl PartialEq for Marks {
    fn eq(&self, other: &Self) -> bool {
        self.values == other.values
    }
}

/// What is known of one point.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    /// Thickness of the wall or wire there, where it is thin.
    wall_mm: Option<f64>,
    shallow: bool,
    bare: bool,
    hollow: bool,
}

/// Length of the way from a point straight through the solid, where it is less than `limit` mm and what it meets faces
/// the point: how thick a wall or a wire is there. The way is walked by distances, which never overleap a surface.
fn through(surface: &Surface, point: &PointOfSurface, [a, b, c]: [DVec3; 3], limit: f64) -> Option<f64> {
    let inward = (a + b + c) / 3.0 - point.point;
    let from = point.point + inward * INWARD.min(limit / inward.length().max(limit));
    let mut way = THERE * limit;
    for _ in 0..STEPS {
        let nearest = surface.closest(from - point.normal * way);
        if nearest.distance < 0.5 * THERE * limit {
            let opposite = normal_and_area(&surface.triangles()[nearest.triangle as usize]);
            if opposite.is_some_and(|(normal, _)| normal.dot(point.normal) < FACING) {
                return Some(way);
            }
        }
        way += nearest.distance.max(0.5 * THERE * limit);
        if way >= limit {
            return None;
        }
    }
    None
}

impl Prepared {
    /// Whether layers of an object can follow its thickness: those that are searched for can, from a surface all around.
    fn takes_thin_parts(&self, object: usize) -> bool {
        let object = &self.job.objects[object];
        !matches!(object.target, TargetSpec::Stacking { .. })
            && object.depth_from == DepthFrom::Surface
            && self.job.stacking.model != StackingModel::KubelkaMunk
            && !self.job.wants(OutputFormat::Heights)
    }

    /// Whether an object has stackings of their own for parts that are too thin for the others.
    fn has_layers_for_thin_parts(&self, object: usize) -> bool {
        self.job.thin_parts() && self.takes_thin_parts(object)
    }

    /// Walls and wires of an object.
    pub(super) fn walls(&self, object: usize, watch: &dyn Watch) -> Result<Walls, RunError> {
        let field = &self.slicer().objects()[object];
        let (surface, around) = (field.surface(), field.around());
        let report = &self.objects[object].stackings;
        let limit_mm = f64::from(VOXELS) * self.lattice.pitch.max_element();
        let thickness = |layers: &[Layer<String>]| layers.iter().map(|layer| layer.thickness_mm).sum::<f64>();
        let deepest = report.stacks_of_labels().map(|stack| thickness(&stack.layers)).fold(0.0, f64::max);
        let most = deepest.max(limit_mm);
        let asks_depth = !self.has_layers_for_thin_parts(object);
        // Of what is measured from its top the surface is that only; a wall ends at the outline.
        let from_top = self.job.objects[object].depth_from == DepthFrom::Top;
        let outline = from_top.then(|| Surface::of_triangles(field.inside().triangles().to_vec())).flatten();
        let walls = outline.as_ref().unwrap_or(around);
        let points = SurfacePoints::spread(surface.triangles(), SPACING_MM, MOST_POINTS);
        let look = |point: &PointOfSurface| -> Found {
            let ball = ball_inside(around, point.point, point.normal, most);
            // A point on an edge touches the face beyond it, at no distance and in no direction.
            let opposite = ball.cosine > OPPOSITE && (THERE * limit_mm..most).contains(&ball.radius);
            let shares = field.shares(point.triangle, point.point);
            let most_of =
                shares.iter().fold(&shares[0], |best, next| if next.share > best.share { next } else { best });
            let layers = report.layers_of(most_of.stacking);
            let at = |depth: f64| {
                let mut bottom = 0.0;
                layers.iter().find(|layer| {
                    bottom += layer.thickness_mm;
                    depth < bottom
                })
            };
            let void_at = |depth: f64| at(depth).is_some_and(|layer| self.is_background(&layer.resin));
            let through = |most: f64| through(walls, point, surface.triangles()[point.triangle as usize], most);
            let thickness = thickness(layers);
            let shallow = match from_top {
                true => through(thickness).is_some(),
                false => opposite && ball.radius < thickness,
            };
            Found {
                wall_mm: through(limit_mm),
                shallow: asks_depth && shallow,
                bare: void_at(0.0),
                hollow: opposite && void_at(ball.radius),
            }
        };
        let mut found = Vec::with_capacity(points.points().len());
        for some in points.points().chunks(1024) {
            watch.go_on()?;
            found.extend(parallel::map_all(some, look));
        }
        let share =
            |is: fn(&Found) -> bool| found.iter().filter(|found| is(found)).count() as f64 / found.len().max(1) as f64;
        let thin = found.iter().zip(points.points());
        let thinnest = thin.filter_map(|(found, point)| Some((found.wall_mm?, point.point)));
        let thinnest = thinnest.min_by(|a, b| a.0.total_cmp(&b.0));
        let mark = |is: bool| if is { 1.0 } else { 0.0 };
        Ok(Walls {
            mesh: self.objects[object].mesh.clone(),
            limit_mm,
            thin_share: share(|found| found.wall_mm.is_some()),
            thinnest_mm: thinnest.map(|(mm, _)| mm),
            thinnest_at_mm: thinnest.map(|(_, point)| point.to_array()),
            shallow_share: share(|found| found.shallow),
            takes_thin_parts: self.takes_thin_parts(object),
            bare_share: share(|found| found.bare),
            hollow_share: share(|found| found.hollow),
            marks: Some(Marks {
                values: found
                    .iter()
                    .map(|f| [mark(f.wall_mm.is_some()), mark(f.shallow), mark(f.bare || f.hollow)])
                    .collect(),
                points,
            }),
        })
    }
}
