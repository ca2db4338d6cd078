//! The spot is no point and neither are the camera's pixels: what both blur is undone near the centre.
//!
//! With f the profile and w the spot's brightness, a pixel records the mean of f ∗ w over its square. Light entering
//! within dr of the radius r, g(r) dr dθ of it with g = r f, is spread by the spot and lands in pixels, whose means go
//! into rings. This map from f to ring means is built as it happens, with the centre's place between the pixels and the
//! masked pixels left out, by points of light on a fine polar grid. Then f is the smoothest profile whose rings are
//! those measured: least squares with a prior on the second difference of ln(r f) for reflection, which falls like 1/r
//! at the centre, and of ln f for transmission, which is flat there (Gauss–Newton). Far out blurring is a small
//! correction, (σ²/2)·∇²f with σ² the blur's variance per axis; it is bounded and reported instead.

use faer::Mat;
use faer::linalg::solvers::{DenseSolveCore, Llt};

use super::Aperture;
use super::bracket::Radiance;
use super::rings::Grid;

/// Rings are deblurred to this many widths of the blur, where what is left to undo is below 0.3% for a profile like
/// r⁻³.
const ZONE_WIDTHS: f64 = 12.0;
/// Only rings this many standard errors above zero are deblurred: the fit is one of logarithms.
const CLEAR: f64 = 3.0;
/// At most so many rings; the map has their square.
const MAX_ZONE: usize = 160;
/// Second difference of the logarithm between three rings that is thought likely. The synthetic resins have 0.02 at 44
/// µm.
const SMOOTH: f64 = 0.04;
/// Points of light are this close in r, in parts of a ring or of a pixel, whichever is smaller.
const POINTS: f64 = 12.0;
/// Fewest points around.
const MIN_AROUND: usize = 128;
/// Nodes per axis across the spot.
const ACROSS: usize = 8;
/// Ring means are modelled to this share: the points' grid, the pixels' crosstalk.
const MODEL_ERROR: f64 = 0.003;
const STEPS: usize = 12;

/// How f behaves at the centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Centre {
    /// Like 1/r: reflection.
    Pole,
    /// Flat: transmission.
    Flat,
}

/// A profile near the centre without blur.
pub(super) struct Deblurred {
    /// Ring means of f, and their standard errors; to be used in place of the measured ones.
    pub mean: Vec<f64>,
    pub error: Vec<f64>,
    /// Largest share by which blur still changes the rings beyond.
    pub bound: f64,
}

impl Aperture {
    /// Offsets over the spot, all of one weight, mm.
    fn points(&self) -> Vec<[f64; 2]> {
        let node = |i: usize| (i as f64 + 0.5) / ACROSS as f64 - 0.5;
        let square = (0..ACROSS).flat_map(|i| (0..ACROSS).map(move |j| [node(i), node(j)]));
        match *self {
            Self::Square { side_mm } => square.map(|[x, y]| [x * side_mm, y * side_mm]).collect(),
            Self::Disc { diameter_mm } => {
                // Equal areas: r² even, angles by the golden section.
                let count = ACROSS * ACROSS;
                let point = |i: usize| {
                    let r = 0.5 * diameter_mm * ((i as f64 + 0.5) / count as f64).sqrt();
                    let angle = i as f64 * std::f64::consts::TAU * 0.618_033_988_75;
                    [r * libm::cos(angle), r * libm::sin(angle)]
                };
                (0..count).map(point).collect()
            }
        }
    }

    /// Variance per axis, mm².
    fn variance(&self) -> f64 {
        match *self {
            Self::Square { side_mm } => side_mm * side_mm / 12.0,
            Self::Disc { diameter_mm } => diameter_mm * diameter_mm / 16.0,
        }
    }
}

/// f ∝ e^u/r or e^u between nodes at the centre and the rings' mean radii, u straight in between.
struct Shape<'a> {
    grid: &'a Grid,
    centre: Centre,
}

impl Shape<'_> {
    /// Node below a radius, and how far the radius is on to the next.
    fn node(&self, r: f64) -> (usize, f64) {
        let radius = |node: usize| if node == 0 { 0.0 } else { self.grid.radius(node - 1) };
        let mut node = (r / self.grid.bin_mm + 0.5) as usize;
        while radius(node) > r {
            node -= 1;
        }
        (node, (r - radius(node)) / (radius(node + 1) - radius(node)))
    }

    /// f(r)·r.
    fn g(&self, u: &[f64], r: f64) -> f64 {
        let (node, at) = self.node(r);
        let next = u[(node + 1).min(u.len() - 1)];
        let value = libm::exp(u[node.min(u.len() - 1)] * (1.0 - at) + next * at);
        if self.centre == Centre::Pole { value } else { value * r }
    }
}

/// Undoes the blur of the innermost rings. `None` if there is nothing to undo: blur narrower than a tenth of a ring.
pub(super) fn deblur(
    picture: &Radiance,
    grid: &Grid,
    spot: Option<Aperture>,
    centre: Centre,
    mean: &[f64],
    error: &[f64],
) -> Option<Deblurred> {
    let pixel_variance = grid.mm_per_pixel * grid.mm_per_pixel / 12.0;
    let spot_variance = spot.map_or(0.0, |spot| spot.variance());
    // A ring's mean takes a pixel as even over its square, which blurs once more.
    let variance = spot_variance + 2.0 * pixel_variance;
    let width = (12.0 * variance).sqrt();
    if width < 0.1 * grid.bin_mm {
        return None;
    }
    let margin = (width / grid.bin_mm).ceil() as usize + 2;
    let zone = ((ZONE_WIDTHS * width / grid.bin_mm).ceil() as usize).clamp(8, MAX_ZONE);
    let clear = mean.iter().zip(error).take_while(|(mean, error)| **mean > CLEAR * **error).count();
    let zone = zone.min(clear.checked_sub(margin + 1).filter(|zone| *zone >= 4)?);
    let all = zone + margin;
    let shape = Shape { grid, centre };
    let points = spot.map_or_else(|| vec![[0.0; 2]], |spot| spot.points());
    let radii = polar_radii(grid, all);
    let map = blur_map(picture, grid, &points, &radii, all);
    let own = own_map(grid, &radii, all);

    let to_u = |bin: usize| libm::log(mean[bin] * if centre == Centre::Pole { grid.radius(bin) } else { 1.0 });
    let mut u: Vec<f64> = std::iter::once(0).chain(0..all).map(to_u).collect();
    let data_error = |bin: usize| libm::hypot(error[bin], MODEL_ERROR * mean[bin]);
    let nodes = u.len();
    let mut inverse = Mat::<f64>::zeros(nodes, nodes);
    for _ in 0..STEPS {
        let (predicted, jacobian) = apply(&map, &shape, &u, &radii);
        let (unblurred, own_jacobian) = apply(&own, &shape, &u, &radii);
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        for bin in 0..all {
            // Beyond the zone the map misses light from outside: there f is what was measured.
            let (value, slope) =
                if bin < zone { (predicted[bin], &jacobian[bin]) } else { (unblurred[bin], &own_jacobian[bin]) };
            let weight = 1.0 / data_error(bin);
            rows.push((slope.iter().map(|s| s * weight).collect(), (mean[bin] - value) * weight));
        }
        for node in 1..nodes - 1 {
            let mut row = vec![0.0; nodes];
            let [a, b, c] = second_difference(&shape, node);
            (row[node - 1], row[node], row[node + 1]) = (a / SMOOTH, b / SMOOTH, c / SMOOTH);
            let bend = a * u[node - 1] + b * u[node] + c * u[node + 1];
            rows.push((row, -bend / SMOOTH));
        }
        let mut normal = Mat::<f64>::zeros(nodes, nodes);
        let mut right = vec![0.0; nodes];
        for (row, value) in &rows {
            let filled: Vec<usize> = (0..nodes).filter(|&i| row[i] != 0.0).collect();
            for &i in &filled {
                right[i] += row[i] * value;
                filled.iter().for_each(|&j| normal[(i, j)] += row[i] * row[j]);
            }
        }
        inverse = self::inverse(&normal)?;
        let step: Vec<f64> = (0..nodes).map(|i| (0..nodes).map(|j| inverse[(i, j)] * right[j]).sum()).collect();
        let longest = step.iter().fold(0.0_f64, |longest, step| longest.max(step.abs()));
        let shorten = (0.5 / longest).min(1.0);
        u.iter_mut().zip(&step).for_each(|(u, step)| *u += shorten * step);
        if longest < 1e-6 {
            break;
        }
    }
    let (unblurred, jacobian) = apply(&own, &shape, &u, &radii);
    let spread = |slope: &Vec<f64>| {
        let along = |i: usize| (0..nodes).map(|j| inverse[(i, j)] * slope[j]).sum::<f64>();
        (0..nodes).filter(|&i| slope[i] != 0.0).map(|i| slope[i] * along(i)).sum::<f64>().max(0.0).sqrt()
    };
    let errors = jacobian[..zone].iter().map(spread).collect();
    let bound = blur_beyond(grid, mean, error, zone, variance);
    Some(Deblurred { mean: unblurred[..zone].to_vec(), error: errors, bound })
}

/// (σ²/2)·∇²f over f, at its largest beyond the zone where light is well above noise.
fn blur_beyond(grid: &Grid, mean: &[f64], error: &[f64], zone: usize, variance: f64) -> f64 {
    let share = |bin: usize| {
        let (r, h) = (grid.radius(bin), 4.0 * grid.bin_mm);
        let [before, here, after] = [mean[bin - 4], mean[bin], mean[bin + 4]];
        let laplacian = (before - 2.0 * here + after) / (h * h) + (after - before) / (2.0 * h * r);
        (0.5 * variance * laplacian / here).abs()
    };
    let clear = |bin: &usize| mean[*bin] > 50.0 * error[*bin];
    (zone.max(4)..mean.len().saturating_sub(4)).filter(clear).map(share).fold(0.0, f64::max)
}

/// Weights of u at three nodes whose sum is their second difference per squared ring width.
fn second_difference(shape: &Shape<'_>, node: usize) -> [f64; 3] {
    let radius = |node: usize| if node == 0 { 0.0 } else { shape.grid.radius(node - 1) };
    let (before, after) = (radius(node) - radius(node - 1), radius(node + 1) - radius(node));
    let bin2 = shape.grid.bin_mm * shape.grid.bin_mm;
    let (a, c) = (2.0 * bin2 / (before * (before + after)), 2.0 * bin2 / (after * (before + after)));
    [a, -a - c, c]
}

/// Radii of the points, and their spacing.
struct Radii {
    step: f64,
    count: usize,
}

impl Radii {
    fn at(&self, i: usize) -> f64 {
        (i as f64 + 0.5) * self.step
    }
}

fn polar_radii(grid: &Grid, rings: usize) -> Radii {
    // A whole number of steps a ring, so that rings own theirs.
    let per_ring = (POINTS * (grid.bin_mm / grid.mm_per_pixel).max(1.0)).ceil();
    Radii { step: grid.bin_mm / per_ring, count: (rings as f64 * per_ring) as usize }
}

/// Ring means per unit of g at each radius: `map[ring]` lists (radius, weight).
type LightMap = Vec<Vec<(usize, f64)>>;

/// As the camera sees it.
fn blur_map(picture: &Radiance, grid: &Grid, points: &[[f64; 2]], radii: &Radii, rings: usize) -> LightMap {
    let scale = grid.mm_per_pixel;
    let reach = (rings as f64 * grid.bin_mm / scale).ceil() as isize + 3;
    let corner = [grid.centre[0].round() as isize - reach, grid.centre[1].round() as isize - reach];
    let side = (2 * reach + 1) as usize;
    let mut shares: Vec<Vec<(usize, f64)>> = vec![Vec::new(); side * side];
    let mut areas = vec![0.0; rings];
    for row in 0..side {
        for column in 0..side {
            let (x, y) = (corner[0] + column as isize, corner[1] + row as isize);
            let inside = (0..picture.width as isize).contains(&x) && (0..picture.height as isize).contains(&y);
            if !inside || picture.at(x as usize, y as usize).is_nan() {
                continue;
            }
            grid.shares(x as f64 - grid.centre[0], y as f64 - grid.centre[1], |bin, share| {
                if bin < rings {
                    shares[row * side + column].push((bin, share));
                    areas[bin] += share;
                }
            });
        }
    }
    let mut map: LightMap = vec![Vec::new(); rings];
    let mut sums = vec![0.0; rings];
    for i in 0..radii.count {
        let r = radii.at(i);
        let around = ((std::f64::consts::TAU * r / scale * 6.0) as usize).max(MIN_AROUND);
        sums.fill(0.0);
        for j in 0..around {
            // Each radius is turned by the golden section, so that points do not line up with pixels.
            let angle = std::f64::consts::TAU * (j as f64 / around as f64 + i as f64 * 0.618_033_988_75);
            let (x, y) = (r * libm::cos(angle), r * libm::sin(angle));
            for point in points {
                let column = (grid.centre[0] + (x + point[0]) / scale).round() as isize - corner[0];
                let row = (grid.centre[1] + (y + point[1]) / scale).round() as isize - corner[1];
                if (0..side as isize).contains(&column) && (0..side as isize).contains(&row) {
                    let at = row as usize * side + column as usize;
                    shares[at].iter().for_each(|(bin, share)| sums[*bin] += share);
                }
            }
        }
        // g dr dθ over a pixel's area, as a mean over a ring's pixels.
        let light = std::f64::consts::TAU * radii.step / (around * points.len()) as f64 / (scale * scale);
        for (bin, sum) in sums.iter().enumerate().filter(|(_, sum)| **sum > 0.0) {
            map[bin].push((i, sum * light / areas[bin]));
        }
    }
    map
}

/// As it is: every ring has the light of its own radii.
fn own_map(grid: &Grid, radii: &Radii, rings: usize) -> LightMap {
    let per_ring = radii.count / rings;
    let ring = |bin: usize| {
        let weight = std::f64::consts::TAU * radii.step / grid.area(bin);
        (bin * per_ring..(bin + 1) * per_ring).map(|i| (i, weight)).collect()
    };
    (0..rings).map(ring).collect()
}

/// Ring means of e^u and their derivatives by u.
fn apply(map: &LightMap, shape: &Shape<'_>, u: &[f64], radii: &Radii) -> (Vec<f64>, Vec<Vec<f64>>) {
    let g: Vec<(f64, usize, f64)> = (0..radii.count)
        .map(|i| {
            let (node, at) = shape.node(radii.at(i));
            (shape.g(u, radii.at(i)), node, at)
        })
        .collect();
    let last = u.len() - 1;
    let ring = |weights: &Vec<(usize, f64)>| {
        let (mut mean, mut slope) = (0.0, vec![0.0; u.len()]);
        for (i, weight) in weights {
            let (g, node, at) = g[*i];
            mean += weight * g;
            slope[node.min(last)] += weight * g * (1.0 - at);
            slope[(node + 1).min(last)] += weight * g * at;
        }
        (mean, slope)
    };
    map.iter().map(ring).unzip()
}

/// Inverse of a symmetric positive matrix.
pub(super) fn inverse(matrix: &Mat<f64>) -> Option<Mat<f64>> {
    Llt::new(matrix.as_ref(), faer::Side::Lower).ok().map(|factor| factor.inverse())
}
