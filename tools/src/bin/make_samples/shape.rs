//! Implicit solids made of a few rounded forms, blended one stroke after another.
//!
//! The value is negative inside and close to a distance near the surface, not exactly one: ellipsoids use the
//! first-order estimate k₀(k₀ − 1)/k₁ (Quilez, *Ellipsoid - distance estimation*), ears bend space. Whoever needs
//! points on the surface uses [`Figure::project`], which does not rely on the scale.

use glam::{DMat3, DVec3};

/// One rounded form in the coordinates of its pose.
pub enum Form {
    /// `turn` rotates the ellipsoid's own axes into the pose.
    Ellipsoid { centre: DVec3, radii: DVec3, turn: DMat3 },
    /// The convex hull of two spheres.
    Bone { from: DVec3, to: DVec3, from_radius: f64, to_radius: f64 },
    /// A leaf that stands on its root: x across, y along, hollow towards +z. `half.z` is half its thickness in the
    /// middle, `rim` the radius of its rounded edge, `cup` that of the hollow; the tip is `bend` behind the root.
    Ear { root: DVec3, turn: DMat3, half: DVec3, rim: f64, cup: f64, bend: f64 },
}

impl Form {
    fn value(&self, p: DVec3) -> f64 {
        match *self {
            Self::Ellipsoid { centre, radii, turn } => ellipsoid(turn.transpose() * (p - centre), radii),
            Self::Bone { from, to, from_radius, to_radius } => bone(p, from, to, from_radius, to_radius),
            Self::Ear { root, turn, half, rim, cup, bend } => {
                let q = turn.transpose() * (p - root);
                let along = (q.y / (2.0 * half.y)).clamp(0.0, 1.0);
                // Unroll the cylinder that the ear is part of; its axis runs in front of the bent-back ear.
                let from_axis = cup - (q.z + bend * along * along);
                let across = cup * libm::atan2(q.x, from_axis);
                let z = cup - (q.x * q.x + from_axis * from_axis).sqrt();
                let taper = 1.0 - EAR_TAPER * smooth_step(1.0 - along / EAR_WIDEST_AT);
                let outside = ellipsoid(DVec3::new(across / taper, q.y - half.y, 0.0), half);
                let thickness = rim + (half.z - rim) * smooth_step(-outside / EAR_BEVEL);
                ((outside.max(0.0) * outside.max(0.0) + z * z).sqrt() - thickness) * EAR_SAFETY
            }
        }
    }

    /// A ball that holds the form, and a factor by which [`Form::value`] may fall short of the distance to it.
    fn bound(&self) -> (DVec3, f64, f64) {
        match *self {
            Self::Ellipsoid { centre, radii, .. } => {
                (centre, radii.max_element(), radii.min_element() / radii.max_element())
            }
            Self::Bone { from, to, from_radius, to_radius } => {
                ((from + to) / 2.0, from.distance(to) / 2.0 + from_radius.max(to_radius), 1.0)
            }
            Self::Ear { root, turn, half, rim, bend, .. } => {
                (root + turn.y_axis * half.y, half.y + half.x + rim + bend, 0.5 * half.x / half.y)
            }
        }
    }
}

/// How much narrower an ear is at its root, and at which part of its length it is widest.
const EAR_TAPER: f64 = 0.42;
const EAR_WIDEST_AT: f64 = 0.6;
/// Distance from the edge within which an ear thins out.
const EAR_BEVEL: f64 = 4.0;
/// Keeps the bent space of an ear from overstating distances.
const EAR_SAFETY: f64 = 0.8;

fn ellipsoid(q: DVec3, radii: DVec3) -> f64 {
    let k0 = (q / radii).length();
    let k1 = (q / (radii * radii)).length();
    if k1 < 1e-9 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
}

fn bone(p: DVec3, from: DVec3, to: DVec3, from_radius: f64, to_radius: f64) -> f64 {
    let axis = to - from;
    let length = axis.length();
    let along = (p - from).dot(axis) / length;
    let across = ((p - from).length_squared() - along * along).max(0.0).sqrt();
    // The cone that touches both spheres has its normal at sine `s` to the axis.
    let s = (from_radius - to_radius) / length;
    let c = (1.0 - s * s).sqrt();
    let foot = along * c - across * s;
    if foot < 0.0 {
        (along * along + across * across).sqrt() - from_radius
    } else if foot > length * c {
        ((along - length) * (along - length) + across * across).sqrt() - to_radius
    } else {
        across * c + along * s - from_radius
    }
}

/// 3t² − 2t³ on [0, 1], constant outside.
pub fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The minimum, rounded where the two differ by less than `blend` (Quilez, cubic: curvature stays continuous).
fn smooth_min(a: f64, b: f64, blend: f64) -> f64 {
    if blend <= 0.0 {
        return a.min(b);
    }
    let h = (blend - (a - b).abs()).max(0.0) / blend;
    a.min(b) - h * h * h * blend / 6.0
}

/// What a stroke does to the solid that stands there already.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Joins the form.
    Add,
    /// Takes the form away.
    Carve,
}

/// A rigid frame that several strokes share, for example the head's.
#[derive(Clone, Copy)]
pub struct Pose {
    pub origin: DVec3,
    pub turn: DMat3,
}

/// One form, added or carved, once or mirrored in the plane x = 0 of its pose as well.
pub struct Stroke {
    pub pose: Pose,
    pub action: Action,
    pub mirrored: bool,
    /// Width of the rounding towards what stands there already; 0 leaves a sharp crease.
    pub blend: f64,
    pub form: Form,
}

/// A stroke on one side of its mirror plane, with a ball that holds it.
struct Placed {
    centre: DVec3,
    radius: f64,
    /// Outside its ball a form's value is at least this part of the distance to the ball.
    shortfall: f64,
    stroke: usize,
    mirrored: bool,
}

/// A solid: strokes in order, then cut flat at y = 0.
pub struct Figure {
    strokes: Vec<Stroke>,
    placed: Vec<Placed>,
    /// A box that holds the surface: lowest and highest corner.
    pub bounds: (DVec3, DVec3),
}

/// Step of the difference quotient: far below any feature, far above rounding.
const DIFFERENCE_STEP: f64 = 1e-4;
/// Newton steps that bring a point from a grid cell away onto the surface to rounding.
const PROJECTION_STEPS: usize = 8;

impl Figure {
    /// Applies `strokes` in their order.
    pub fn new(strokes: Vec<Stroke>, bounds: (DVec3, DVec3)) -> Self {
        let mut placed = Vec::new();
        for (index, stroke) in strokes.iter().enumerate() {
            let (centre, radius, shortfall) = stroke.form.bound();
            for mirrored in if stroke.mirrored { &[false, true][..] } else { &[false] } {
                let flip = DVec3::new(if *mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
                let centre = stroke.pose.origin + stroke.pose.turn * (centre * flip);
                placed.push(Placed { centre, radius, shortfall, stroke: index, mirrored: *mirrored });
            }
        }
        Self { strokes, placed, bounds }
    }

    /// Negative inside, positive outside, near the surface about the distance.
    pub fn value(&self, p: DVec3) -> f64 {
        let mut solid = f64::INFINITY;
        for placed in &self.placed {
            let stroke = &self.strokes[placed.stroke];
            let sign = if stroke.action == Action::Add { 1.0 } else { -1.0 };
            // A form farther off than the blend reaches cannot change the value.
            let reach = placed.radius + (sign * solid + stroke.blend).max(0.0) / placed.shortfall;
            if p.distance_squared(placed.centre) > reach * reach {
                continue;
            }
            let mut local = stroke.pose.turn.transpose() * (p - stroke.pose.origin);
            if placed.mirrored {
                local.x = -local.x;
            }
            solid = sign * smooth_min(sign * solid, stroke.form.value(local), stroke.blend);
        }
        solid.max(-p.y)
    }

    /// Gradient by differences along the corners of a tetrahedron.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        const CORNERS: [DVec3; 4] = [
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, 1.0, 1.0),
        ];
        let sum =
            CORNERS.iter().fold(DVec3::ZERO, |sum, &corner| sum + corner * self.value(p + corner * DIFFERENCE_STEP));
        sum / (4.0 * DIFFERENCE_STEP)
    }

    /// Outward unit normal of the level set through `p`.
    pub fn normal(&self, p: DVec3) -> DVec3 {
        self.gradient(p).normalize_or(DVec3::Y)
    }

    /// The surface point that Newton's method finds from `p`, to within `tolerance`.
    pub fn project(&self, mut p: DVec3, tolerance: f64) -> DVec3 {
        for _ in 0..PROJECTION_STEPS {
            let value = self.value(p);
            if value.abs() < tolerance {
                break;
            }
            let gradient = self.gradient(p);
            p -= gradient * (value / gradient.length_squared().max(1e-3));
        }
        p
    }
}
