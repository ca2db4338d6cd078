//! The sitting rabbit, stroke by stroke.
//!
//! Units are millimetres of a figure about 100 mm high; y is up, the rabbit looks along +z, x is to its left.
//! It stands on y = 0, where everything is cut flat.

use glam::{DMat3, DVec3, dvec3};

use crate::shape::{Action, Figure, Form, Pose, Stroke};

/// Rotation by degrees about x, then y, then z. `libm` keeps the result the same on every platform.
fn turn(x_deg: f64, y_deg: f64, z_deg: f64) -> DMat3 {
    let [(sx, cx), (sy, cy), (sz, cz)] = [x_deg, y_deg, z_deg].map(|deg| libm::sincos(deg.to_radians()));
    let about_x = DMat3::from_cols(dvec3(1.0, 0.0, 0.0), dvec3(0.0, cx, sx), dvec3(0.0, -sx, cx));
    let about_y = DMat3::from_cols(dvec3(cy, 0.0, -sy), dvec3(0.0, 1.0, 0.0), dvec3(sy, 0.0, cy));
    let about_z = DMat3::from_cols(dvec3(cz, sz, 0.0), dvec3(-sz, cz, 0.0), dvec3(0.0, 0.0, 1.0));
    about_z * about_y * about_x
}

fn ellipsoid(centre: [f64; 3], radii: [f64; 3]) -> Form {
    Form::Ellipsoid { centre: centre.into(), radii: radii.into(), turn: DMat3::IDENTITY }
}

fn turned_ellipsoid(centre: [f64; 3], radii: [f64; 3], turn: DMat3) -> Form {
    Form::Ellipsoid { centre: centre.into(), radii: radii.into(), turn }
}

fn bone(from: [f64; 3], to: [f64; 3], from_radius: f64, to_radius: f64) -> Form {
    Form::Bone { from: from.into(), to: to.into(), from_radius, to_radius }
}

/// Collects strokes in one pose.
struct Sculptor {
    pose: Pose,
    strokes: Vec<Stroke>,
}

impl Sculptor {
    fn stroke(&mut self, action: Action, mirrored: bool, blend: f64, form: Form) {
        self.strokes.push(Stroke { pose: self.pose, action, mirrored, blend, form });
    }

    fn add(&mut self, blend: f64, form: Form) {
        self.stroke(Action::Add, false, blend, form);
    }

    fn add_pair(&mut self, blend: f64, form: Form) {
        self.stroke(Action::Add, true, blend, form);
    }

    fn carve(&mut self, blend: f64, form: Form) {
        self.stroke(Action::Carve, false, blend, form);
    }

    fn carve_pair(&mut self, blend: f64, form: Form) {
        self.stroke(Action::Carve, true, blend, form);
    }
}

/// The whole figure.
pub fn rabbit() -> Figure {
    let body = Pose { origin: DVec3::ZERO, turn: DMat3::IDENTITY };
    let mut clay = Sculptor { pose: body, strokes: Vec::new() };
    model_body(&mut clay);
    clay.pose = Pose { origin: dvec3(0.0, 52.5, 15.0), turn: turn(4.0, 20.0, -5.0) };
    model_head(&mut clay);
    Figure::new(clay.strokes, (dvec3(-30.0, -2.0, -44.0), dvec3(34.0, 108.0, 42.0)))
}

fn model_body(clay: &mut Sculptor) {
    // Rump, back and chest.
    clay.add(0.0, ellipsoid([0.0, 20.0, -11.0], [19.5, 22.0, 21.0]));
    clay.add(10.0, bone([0.0, 25.0, -5.0], [0.0, 43.0, 10.0], 16.5, 11.0));
    clay.add(8.0, ellipsoid([0.0, 30.0, 11.5], [12.8, 15.0, 11.0]));
    // Tail.
    clay.add(1.5, ellipsoid([0.0, 14.5, -33.0], [7.2, 7.0, 6.4]));
    // Front legs; the cleft between them is carved before the paws grow out of it.
    clay.add_pair(5.0, bone([6.8, 27.0, 15.0], [6.0, 6.0, 20.5], 6.8, 5.0));
    clay.carve(3.0, bone([0.0, 1.0, 26.5], [0.0, 17.0, 26.0], 1.6, 0.8));
    clay.add_pair(2.0, ellipsoid([6.1, 3.4, 24.0], [5.1, 4.5, 7.2]));
    // Haunches meet the flank in a sharp crease.
    clay.add_pair(0.0, turned_ellipsoid([12.8, 17.5, -6.5], [9.4, 14.0, 16.5], turn(24.0, -4.0, 6.0)));
    clay.add_pair(2.5, turned_ellipsoid([15.6, 3.2, 9.0], [5.6, 4.9, 14.0], turn(0.0, 5.0, 0.0)));
    // Toes.
    for x in [4.3, 7.9] {
        clay.carve_pair(1.2, bone([x, 0.5, 30.8], [x, 6.6, 29.4], 0.7, 0.5));
    }
    for x in [14.9, 18.5] {
        clay.carve_pair(1.2, bone([x, 0.8, 22.2], [x - 0.1, 6.2, 20.6], 0.7, 0.5));
    }
}

fn model_head(clay: &mut Sculptor) {
    // Skull, muzzle, cheeks and chin.
    clay.add(8.0, ellipsoid([0.0, 0.0, 0.0], [12.8, 12.8, 14.8]));
    clay.add(5.5, ellipsoid([0.0, -3.4, 11.6], [7.2, 6.6, 7.2]));
    clay.add_pair(4.0, ellipsoid([7.4, -5.4, 5.0], [6.6, 6.2, 7.6]));
    clay.add_pair(2.2, ellipsoid([2.9, -5.0, 16.0], [3.7, 3.1, 3.1]));
    clay.add(2.0, ellipsoid([0.0, -8.9, 12.6], [3.4, 2.5, 3.9]));
    clay.add(1.6, ellipsoid([0.0, -1.7, 18.0], [2.5, 1.5, 1.5]));
    // The cleft lip.
    clay.carve(0.8, bone([0.0, -3.4, 20.2], [0.0, -7.4, 18.8], 0.5, 0.45));
    clay.carve_pair(0.8, bone([0.0, -7.4, 18.8], [4.6, -8.6, 15.6], 0.45, 0.4));
    // Eyes: a shallow socket, then a ball in it that meets it sharply.
    clay.carve_pair(2.0, ellipsoid([13.6, 2.8, 8.4], [3.2, 5.4, 5.6]));
    clay.add_pair(0.0, ellipsoid([8.0, 2.8, 8.4], [2.9, 3.3, 3.6]));
    // Ears.
    let ear = |root: [f64; 3], turn| Form::Ear {
        root: root.into(),
        turn,
        half: dvec3(6.2, 20.5, 1.8),
        rim: 1.0,
        cup: 7.5,
        bend: 3.5,
    };
    clay.add(4.0, ear([5.0, 6.0, -4.5], turn(-14.0, 18.0, -10.0)));
    clay.add(4.0, ear([-5.0, 6.0, -4.5], turn(-20.0, -22.0, 16.0)));
}
