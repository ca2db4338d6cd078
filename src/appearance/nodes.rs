//! Nodes: texels on a surface that has no texture coordinates of its own, or none fine enough for what varies over it.
//!
//! After mesh colours (Yuksel, Keyser and House 2010): every triangle has a lattice of nodes between its corners, fine
//! enough for its size. They are kept as blocks of texels on pages of an [`Atlas`], so that whoever reads textures
//! reads nodes. Corners lie on the centres of texels, so that interpolating between texels interpolates over the
//! triangle, and neighbours agree along their edge as far as what is laid on the nodes agrees there. A triangle smaller
//! than the spacing has one node.
//!
//! ```text
//!    0 · · · 1     nodes of a triangle with corners 0, 1, 2, where its longest side runs from 1 to 2
//!    · · · · °     ° beyond the longest side: in the triangle's plane, so that four nodes around a point, bilinearly,
//!    · · · ° °       are as good as the three of its half of the cell
//!    2 ° ° ° °
//! ```

use glam::{DVec3, Vec2};

use super::charts::{Atlas, ChartMap, Place, for_covered_texels, wrap};
use crate::mesh::TriangleMesh;

/// Longest side of a page: texel centres of a power of two are exact in single precision.
const MAX_PAGE: usize = 4096;
/// Nodes that all pages together may have; the spacing grows until they do.
pub const MAX_NODES: usize = 1 << 23;
/// Longest side of a block.
const MAX_SIDE: usize = 1024;
/// Charts that blocks are numbered by: no two blocks that touch have the same.
const CHARTS: usize = u16::MAX as usize - 1;

/// Where a texel lies on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelSite {
    /// Index of its page.
    pub page: u16,
    /// Which texel of the page.
    pub texel: u32,
    /// Its triangle.
    pub triangle: u32,
    /// What the triangle's second and third corner weigh; a node beyond the triangle's side has more than 1 in all.
    pub weights: [f32; 2],
}

impl TexelSite {
    /// Its position, mm.
    pub fn position(&self, [a, b, c]: &[DVec3; 3]) -> DVec3 {
        let [v, w] = self.weights.map(f64::from);
        *a + (*b - *a) * v + (*c - *a) * w
    }

    /// The nearest weights within the triangle.
    pub fn within(&self) -> [f32; 2] {
        let sum = self.weights[0] + self.weights[1];
        if sum > 1.0 { self.weights.map(|weight| weight / sum) } else { self.weights }
    }
}

/// The nodes of one triangle.
struct Block {
    triangle: usize,
    /// Corners of the triangle: on the block's corner, along x, along y.
    order: [usize; 3],
    size: [usize; 2],
    page: usize,
    /// First texel on the page.
    corner: [usize; 2],
}

impl Block {
    fn new(triangle: usize, corners: [DVec3; 3], spacing_mm: f64) -> Self {
        let sides: [f64; 3] = std::array::from_fn(|i| corners[(i + 1) % 3].distance(corners[(i + 2) % 3]));
        let apex = (0..3).fold(0, |best, i| if sides[i] > sides[best] { i } else { best });
        let order = [apex, (apex + 1) % 3, (apex + 2) % 3];
        let cells = |side: f64| ((side / spacing_mm).ceil().max(1.0) as usize).min(MAX_SIDE - 1);
        // The side that a corner does not touch has its number.
        let size =
            if sides[apex] > spacing_mm { [cells(sides[order[2]]) + 1, cells(sides[order[1]]) + 1] } else { [1; 2] };
        Self { triangle, order, size, page: 0, corner: [0; 2] }
    }

    fn nodes(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Texture coordinates of the triangle's corners, on texel centres of a page of `size` texels.
    fn uvs(&self, size: [usize; 2]) -> [Vec2; 3] {
        let at = |x: usize, y: usize| {
            let texel = Vec2::new((self.corner[0] + x) as f32 + 0.5, (self.corner[1] + y) as f32 + 0.5);
            texel / Vec2::new(size[0] as f32, size[1] as f32)
        };
        let mut uvs = [at(0, 0); 3];
        uvs[self.order[1]] = at(self.size[0] - 1, 0);
        uvs[self.order[2]] = at(0, self.size[1] - 1);
        uvs
    }

    /// Weights of the triangle's second and third corner at node (x, y).
    fn weights(&self, x: usize, y: usize) -> [f32; 2] {
        let share = |at: usize, size: usize| if size > 1 { at as f32 / (size - 1) as f32 } else { 1.0 / 3.0 };
        let (along_x, along_y) = (share(x, self.size[0]), share(y, self.size[1]));
        let mut weights = [0.0; 3];
        weights[self.order[0]] = 1.0 - along_x - along_y;
        weights[self.order[1]] = along_x;
        weights[self.order[2]] = along_y;
        [weights[1], weights[2]]
    }
}

impl Atlas {
    /// Gives every triangle with a spacing (mm) nodes so far apart in place of the texels it had: new pages, and new
    /// texture coordinates in `mesh`, which the atlas was laid over. Pages that were there keep their places.
    ///
    /// Returns where the nodes lie, page after page.
    pub fn lay_nodes(&mut self, mesh: &mut TriangleMesh, spacing_mm: &[Option<f64>]) -> Vec<TexelSite> {
        let corners: Vec<[DVec3; 3]> = mesh.corners().collect();
        let mut blocks = Vec::new();
        for coarser in (0..24).map(|doublings| f64::from(1 << doublings)) {
            let wanted = spacing_mm.iter().enumerate().filter_map(|(t, mm)| Some((t, (*mm)?)));
            blocks = wanted.map(|(t, mm)| Block::new(t, corners[t], mm * coarser)).collect::<Vec<_>>();
            if blocks.iter().map(Block::nodes).sum::<usize>() <= MAX_NODES {
                break;
            }
        }
        let first = self.pages().len();
        let sizes = pack(&mut blocks);
        let page = |&[width, height]: &[usize; 2]| ChartMap {
            width: width as u32,
            height: height as u32,
            chart: vec![u16::MAX; width * height],
            source: vec![0; width * height],
        };
        let mut pages: Vec<ChartMap> = sizes.iter().map(page).collect();
        let mut places = Vec::with_capacity(blocks.len());
        let mut sites = Vec::new();
        for block in &blocks {
            let (page, chart) = (&mut pages[block.page], (block.triangle % CHARTS) as u16);
            let number = (first + block.page) as u16;
            for y in 0..block.size[1] {
                for x in 0..block.size[0] {
                    let texel = block.corner[0] + x + page.width as usize * (block.corner[1] + y);
                    page.chart[texel] = chart;
                    page.source[texel] = texel as u32;
                    let (triangle, weights) = (block.triangle as u32, block.weights(x, y));
                    sites.push(TexelSite { page: number, texel: texel as u32, triangle, weights });
                }
            }
            mesh.uvs[block.triangle] = block.uvs(sizes[block.page]);
            places.push((block.triangle, Place { page: number, chart }));
        }
        self.add_pages(pages, places);
        sites.sort_unstable_by_key(|site| (site.page, site.texel));
        sites
    }

    /// Where the covered texels of the pages `wanted` lie; one that several triangles cover, on the first of them.
    pub fn sites(&self, mesh: &TriangleMesh, wanted: impl Fn(u16) -> bool) -> Vec<TexelSite> {
        let mut seen: Vec<Vec<bool>> = self
            .pages()
            .iter()
            .enumerate()
            .map(|(number, page)| vec![false; if wanted(number as u16) { page.source.len() } else { 0 }])
            .collect();
        let pages = self.pages().iter().enumerate().filter(|(number, _)| wanted(*number as u16));
        let mut sites = Vec::with_capacity(pages.map(|(_, page)| page.covered().count()).sum());
        for ((triangle, uvs), place) in (0..).zip(&mesh.uvs).zip(self.places()) {
            let (page, seen) = (&self.pages()[usize::from(place.page)], &mut seen[usize::from(place.page)]);
            if seen.is_empty() {
                continue;
            }
            let size = Vec2::new(page.width as f32, page.height as f32);
            let [a, b, c] = uvs.map(|uv| uv * size - Vec2::splat(0.5));
            let (ab, ac) = (b - a, c - a);
            let scale = 1.0 / ab.perp_dot(ac);
            for_covered_texels([a, b, c], 0.0, size, |x, y| {
                let texel = (wrap(x, page.width) + page.width * wrap(y, page.height)) as usize;
                if !seen[texel] && page.source[texel] == texel as u32 {
                    seen[texel] = true;
                    let at = Vec2::new(x as f32, y as f32) - a;
                    let weights = [at.perp_dot(ac) * scale, ab.perp_dot(at) * scale];
                    let weights =
                        if weights.iter().all(|weight| weight.is_finite()) { weights } else { [1.0 / 3.0; 2] };
                    sites.push(TexelSite { page: place.page, texel: texel as u32, triangle, weights });
                }
            });
        }
        sites.sort_unstable_by_key(|site| (site.page, site.texel));
        sites
    }
}

/// Gives every block its place, on shelves of blocks alike in height; the sizes of the pages come back.
fn pack(blocks: &mut [Block]) -> Vec<[usize; 2]> {
    if blocks.is_empty() {
        return Vec::new();
    }
    blocks.sort_by_key(|block| (block.size[1], block.size[0], block.triangle));
    let room: usize = blocks.iter().map(Block::nodes).sum();
    let widest = blocks.iter().map(|block| block.size[0]).max().unwrap_or(1);
    let width = ((room as f64).sqrt().ceil() as usize).max(widest).next_power_of_two().min(MAX_PAGE);
    let mut pages = Vec::new();
    let ([mut x, mut y], mut shelf) = ([0, 0], 0);
    for block in blocks {
        if x + block.size[0] > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        if y + block.size[1] > MAX_PAGE {
            pages.push([width, y.next_power_of_two()]);
            (x, y, shelf) = (0, 0, 0);
        }
        block.page = pages.len();
        block.corner = [x, y];
        x += block.size[0];
        shelf = shelf.max(block.size[1]);
    }
    pages.push([width, (y + shelf).next_power_of_two()]);
    pages
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::{AlignedStackings, ClusterId, LabelMap, SlotTable, TexturedLayers, align};
    use crate::optics::{ResinId, Stack};
    use crate::voxel::MaterialId;

    /// Two triangles with a common side, one small one beside them, without texture coordinates.
    fn mesh() -> TriangleMesh {
        let p = |x, y| DVec3::new(x, y, 0.0);
        TriangleMesh {
            positions: vec![p(0.0, 0.0), p(4.0, 0.0), p(0.0, 3.0), p(4.0, 3.5), p(4.1, 0.0)],
            triangles: vec![[0, 1, 2], [3, 2, 1], [1, 4, 0]],
            uvs: vec![[Vec2::ZERO; 3]; 3],
            ..TriangleMesh::default()
        }
    }

    fn layers_of(mesh: &TriangleMesh, atlas: &Atlas, labels: Vec<LabelMap>, stacks: usize) -> TexturedLayers {
        // One layer, as many hundredths of a mm thick as its label says.
        let stacks: Vec<Stack> = (0..stacks).map(|n| Stack::new([(ResinId(0), 0.01 * (n + 1) as f64)])).collect();
        let aligned: AlignedStackings = align(&stacks);
        let slots =
            SlotTable::new(&[MaterialId(1)], &aligned, &[crate::search::ResinLimit::NONE], MaterialId(2)).unwrap();
        TexturedLayers::new(mesh, atlas, &labels, slots)
    }

    /// What is linear over the surface comes out linear, on both sides of an edge, within and on the sides.
    #[test]
    fn interpolation_between_nodes_is_that_over_the_triangle() {
        let mut mesh = mesh();
        let mut atlas = Atlas::new(&mesh, &[(1, 1)], &[]);
        let sites = atlas.lay_nodes(&mut mesh, &[Some(0.5), Some(0.3), None]);
        assert_eq!(atlas.places()[2].page, 0);
        let corners: Vec<_> = mesh.corners().collect();
        let thickness = |p: DVec3| 200.0 + 60.0 * p.x + 37.0 * p.y;
        let mut labels: Vec<LabelMap> =
            atlas.pages().iter().map(|page| LabelMap(vec![ClusterId(0); page.source.len()])).collect();
        for site in &sites {
            let position = site.position(&corners[site.triangle as usize]);
            labels[usize::from(site.page)].0[site.texel as usize] = ClusterId(thickness(position).round() as u16 - 1);
        }
        let layers = layers_of(&mesh, &atlas, labels, 1000);
        let mut row = Vec::new();
        for (t, &[p, q, r]) in corners[..2].iter().enumerate() {
            for (i, j) in (0..=40).flat_map(|i| (0..=40 - i).map(move |j| (i, j))) {
                let (v, w) = (i as f32 / 40.0, j as f32 / 40.0);
                let [a, b, c] = mesh.uvs[t];
                layers.bottoms(t as u32, a + (b - a) * v + (c - a) * w, &mut row);
                let at = p + (q - p) * f64::from(v) + (r - p) * f64::from(w);
                let expected = 0.01 * thickness(at);
                assert!((f64::from(row[0]) - expected).abs() < 0.0101, "{} instead of {expected} at {at}", row[0]);
            }
        }
    }

    #[test]
    fn a_triangle_smaller_than_the_spacing_has_one_node() {
        let mut mesh = mesh();
        let mut atlas = Atlas::new(&mesh, &[(1, 1)], &[]);
        let sites = atlas.lay_nodes(&mut mesh, &[Some(7.0); 3]);
        assert_eq!(sites.len(), 3);
        let middle = sites.iter().find(|site| site.triangle == 0).unwrap();
        let at = middle.position(&[DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 3.0]);
        assert!(at.distance(DVec3::new(1.0, 1.0, 0.0)) < 1e-6);
    }

    #[test]
    fn too_many_nodes_are_fewer() {
        let mut mesh = mesh();
        let mut atlas = Atlas::new(&mesh, &[(1, 1)], &[]);
        let sites = atlas.lay_nodes(&mut mesh, &[Some(1e-6); 3]);
        assert!(sites.len() > 100_000 && sites.len() <= MAX_NODES, "{}", sites.len());
    }

    #[test]
    fn texels_of_a_texture_lie_where_their_coordinates_are() {
        let mut mesh = mesh();
        mesh.uvs = vec![
            [Vec2::ZERO, Vec2::X, Vec2::Y],
            [Vec2::ONE, Vec2::Y, Vec2::X],
            [Vec2::X, Vec2::new(1.1, 0.0), Vec2::ZERO],
        ];
        let atlas = Atlas::new(&mesh, &[(8, 8)], &[]);
        let sites = atlas.sites(&mesh, |_| true);
        assert_eq!(sites.len(), 64);
        let corners: Vec<_> = mesh.corners().collect();
        for site in &sites {
            let at = site.position(&corners[site.triangle as usize]);
            let x = (f64::from(site.texel % 8) + 0.5) / 8.0;
            assert!((at.x - 4.0 * x).abs() < 1e-5, "{site:?} {at}");
        }
        assert!(atlas.sites(&mesh, |page| page == 1).is_empty());
    }
}
