//! Light in a flat sheet whose profile varies from place to place: Hašan et al. 2010, equation 7.
//!
//! ```text
//!   B(xₒ) = Σ E(xᵢ) √(P(xᵢ, r) P(xₒ, r)) · texel area     over all texels xᵢ, r = |xᵢ − xₒ|
//! ```
//!
//! Distances are taken in rings of whole texels. A ring stands for as much area as it has texels, so that a sheet of
//! one profile under even light has the profile's albedo, exactly. For each ring the square roots are an image, and the
//! sum over its texels a sum of shifted images. Beyond its edges the sheet goes on as its mirror image. Light that goes
//! farther than the last ring is spread evenly over the sheet.

use crate::optics::{FrequencyGrid, InverseHankel};
use crate::parallel;

/// Texels around a texel, in rings by their distance rounded to whole texels.
#[derive(Debug, Clone, PartialEq)]
pub struct TexelRings {
    /// Offsets (columns, rows) of each ring.
    offsets: Vec<Vec<[isize; 2]>>,
    edges_mm: Vec<f64>,
    texel_mm2: f64,
}

/// Rings that hold profiles end where this share of the light of all of them is within them…
const WITHIN: f64 = 0.99;
/// …but at this many texels at most: beyond, light is spread evenly.
const MAX_REACH: usize = 160;

impl TexelRings {
    /// Rings of texels of `pitch_mm` that hold most of the light of profiles, given by their Hankel transforms over
    /// `grid`.
    pub fn holding<'a>(pitch_mm: f64, spectra: impl IntoIterator<Item = &'a Vec<f64>>, grid: &FrequencyGrid) -> Self {
        let radius = |spectrum: &Vec<f64>| InverseHankel::new(spectrum, grid).radius_of_energy(WITHIN);
        let widest = spectra.into_iter().map(|spectrum| radius(spectrum).unwrap_or(f64::MAX)).fold(0.0, f64::max);
        Self::new(pitch_mm, ((widest / pitch_mm).ceil() as usize).clamp(1, MAX_REACH))
    }

    /// Rings 0 to `reach` of texels of `pitch_mm`.
    pub fn new(pitch_mm: f64, reach: usize) -> Self {
        let mut offsets = vec![Vec::new(); reach + 1];
        let far = reach as isize + 1;
        for dy in -far..=far {
            for dx in -far..=far {
                let ring = ((dx * dx + dy * dy) as f64).sqrt().round() as usize;
                if let Some(ring) = offsets.get_mut(ring) {
                    ring.push([dx, dy]);
                }
            }
        }
        let mut texels = 0;
        let edge = |ring: &Vec<[isize; 2]>| {
            texels += ring.len();
            (texels as f64 / std::f64::consts::PI).sqrt() * pitch_mm
        };
        let edges_mm = std::iter::once(0.0).chain(offsets.iter().map(edge)).collect();
        Self { offsets, edges_mm, texel_mm2: pitch_mm * pitch_mm }
    }

    /// Texels in all rings.
    pub fn texels(&self) -> usize {
        self.offsets.iter().map(Vec::len).sum()
    }

    /// Edges of the rings in mm, one more than rings, the first 0.
    pub fn edges_mm(&self) -> &[f64] {
        &self.edges_mm
    }
}

/// Profiles over [`TexelRings`], and the one that each texel has.
#[derive(Debug, Clone)]
pub struct LocalProfiles<'a> {
    rings: &'a TexelRings,
    /// √P, `[ring][profile]`, per mm.
    root: Vec<Vec<f32>>,
    /// Square root of the light beyond the last ring, by profile.
    beyond: Vec<f32>,
    /// Profile of each texel, row by row.
    of_texel: Vec<u32>,
    width: usize,
}

impl<'a> LocalProfiles<'a> {
    /// Profiles given by the light within each edge of `rings`, `within[profile][edge]` with 0 first, and their
    /// `albedo`; `of_texel` has rows of `width` texels. What is negative counts as 0.
    pub fn new(
        rings: &'a TexelRings,
        within: &[Vec<f64>],
        albedo: &[f64],
        of_texel: Vec<u32>,
        width: usize,
    ) -> LocalProfiles<'a> {
        let area = |ring: usize| rings.offsets[ring].len() as f64 * rings.texel_mm2;
        let mean = |profile: &Vec<f64>, ring: usize| (profile[ring + 1] - profile[ring]) / area(ring);
        let root = (0..rings.offsets.len())
            .map(|ring| within.iter().map(|profile| mean(profile, ring).max(0.0).sqrt() as f32).collect())
            .collect();
        let last = rings.offsets.len();
        let beyond = within.iter().zip(albedo).map(|(profile, all)| (all - profile[last]).max(0.0).sqrt() as f32);
        Self { rings, root, beyond: beyond.collect(), of_texel, width }
    }

    /// Profiles given by their Hankel transforms over `grid`.
    pub fn from_spectra(
        rings: &'a TexelRings,
        spectra: &[Vec<f64>],
        grid: &FrequencyGrid,
        of_texel: Vec<u32>,
        width: usize,
    ) -> LocalProfiles<'a> {
        let within = |spectrum: &Vec<f64>| -> Vec<f64> {
            let profile = InverseHankel::new(spectrum, grid);
            rings.edges_mm.iter().map(|&edge| profile.energy_within(edge)).collect()
        };
        let within: Vec<_> = parallel::map_all(spectra, within);
        let albedo: Vec<f64> = spectra.iter().map(|spectrum| spectrum[0]).collect();
        Self::new(rings, &within, &albedo, of_texel, width)
    }

    /// Radiosity under each of `lights`, irradiances row by row, in their unit.
    pub fn radiosity(&self, lights: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let (width, texels) = (self.width, self.of_texel.len());
        let mut seen = vec![vec![0.0_f32; texels]; lights.len()];
        for (ring, (root, offsets)) in self.root.iter().zip(&self.rings.offsets).enumerate() {
            let local: Vec<f32> = self.of_texel.iter().map(|&profile| root[profile as usize]).collect();
            for (light, seen) in lights.iter().zip(&mut seen) {
                let lit: Vec<f32> = local.iter().zip(light).map(|(root, light)| root * light).collect();
                let around = Mirrored::new(&lit, width, ring + 1);
                parallel::rows(seen, width, |y, seen| {
                    let mut sum = vec![0.0_f32; width];
                    for offset in offsets {
                        sum.iter_mut().zip(around.row(y, *offset)).for_each(|(sum, value)| *sum += value);
                    }
                    let area = self.rings.texel_mm2 as f32;
                    seen.iter_mut()
                        .zip(sum.iter().zip(&local[y * width..]))
                        .for_each(|(seen, (sum, root))| *seen += area * root * sum);
                });
            }
        }
        let beyond: Vec<f32> = self.of_texel.iter().map(|&profile| self.beyond[profile as usize]).collect();
        lights.iter().zip(&mut seen).for_each(|(light, seen)| spread(&beyond, light, seen));
        seen
    }
}

/// Adds light that goes far: what texel xₒ gets of xᵢ is √(t(xᵢ) t(xₒ)) over the number of texels, for `root` = √t.
pub(crate) fn spread(root: &[f32], light: &[f32], seen: &mut [f32]) {
    let sum: f64 = root.iter().zip(light).map(|(root, light)| f64::from(root * light)).sum();
    let mean = sum / root.len() as f64;
    seen.iter_mut().zip(root).for_each(|(seen, root)| *seen += (mean * f64::from(*root)) as f32);
}

/// An image with a margin that mirrors it, however wide.
struct Mirrored {
    values: Vec<f32>,
    width: usize,
    stride: usize,
    margin: usize,
}

impl Mirrored {
    fn new(image: &[f32], width: usize, margin: usize) -> Self {
        let (height, stride) = (image.len() / width, width + 2 * margin);
        let columns: Vec<usize> = (0..stride).map(|x| mirrored(x as isize - margin as isize, width)).collect();
        let rows = (0..height + 2 * margin).map(|y| mirrored(y as isize - margin as isize, height));
        let values = rows.flat_map(|y| columns.iter().map(move |x| image[x + width * y])).collect();
        Self { values, width, stride, margin }
    }

    /// The row whose first texel is (0, y) moved by an offset.
    fn row(&self, y: usize, [dx, dy]: [isize; 2]) -> &[f32] {
        let (x, y) = ((self.margin as isize + dx) as usize, ((y + self.margin) as isize + dy) as usize);
        &self.values[x + self.stride * y..][..self.width]
    }
}

/// The index in 0..n that an index beyond stands for where the ends are mirrors.
pub(crate) fn mirrored(index: isize, n: usize) -> usize {
    let n = n as isize;
    let within = index.rem_euclid(2 * n);
    (if within < n { within } else { 2 * n - 1 - within }) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light within r of a profile e^(−r/d)/(2πdr) of albedo a: a(1 − e^(−r/d)).
    fn within(rings: &TexelRings, albedo: f64, d: f64) -> Vec<f64> {
        rings.edges_mm().iter().map(|r| albedo * (1.0 - (-r / d).exp())).collect()
    }

    #[test]
    fn even_light_on_one_profile_shows_its_albedo() {
        let rings = TexelRings::new(0.1, 12);
        // Half of the light goes beyond the last ring.
        let local = LocalProfiles::new(&rings, &[within(&rings, 0.7, 1.8)], &[0.7], vec![0; 9 * 5], 9);
        let seen = local.radiosity(&[vec![1.0; 45]]);
        assert!(seen[0].iter().all(|value| (value - 0.7).abs() < 1e-5), "{seen:?}");
    }

    #[test]
    fn it_is_the_sum_that_equation_7_says() {
        let (width, height, reach) = (7_isize, 6_isize, 4);
        let rings = TexelRings::new(0.2, reach);
        let profiles = [within(&rings, 0.6, 0.1), within(&rings, 0.3, 0.2), within(&rings, 0.5, 0.15)];
        let label = |x: isize, y: isize| ((x * 5 + y * 3) % 3) as usize;
        let light = |x: isize, y: isize| (x % 3 + y) as f32;
        let cells = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let of_texel = cells().map(|(x, y)| label(x, y) as u32).collect();
        let albedo = [0, 1, 2].map(|profile: usize| profiles[profile][reach + 1]); // nothing beyond
        let local = LocalProfiles::new(&rings, &profiles, &albedo, of_texel, width as usize);
        let seen = local.radiosity(&[cells().map(|(x, y)| light(x, y)).collect(), vec![0.0; 42]]);
        // Brute force over the endless plane of mirror images.
        let fold = |x: isize, n: isize| mirrored(x, n as usize) as isize;
        for (at, (x, y)) in cells().enumerate() {
            let mut expected = 0.0;
            for dy in -6..=6_isize {
                for dx in -6..=6_isize {
                    let ring = ((dx * dx + dy * dy) as f64).sqrt().round() as usize;
                    let (xi, yi) = (fold(x + dx, width), fold(y + dy, height));
                    if ring <= reach {
                        let count = rings.offsets[ring].len() as f64;
                        let p = |label: usize| (profiles[label][ring + 1] - profiles[label][ring]) / count;
                        expected += f64::from(light(xi, yi)) * (p(label(x, y)) * p(label(xi, yi))).sqrt();
                    }
                }
            }
            assert!((f64::from(seen[0][at]) - expected).abs() < 1e-5, "({x}, {y}): {} and {expected}", seen[0][at]);
            assert_eq!(seen[1][at], 0.0);
        }
    }

    #[test]
    fn mirrors_repeat_the_ends() {
        let found: Vec<_> = (-4..7).map(|index| mirrored(index, 3)).collect();
        assert_eq!(found, [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!([mirrored(-5, 1), mirrored(7, 1)], [0, 0]);
    }
}
