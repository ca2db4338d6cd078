//! Textures finer than the printer resolves. A page may be halved until its texels are the size of a voxel: light
//! spreads farther than that, and what is made of every texel costs memory and time. Means are taken over the texels
//! that a triangle covers, so that what lies between the charts does not bleed into them.

use glam::{DVec2, Vec2};

use super::charts::{for_covered_texels, wrap};
use crate::mesh::TriangleMesh;

/// Share of the surface whose texels may come out larger than was asked: slivers and what is stretched by mistake.
const STRETCHED: f64 = 0.01;

/// A page with fewer texels than its texture has.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduction {
    /// Texels per row and rows of the texture.
    full: [u32; 2],
    /// Texels per row and rows of the page.
    size: [u32; 2],
    /// Texels of the texture that triangles cover; empty where nothing was reduced.
    covered: Vec<bool>,
}

impl Reduction {
    /// Halves a page of `full` = (width, height) texels as long as the texels on the surface stay at most `finest_mm`
    /// long. The triangles that are `on_page` lie on it.
    pub fn new(mesh: &TriangleMesh, on_page: impl Fn(usize) -> bool, full: (u32, u32), finest_mm: f64) -> Self {
        let full = [full.0, full.1];
        let halvings = libm::log2(finest_mm / longest_texel(mesh, &on_page, full)).floor();
        let mut reduction = Self::none((full[0], full[1]));
        // Nothing lies on the page, or nothing that is known.
        if !(halvings >= 1.0 && halvings.is_finite()) {
            return reduction;
        }
        let by = 1_u32 << (halvings as u32).min(31);
        reduction.size = full.map(|texels| (texels / by).max(1));
        if reduction.size != full {
            reduction.covered = covered(mesh, &on_page, full);
        }
        reduction
    }

    /// Texels per row and rows that are left.
    pub fn size(&self) -> (u32, u32) {
        (self.size[0], self.size[1])
    }

    /// A page that has all texels of its texture.
    pub fn none((width, height): (u32, u32)) -> Self {
        Self { full: [width, height], size: [width, height], covered: Vec::new() }
    }

    /// The mean of what `value` is at the texels (x, y) of the texture that texel (x, y) of the page stands for.
    pub fn mean<const N: usize>(&self, x: u32, y: u32, value: impl Fn(u32, u32) -> [f32; N]) -> [f32; N] {
        if self.covered.is_empty() {
            return value(x, y);
        }
        let (mut sums, mut count) = ([0.0_f64; N], 0_u32);
        for [x, y] in self.texels(x, y) {
            sums.iter_mut().zip(value(x, y)).for_each(|(sum, value)| *sum += f64::from(value));
            count += 1;
        }
        sums.map(|sum| (sum / f64::from(count)) as f32)
    }

    /// Those texels: the covered ones, or all.
    fn texels(&self, x: u32, y: u32) -> impl Iterator<Item = [u32; 2]> {
        let span = |at: u32, axis: usize| {
            let (full, size) = (u64::from(self.full[axis]), u64::from(self.size[axis]));
            let at = u64::from(at);
            (at * full / size) as u32..((at + 1) * full).div_ceil(size) as u32
        };
        let (columns, rows) = (span(x, 0), span(y, 1));
        let is_covered = |[x, y]: [u32; 2]| self.covered[x as usize + self.full[0] as usize * y as usize];
        let all = move || {
            rows.clone().flat_map({
                let columns = columns.clone();
                move |y| columns.clone().map(move |x| [x, y])
            })
        };
        let none = !all().any(is_covered);
        all().filter(move |texel| none || is_covered(*texel))
    }
}

/// Length of a texel on the surface, mm, the longer way; the longest but for a small share of the surface.
fn longest_texel(mesh: &TriangleMesh, on_page: impl Fn(usize) -> bool, full: [u32; 2]) -> f64 {
    let size = DVec2::from(full.map(f64::from));
    let mut lengths: Vec<(f64, f64)> = Vec::new();
    for (_, (triangle, uvs)) in mesh.triangles.iter().zip(&mesh.uvs).enumerate().filter(|(index, _)| on_page(*index)) {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
        let (ab, ac) = (b - a, c - a);
        let area = ab.cross(ac).length() / 2.0;
        let [a, b, c] = uvs.map(|uv| uv.as_dvec2() * size);
        let (u, v) = (b - a, c - a);
        let turn = u.perp_dot(v);
        // A line of texels, or none: one colour.
        if turn == 0.0 || !turn.is_finite() || area == 0.0 {
            continue;
        }
        // Where one step along either axis of the texture leads; the longer axis of what a texel becomes.
        let (x, y) = ((ab * v.y - ac * u.y) / turn, (ac * u.x - ab * v.x) / turn);
        let (xx, yy, xy) = (x.length_squared(), y.length_squared(), x.dot(y));
        let longest = f64::midpoint(xx, yy) + (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt();
        lengths.push((longest.sqrt(), area));
    }
    lengths.sort_by(|a, b| b.0.total_cmp(&a.0));
    let stretched = STRETCHED * lengths.iter().map(|(_, area)| area).sum::<f64>();
    let mut passed = 0.0;
    let longest = lengths.iter().find(|(_, area)| {
        passed += area;
        passed > stretched
    });
    longest.map_or(f64::INFINITY, |(length, _)| *length)
}

/// The texels whose centres triangles cover.
fn covered(mesh: &TriangleMesh, on_page: impl Fn(usize) -> bool, [width, height]: [u32; 2]) -> Vec<bool> {
    let mut covered = vec![false; width as usize * height as usize];
    let size = Vec2::new(width as f32, height as f32);
    for (_, uvs) in mesh.uvs.iter().enumerate().filter(|(index, _)| on_page(*index)) {
        let corners = uvs.map(|uv| uv * size - Vec2::splat(0.5));
        for_covered_texels(corners, 0.0, size, |x, y| {
            covered[wrap(x, width) as usize + width as usize * wrap(y, height) as usize] = true;
        });
    }
    covered
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A triangle of 10 by 10 mm on the lower left half of the page.
    fn triangle() -> TriangleMesh {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        TriangleMesh {
            positions: corners.map(|[x, y]| 10.0 * DVec3::new(x, y, 0.0)).to_vec(),
            triangles: vec![[0, 1, 2]],
            uvs: vec![corners.map(|[x, y]| Vec2::new(x as f32, y as f32))],
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn texels_become_no_larger_than_asked() {
        // 10 µm each.
        let reduced = |finest_mm| Reduction::new(&triangle(), |_| true, (1000, 1000), finest_mm).size();
        assert_eq!(reduced(0.019), (1000, 1000));
        assert_eq!(reduced(0.021), (500, 500));
        assert_eq!(reduced(0.079), (250, 250));
        assert_eq!(reduced(1e6), (1, 1));
        // Twice as long as they are high.
        assert_eq!(Reduction::new(&triangle(), |_| true, (1000, 500), 0.03).size(), (1000, 500));
    }

    #[test]
    fn a_page_that_nothing_lies_on_stays() {
        assert_eq!(Reduction::new(&triangle(), |_| false, (1000, 1000), 1.0).size(), (1000, 1000));
        let mut point = triangle();
        point.uvs = vec![[Vec2::ZERO; 3]];
        assert_eq!(Reduction::new(&point, |_| true, (1000, 1000), 1.0).size(), (1000, 1000));
    }

    #[test]
    fn every_covered_texel_counts_once_and_no_other() {
        let reduction = Reduction::new(&triangle(), |_| true, (64, 64), 10.0 / 64.0 * 4.5);
        assert_eq!(reduction.size(), (16, 16));
        assert_eq!(reduction.texels(0, 0).count(), 16);
        // Its diagonal goes through the middle of these blocks; the corner is beyond it.
        assert_eq!(reduction.texels(8, 7).count(), 10);
        assert_eq!(reduction.texels(15, 15).count(), 16);
        assert!(reduction.texels(8, 7).all(|[x, y]| x + y < 64));
    }

    #[test]
    fn sizes_that_do_not_divide_are_shared_out() {
        let reduction = Reduction::new(&triangle(), |_| true, (7, 9), 100.0);
        assert_eq!(reduction.size(), (1, 1));
        assert_eq!(
            reduction.texels(0, 0).count(),
            covered(&triangle(), |_| true, [7, 9]).iter().filter(|c| **c).count()
        );
    }
}
