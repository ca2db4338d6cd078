//! Points spread evenly over a surface, and means of what is known at them: how thick the solid is there, how its print
//! looked.
//!
//! Evenly by area: along the list of triangles every so many mm² a point, placed in its triangle by the sequence of the
//! plastic number, which fills a large triangle evenly too. Means weigh with a bell over the distance and with the
//! square of the cosine between normals, so that the two faces of a thin part and the two sides of an edge stay apart.

use glam::DVec3;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointOfSurface {
    /// Where, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
    /// Its triangle.
    pub triangle: u32,
}

/// Points of one surface, sorted into cubes.
#[derive(Debug, Clone)]
pub struct SurfacePoints {
    points: Vec<PointOfSurface>,
    /// Distance of neighbours, mm.
    spacing_mm: f64,
    /// Lower corner, edge of a cube, and cubes per axis.
    origin: DVec3,
    cube: f64,
    dims: [usize; 3],
    /// The points of cube n: `order[starts[n]..starts[n + 1]]`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

/// Most cubes; larger ones where they would be more.
const MAX_CUBES: f64 = (1 << 22) as f64;
/// Steps of the sequence of the plastic number (Roberts 2018): two irrational numbers that no fraction is near.
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

impl SurfacePoints {
    /// Points about `spacing_mm` apart, or farther where that would be more than `most`.
    pub fn spread(triangles: &[[DVec3; 3]], spacing_mm: f64, most: usize) -> Self {
        let area = |&[a, b, c]: &[DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let total: f64 = triangles.iter().map(area).sum();
        let each = (spacing_mm * spacing_mm).max(total / most.max(1) as f64);
        let mut points = Vec::new();
        let (mut sum, mut next) = (0.0, 0.5 * each);
        for (triangle, corners) in (0..).zip(triangles) {
            sum += area(corners);
            let [a, b, c] = *corners;
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            while next < sum {
                let [u, v] = STEPS.map(|step| (0.5 + points.len() as f64 * step).fract());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                points.push(PointOfSurface { point: a + (b - a) * u + (c - a) * v, normal, triangle });
                next += each;
            }
        }
        Self::sorted(triangles, points, each.sqrt())
    }

    /// Some points of triangles, each of which is known for itself alone where neighbours are `apart_mm` from each
    /// other or more: their spacing counts as half of that, so that there is no other within two.
    pub fn apart(triangles: &[[DVec3; 3]], points: Vec<PointOfSurface>, apart_mm: f64) -> Self {
        Self::sorted(triangles, points, 0.5 * apart_mm)
    }

    fn sorted(triangles: &[[DVec3; 3]], points: Vec<PointOfSurface>, spacing_mm: f64) -> Self {
        let corners = || triangles.iter().flatten();
        let low = corners().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let size = (corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p)) - low).max(DVec3::ZERO);
        let mut cube = 2.0 * spacing_mm;
        let count = |cube: f64| (size / cube).floor() + 1.0;
        while count(cube).element_product() > MAX_CUBES {
            cube *= 1.5;
        }
        let dims = count(cube).to_array().map(|n| n as usize);
        let mut found = Self { points, spacing_mm, origin: low, cube, dims, starts: Vec::new(), order: Vec::new() };
        let cubes: Vec<usize> = found.points.iter().map(|p| found.index(found.cell(p.point))).collect();
        found.starts = vec![0; dims.iter().product::<usize>() + 1];
        cubes.iter().for_each(|&cube| found.starts[cube + 1] += 1);
        for n in 1..found.starts.len() {
            found.starts[n] += found.starts[n - 1];
        }
        found.order = (0..found.points.len() as u32).collect();
        found.order.sort_by_key(|&point| cubes[point as usize]); // stable
        found
    }

    /// The points.
    pub fn points(&self) -> &[PointOfSurface] {
        &self.points
    }

    /// About how far apart neighbours are, mm.
    pub fn spacing_mm(&self) -> f64 {
        self.spacing_mm
    }

    fn cell(&self, at: DVec3) -> [usize; 3] {
        let cell = ((at - self.origin) / self.cube).floor().to_array();
        std::array::from_fn(|axis| (cell[axis].max(0.0) as usize).min(self.dims[axis] - 1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    /// Visits the points within `reach` mm of `at` that look the way of `normal`, in a fixed order, with their weights:
    /// (1 − d²/reach²)² cos².
    pub fn around(&self, at: DVec3, normal: DVec3, reach: f64, mut visit: impl FnMut(usize, f64)) {
        let [low, high] = [at - reach, at + reach].map(|corner| self.cell(corner));
        let inverse = 1.0 / (reach * reach);
        for (y, z) in (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (y, z))) {
            let row = self.index([low[0], y, z]);
            let range = self.starts[row] as usize..self.starts[row + high[0] - low[0] + 1] as usize;
            for &point in &self.order[range] {
                let there = &self.points[point as usize];
                let bell = 1.0 - (there.point - at).length_squared() * inverse;
                let cosine = normal.dot(there.normal);
                if bell > 0.0 && cosine > 0.0 {
                    visit(point as usize, (bell * cosine).powi(2));
                }
            }
        }
    }

    /// The mean around `at` of the values of points, one row of `values` each; of those within two spacings, or as many
    /// more as it takes to find one. Zeros where no point looks that way.
    pub fn interpolate<const N: usize>(&self, at: DVec3, normal: DVec3, values: &[[f64; N]]) -> [f64; N] {
        for widened in [2.0, 4.0, 8.0, 16.0] {
            let (mut sum, mut mean) = (0.0, [0.0; N]);
            self.around(at, normal, widened * self.spacing_mm, |point, weight| {
                sum += weight;
                mean.iter_mut().zip(values[point]).for_each(|(mean, value)| *mean += weight * value);
            });
            if sum > 0.0 {
                return mean.map(|mean| mean / sum);
            }
        }
        [0.0; N]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(size: f64, z: f64, up: bool) -> [[DVec3; 3]; 2] {
        let p = |x: f64, y: f64| DVec3::new(x * size, y * size, z);
        let [a, b, c, d] = [p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)];
        if up { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
    }

    #[test]
    fn points_lie_evenly_and_on_the_surface() {
        let plate: Vec<_> = square(10.0, 1.0, true).into_iter().chain(square(10.0, 0.0, false)).collect();
        let points = SurfacePoints::spread(&plate, 0.5, 100_000);
        assert_eq!(points.points().len(), 800);
        // Every square of 2 mm has its share on either side.
        for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
            let within = |p: &&PointOfSurface| (p.point.x / 2.0) as i32 == i && (p.point.y / 2.0) as i32 == j;
            for z in [0.0, 1.0] {
                let count = points.points().iter().filter(within).filter(|p| p.point.z == z).count();
                assert!((11..=21).contains(&count), "{count} of 16 in square ({i}, {j}) at {z}");
            }
        }
        assert!(points.points().iter().all(|p| p.normal.z == 2.0 * p.point.z - 1.0));
        assert_eq!(SurfacePoints::spread(&plate, 0.5, 50).points().len(), 50);
    }

    /// A lattice of texels: none blends into its neighbours, and between them the nearer ones count.
    #[test]
    fn points_apart_are_known_for_themselves() {
        let plate = square(2.0, 0.0, true);
        let at = |n: usize| DVec3::new(0.1 + 0.2 * (n % 10) as f64, 0.1 + 0.2 * (n / 10) as f64, 0.0);
        let places = (0..100).map(|n| PointOfSurface { point: at(n), normal: DVec3::Z, triangle: 0 }).collect();
        let points = SurfacePoints::apart(&plate, places, 0.2 - 1e-9);
        let values: Vec<[f64; 1]> = (0..100).map(|n| [(n * n) as f64]).collect();
        assert!((0..100).all(|n| points.interpolate(at(n), DVec3::Z, &values) == values[n]));
        let between = points.interpolate(at(44) + 0.1 * DVec3::X, DVec3::Z, &values)[0];
        assert!((between - 0.5 * (44.0 * 44.0 + 45.0 * 45.0)).abs() < 1e-9, "{between}");
    }

    #[test]
    fn means_keep_the_faces_of_a_plate_apart() {
        let plate: Vec<_> = square(10.0, 0.2, true).into_iter().chain(square(10.0, 0.0, false)).collect();
        let points = SurfacePoints::spread(&plate, 0.5, 100_000);
        let values: Vec<[f64; 2]> =
            points.points().iter().map(|p| [p.normal.z, p.normal.z * (3.0 + p.point.x)]).collect();
        for (z, normal) in [(0.2, DVec3::Z), (0.0, -DVec3::Z)] {
            let found = points.interpolate(DVec3::new(5.0, 5.0, z), normal, &values);
            assert_eq!(found[0], normal.z);
            assert!((found[1] - 8.0 * normal.z).abs() < 0.15, "{found:?}");
        }
        assert_eq!(points.interpolate(DVec3::new(5.0, 5.0, 0.2), DVec3::X, &values), [0.0; 2]);
        // All of them, in the same order every time.
        let mut order = Vec::new();
        points.around(DVec3::splat(5.0), DVec3::Z, 100.0, |point, _| order.push(point));
        assert_eq!(order.len(), 400);
    }
}
