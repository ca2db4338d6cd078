//! What reaches the camera: the profile, blurred by the spot and the pixels, seen at an angle, with light that has no
//! business there.

use crate::measure::Aperture;
use crate::optics::RadialProfile;
use crate::parallel;

/// Pixels within so many widths of a square spot are averaged point by point; farther out, and of a disc, its blur is
/// round.
const NEAR_WIDTHS: f64 = 4.0;
/// Points a side in a near pixel and across the spot: 144 × 169 pairs, of which neighbours are a micrometre apart.
const PIXEL_POINTS: usize = 12;
const SPOT_POINTS: usize = 13;
/// Points a side in a far pixel.
const FAR_POINTS: usize = 4;
/// Inside this radius the profile is replaced by its mean there, mm: it grows like 1/r, and points may hit the pole.
const POLE_MM: f64 = 0.002;

/// Samples count up to the last one this many standard errors above zero…
const CLEAR: f64 = 5.0;
/// …and their fall over the last few is continued.
const LAST_FEW: usize = 6;
/// Smallest half of a field, mm: stray light must have a place of its own.
const NEAREST_MM: f64 = 5.5;

/// A profile as a function: ln(r f) is straight between the samples' radii for reflection, ln f for transmission.
#[derive(Debug, Clone)]
pub struct Truth {
    r_mm: Vec<f64>,
    log: Vec<f64>,
    pole: bool,
}

impl Truth {
    /// Through the samples of a profile that are well above their own noise; `pole` if it grows like 1/r at the centre.
    pub fn new(profile: &RadialProfile, pole: bool) -> Self {
        // A ring's mean of c/r is c over its middle radius, not over its mean radius by area: a third less in the
        // innermost ring.
        let middle = |edges: &[f64]| edges.windows(2).map(|edge| 0.5 * (edge[0] + edge[1])).collect();
        let radii: Vec<f64> = match profile.ring_edges() {
            Some(edges) if pole => middle(edges),
            _ => profile.r_mm().to_vec(),
        };
        let samples = radii.iter().zip(profile.value_per_mm2()).enumerate();
        let noise = |i: usize| profile.standard_error().map_or(0.0, |errors| errors[i]);
        // The innermost rings of a transmission are small, and noisy without being dark.
        let clear = samples.clone().filter(|(i, (_, value))| **value > CLEAR * noise(*i)).map(|(i, _)| i).next_back();
        let clear = clear.map_or(0, |last| last + 1);
        let lit: Vec<(f64, f64)> =
            samples.take(clear).filter(|(_, (_, value))| **value > 0.0).map(|(_, (r, value))| (*r, *value)).collect();
        let log = lit.iter().map(|(r, value)| if pole { libm::log(r * value) } else { libm::log(*value) }).collect();
        Self { r_mm: lit.iter().map(|sample| sample.0).collect(), log, pole }
    }

    /// f(r), per mm².
    pub fn at(&self, r: f64) -> f64 {
        let last = self.r_mm.len() - 1;
        let i = self.r_mm.partition_point(|sample| *sample < r).clamp(1, last);
        // Beyond the last sample the fall over the last few goes on; inside the first its value stays.
        let before = if r > self.r_mm[last] { last.saturating_sub(LAST_FEW) } else { i - 1 };
        let at = ((r - self.r_mm[before]) / (self.r_mm[i] - self.r_mm[before])).max(0.0);
        let value = libm::exp(self.log[before] + at * (self.log[i] - self.log[before]));
        if self.pole { value / r } else { value }
    }

    /// Mean over the ring between two radii, mm, by the midpoint rule in 64 steps.
    pub fn ring_mean(&self, from: f64, to: f64) -> f64 {
        const STEPS: usize = 64;
        let step = (to - from) / STEPS as f64;
        let sum: f64 = (0..STEPS).map(|i| from + (i as f64 + 0.5) * step).map(|r| self.at(r) * r).sum();
        2.0 * sum * step / (to * to - from * from)
    }

    /// 2π∫ f r dr.
    pub fn integral(&self) -> f64 {
        let end = self.r_mm.last().copied().unwrap_or(0.0);
        let rings = 2000;
        let edge = |i: usize| end * (i as f64 / rings as f64).powi(2);
        let ring = |i: usize| {
            self.ring_mean(edge(i), edge(i + 1)) * std::f64::consts::PI * (edge(i + 1).powi(2) - edge(i).powi(2))
        };
        (0..rings).map(ring).sum()
    }

    /// Largest radius at which the profile is at least a share of its mean within `bin_mm`.
    pub fn radius_of(&self, share: f64, bin_mm: f64) -> f64 {
        let least = share * self.ring_mean(0.0, bin_mm);
        let steps = (self.r_mm.last().copied().unwrap_or(0.0) / bin_mm) as usize;
        (1..steps).map(|i| i as f64 * bin_mm).take_while(|r| self.at(*r) >= least).last().unwrap_or(bin_mm)
    }
}

/// The geometry of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Scale in the sample's plane.
    pub mm_per_pixel: f64,
    /// Centre of the spot: column and row, from the centre of the first pixel.
    pub centre: [f64; 2],
    /// The spot.
    pub spot: Aperture,
    /// From the lens to the sample, mm.
    pub distance_mm: f64,
}

/// What can be wrong; nothing is by default.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Defects {
    /// The sample is turned out of the camera's plane by this, degrees…
    pub tilt_degrees: f64,
    /// …about an axis across this direction, degrees from the right towards down.
    pub tilt_direction_degrees: f64,
    /// Share of the light that is spread over the picture…
    pub stray_share: f64,
    /// …this much brighter at the right edge, and darker at the left, as a share of itself.
    pub stray_gradient: f64,
    /// Pixels with thousands of electrons of dark current.
    pub hot_pixels: usize,
    /// An exposure (by index) whose true time is its label times a factor.
    pub mislabelled: Option<(usize, f64)>,
    /// An exposure (by index) shifted by pixels.
    pub shifted: Option<(usize, [f64; 2])>,
    /// The capture file lists the exposure times in reverse.
    pub labels_reversed: bool,
    /// Values are written through the curve of sRGB, over all 16 bits, and the file does not say so.
    pub encoded: bool,
    /// An exposure (by index) with light of its own in every pixel, as a share of the full well.
    pub lit_up: Option<(usize, f64)>,
    /// The corner farthest from the picture's middle is darker by this share, and all between by the square of their
    /// distance.
    pub vignetting: f64,
    /// Share of the light that a lens throws into a ghost: a disc of a quarter of the picture's width, three tenths of
    /// it to the right of the spot.
    pub flare: f64,
    /// Width of a hair across the spot, mm, that lets through a fifth of the light; it passes 0.15 mm below the centre.
    pub hair_mm: f64,
    /// Light on the grey card's picture grows by this share from its left edge to its right one.
    pub card_gradient: f64,
    /// The names of card and sample are exchanged.
    pub card_swapped: bool,
    /// The names of the screen with and without the sample are exchanged, with their times.
    pub screen_swapped: bool,
}

impl Defects {
    /// Tilt, stray light, hot pixels and a mislabelled exposure together; nothing is shifted.
    pub fn together() -> Self {
        Self {
            tilt_degrees: 1.0,
            tilt_direction_degrees: 30.0,
            stray_share: 0.02,
            stray_gradient: 0.5,
            hot_pixels: 20,
            mislabelled: Some((7, 2.0)),
            ..Self::default()
        }
    }

    /// What a lens leaves of the light of a pixel `[x, y]` of a picture of `size`.
    pub(super) fn shading(&self, [x, y]: [usize; 2], size: [usize; 2]) -> f64 {
        let [u, v] = [2.0 * x as f64 / size[0] as f64 - 1.0, 2.0 * y as f64 / size[1] as f64 - 1.0];
        1.0 - self.vignetting * 0.5 * (u * u + v * v)
    }
}

/// Direction of the hair, radians from the right towards down, how far it passes from the centre, and what it lets
/// through.
const HAIR: (f64, f64, f64) = (0.4, 0.15, 0.2);

impl Scene {
    /// The paper's camera, 44 µm a pixel, over a square field that reaches to 1e-6 of the innermost light, but no
    /// farther than `farthest_mm`.
    pub fn around(truth: &Truth, spot: Aperture, farthest_mm: f64) -> Self {
        const MM_PER_PIXEL: f64 = 0.044;
        let reach = (1.35 * truth.radius_of(1e-6, MM_PER_PIXEL)).max(NEAREST_MM).min(farthest_mm);
        let half = (reach / MM_PER_PIXEL).ceil();
        let centre = [half + 3.37, half - 2.21];
        Self { size: [2 * half as usize + 1; 2], mm_per_pixel: MM_PER_PIXEL, centre, spot, distance_mm: 250.0 }
    }

    /// The light of every pixel: the profile's unit, averaged over the pixel.
    pub fn picture(&self, truth: &Truth, defects: &Defects, shift: [f64; 2]) -> Vec<f32> {
        let spot = self.spot_points();
        let (width_mm, square) = (self.spot_width(), matches!(self.spot, Aperture::Square { .. }));
        let far = FarTable::new(truth, &spot, self.diagonal_mm() * 1.1);
        let centre_mean = truth.ring_mean(1e-9, POLE_MM);
        let near_value = |x: f64, y: f64| {
            let sum: f64 = spot
                .iter()
                .map(|[sx, sy]| libm::hypot(x - sx, y - sy))
                .map(|r| if r < POLE_MM { centre_mean } else { truth.at(r) })
                .sum();
            sum / spot.len() as f64
        };
        let tilt = Tilt::new(defects, self.distance_mm);
        let stray = defects.stray_share * truth.integral()
            / (self.size[0] as f64 * self.size[1] as f64 * self.mm_per_pixel * self.mm_per_pixel);
        let ghost_mm = 0.125 * self.size[0] as f64 * self.mm_per_pixel;
        let ghost = defects.flare * truth.integral() / (std::f64::consts::PI * ghost_mm * ghost_mm);
        let through = |[x, y]: [f64; 2]| {
            let (angle, passes, lets) = HAIR;
            let off = y * libm::cos(angle) - x * libm::sin(angle) - passes;
            if off.abs() < 0.5 * defects.hair_mm { lets } else { 1.0 }
        };
        let row = |y: usize| {
            let pixel = move |x: usize| (x, y);
            (0..self.size[0]).map(pixel).map(|(x, y)| {
                let from_centre = [
                    (x as f64 - self.centre[0] - shift[0]) * self.mm_per_pixel,
                    (y as f64 - self.centre[1] - shift[1]) * self.mm_per_pixel,
                ];
                let near = square && libm::hypot(from_centre[0], from_centre[1]) < NEAR_WIDTHS * width_mm;
                let points = if near { PIXEL_POINTS } else { FAR_POINTS };
                let offset = |i: usize| ((i as f64 + 0.5) / points as f64 - 0.5) * self.mm_per_pixel;
                let mut sum = 0.0;
                for i in 0..points {
                    for j in 0..points {
                        let [u, v] = tilt.on_sample([from_centre[0] + offset(i), from_centre[1] + offset(j)]);
                        sum += if near { near_value(u, v) } else { far.at(libm::hypot(u, v)) } * through([u, v]);
                    }
                }
                let across = 2.0 * x as f64 / self.size[0] as f64 - 1.0;
                let light = sum / (points * points) as f64 + stray * (1.0 + defects.stray_gradient * across);
                let in_ghost = libm::hypot(from_centre[0] - 2.4 * ghost_mm, from_centre[1]) < ghost_mm;
                ((light + if in_ghost { ghost } else { 0.0 }) * defects.shading([x, y], self.size)) as f32
            })
        };
        let rows: Vec<Vec<f32>> = parallel::map(self.size[1], |y| row(y).collect());
        rows.concat()
    }

    fn diagonal_mm(&self) -> f64 {
        libm::hypot(self.size[0] as f64, self.size[1] as f64) * self.mm_per_pixel
    }

    fn spot_width(&self) -> f64 {
        match self.spot {
            Aperture::Square { side_mm } => side_mm,
            Aperture::Disc { diameter_mm } => diameter_mm,
        }
    }

    fn spot_points(&self) -> Vec<[f64; 2]> {
        let width = self.spot_width();
        let node = |i: usize| ((i as f64 + 0.5) / SPOT_POINTS as f64 - 0.5) * width;
        let square = (0..SPOT_POINTS).flat_map(|i| (0..SPOT_POINTS).map(move |j| [node(i), node(j)]));
        match self.spot {
            Aperture::Square { .. } => square.collect(),
            Aperture::Disc { .. } => square.filter(|[x, y]| libm::hypot(*x, *y) <= 0.5 * width).collect(),
        }
    }
}

/// A tilted plane seen through a lens.
struct Tilt {
    direction: [f64; 2],
    sine_over_distance: f64,
    cosine: f64,
}

impl Tilt {
    fn new(defects: &Defects, distance_mm: f64) -> Self {
        let (angle, direction) = (defects.tilt_degrees.to_radians(), defects.tilt_direction_degrees.to_radians());
        let direction = [libm::cos(direction), libm::sin(direction)];
        Self { direction, sine_over_distance: libm::sin(angle) / distance_mm, cosine: libm::cos(angle) }
    }

    /// Place on the sample, in its plane, of a place in the picture: a point s along the tilt is s·sin t nearer to the
    /// lens, and seen at s·cos t · D/(D − s·sin t).
    fn on_sample(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let along = x * self.direction[0] + y * self.direction[1];
        let across = y * self.direction[0] - x * self.direction[1];
        let s = along / (self.cosine + along * self.sine_over_distance);
        let t = across * (1.0 - s * self.sine_over_distance);
        [s * self.direction[0] - t * self.direction[1], s * self.direction[1] + t * self.direction[0]]
    }
}

/// The profile blurred by the spot, averaged over directions, on a grid of radii.
struct FarTable {
    step: f64,
    log: Vec<f64>,
}

impl FarTable {
    fn new(truth: &Truth, spot: &[[f64; 2]], end_mm: f64) -> Self {
        const STEP_MM: f64 = 0.01;
        const DIRECTIONS: usize = 8;
        let value = |i: usize| {
            let r = (i as f64).max(0.5) * STEP_MM;
            let mean = |k: usize| {
                let angle = k as f64 * std::f64::consts::TAU / (4 * DIRECTIONS) as f64;
                let (x, y) = (r * libm::cos(angle), r * libm::sin(angle));
                spot.iter().map(|[sx, sy]| truth.at(libm::hypot(x - sx, y - sy).max(POLE_MM))).sum::<f64>()
            };
            let sum: f64 = (0..DIRECTIONS).map(mean).sum();
            libm::log((sum / (DIRECTIONS * spot.len()) as f64).max(1e-300))
        };
        let count = (end_mm / STEP_MM) as usize + 2;
        Self { step: STEP_MM, log: parallel::map(count, value) }
    }

    fn at(&self, r: f64) -> f64 {
        let x = (r / self.step).min((self.log.len() - 2) as f64);
        let i = x as usize;
        libm::exp(self.log[i] + (x - i as f64) * (self.log[i + 1] - self.log[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blur moves light and loses none: the picture holds the profile's integral.
    #[test]
    fn pictures_hold_the_light_of_the_profile() {
        let r: Vec<f64> = (1..800).map(|i| f64::from(i) * 0.005).collect();
        let f = r.iter().map(|r| (-3.0 * r).exp() / r).collect();
        let truth = Truth::new(&RadialProfile::from_points(r, f, None).unwrap(), true);
        let exact = std::f64::consts::TAU / 3.0;
        assert!((truth.integral() / exact - 1.0).abs() < 1e-3, "{} for {exact}", truth.integral());
        let scene = Scene {
            size: [181, 181],
            mm_per_pixel: 0.044,
            centre: [90.3, 89.6],
            spot: Aperture::Square { side_mm: 0.1 },
            distance_mm: 250.0,
        };
        let light: f64 = scene.picture(&truth, &Defects::default(), [0.0; 2]).iter().map(|v| f64::from(*v)).sum();
        let light = light * 0.044 * 0.044;
        assert!((light / exact - 1.0).abs() < 2e-3, "{light} for {exact}");
    }
}
