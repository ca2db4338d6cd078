//! Packing charts into a square texture as their outlines are, not as boxes: every chart becomes a bit mask of
//! coarse cells with a margin, and takes the lowest free place in any of four turns.

use std::cmp::Reverse;

use glam::{DVec2, dvec2};

use crate::charts::Chart;

/// Texels per side of a cell. A margin of one cell round every chart keeps two charts at least 8 texels apart.
const CELL: usize = 4;
/// Bisection steps for the scale; twelve find it to 0.01%.
const STEPS: usize = 12;

/// Where every triangle's corners lie in the texture: in texels, x right, y down.
pub struct Atlas {
    /// Texels per side.
    pub size: usize,
    /// Chart of every triangle.
    pub chart_of: Vec<usize>,
    /// Corners of every triangle.
    pub corners: Vec<[DVec2; 3]>,
    /// Texels per mm.
    pub scale: f64,
}

/// Rows of bits, bit x of a row in word x / 64.
#[derive(Clone)]
struct Mask {
    width: usize,
    rows: Vec<Vec<u64>>,
}

impl Mask {
    fn new(width: usize, height: usize) -> Self {
        Self { width, rows: vec![vec![0; width.div_ceil(64)]; height] }
    }

    fn get(&self, x: usize, y: usize) -> bool {
        self.rows[y][x / 64] >> (x % 64) & 1 == 1
    }

    fn set(&mut self, x: usize, y: usize) {
        self.rows[y][x / 64] |= 1 << (x % 64);
    }

    /// Quarter turn that takes (x, y) to (height − 1 − y, x).
    fn turned(&self) -> Self {
        let height = self.rows.len();
        let mut turned = Self::new(height, self.width);
        for y in 0..height {
            (0..self.width).filter(|&x| self.get(x, y)).for_each(|x| turned.set(height - 1 - y, x));
        }
        turned
    }

    /// The mask and the eight cells round each of its cells; none of them may lie on the border.
    fn grown(&self) -> Self {
        let mut grown = self.clone();
        for y in 0..self.rows.len() {
            for x in (0..self.width).filter(|&x| self.get(x, y)) {
                (y - 1..=y + 1).for_each(|v| (x - 1..=x + 1).for_each(|u| grown.set(u, v)));
            }
        }
        grown
    }

    /// The words of row `y`, moved right by `by` bits: (word index, bits).
    fn shifted(&self, y: usize, by: usize) -> impl Iterator<Item = (usize, u64)> {
        let (words, bits) = (by / 64, by % 64);
        let low = self.rows[y].iter().enumerate().map(move |(i, &w)| (i + words, w << bits));
        let high = self.rows[y].iter().enumerate().map(move |(i, &w)| (i + words + 1, w >> 1 >> (63 - bits)));
        low.chain(high).filter(|word| word.1 != 0)
    }

    fn fits(&self, chart: &Self, x: usize, y: usize) -> bool {
        (0..chart.rows.len()).all(|r| chart.shifted(r, x).all(|(i, word)| self.rows[y + r][i] & word == 0))
    }

    fn occupy(&mut self, chart: &Self, x: usize, y: usize) {
        for r in 0..chart.rows.len() {
            for (i, word) in chart.shifted(r, x) {
                self.rows[y + r][i] |= word;
            }
        }
    }
}

/// Packs `charts` into a texture of `size`², as large as they fit; `None` if not even a tenth of full scale fits.
pub fn pack(charts: &[Chart], size: usize) -> Option<Atlas> {
    let area: f64 = charts.iter().flat_map(|c| &c.corners).map(|[a, b, c]| (*b - *a).perp_dot(*c - *a) / 2.0).sum();
    let full = size as f64 / area.sqrt();
    let (mut fits, mut fails) = (0.1 * full, full);
    let mut best = try_scale(charts, size, fits)?;
    for _ in 0..STEPS {
        let scale = (fits + fails) / 2.0;
        match try_scale(charts, size, scale) {
            Some(atlas) => (best, fits) = (atlas, scale),
            None => fails = scale,
        }
    }
    Some(best)
}

fn try_scale(charts: &[Chart], size: usize, scale: f64) -> Option<Atlas> {
    let cells = size / CELL;
    let mut page = Mask::new(cells, cells);
    let mut pieces: Vec<Piece> = charts.iter().map(|chart| Piece::new(chart, scale)).collect();
    // Long charts first: they are the hardest to place.
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by_key(|&i| (Reverse(pieces[i].mask.rows.len().max(pieces[i].mask.width)), i));
    let triangles = charts.iter().map(|c| c.triangles.len()).sum();
    let mut atlas = Atlas { size, chart_of: vec![0; triangles], corners: vec![[DVec2::ZERO; 3]; triangles], scale };
    for index in order {
        let piece = &mut pieces[index];
        // (lowest row below the piece, column, row, quarter turns): the least is best.
        let mut best: Option<(usize, usize, usize, usize)> = None;
        for turns in 0..4 {
            if let Some((x, y)) = lowest_place(&page, &piece.mask) {
                let place = (y + piece.mask.rows.len(), x, y, turns);
                best = Some(best.map_or(place, |b| b.min(place)));
            }
            piece.turn();
        }
        let (_, x, y, turns) = best?;
        (0..turns).for_each(|_| piece.turn());
        page.occupy(&piece.mask, x, y);
        let offset = dvec2((x * CELL) as f64, (y * CELL) as f64);
        for (&t, corners) in charts[index].triangles.iter().zip(&piece.corners) {
            atlas.chart_of[t] = index;
            atlas.corners[t] = corners.map(|p| p + offset);
        }
    }
    Some(atlas)
}

fn lowest_place(page: &Mask, chart: &Mask) -> Option<(usize, usize)> {
    let rows = (page.rows.len() + 1).saturating_sub(chart.rows.len());
    let columns = (page.width + 1).saturating_sub(chart.width);
    (0..rows).find_map(|y| (0..columns).find(|&x| page.fits(chart, x, y)).map(|x| (x, y)))
}

/// A chart in texels, y down, at least one cell away from its mask's border.
struct Piece {
    corners: Vec<[DVec2; 3]>,
    /// Cells that the chart touches, and the cells next to them.
    mask: Mask,
}

impl Piece {
    fn new(chart: &Chart, scale: f64) -> Self {
        let flipped: Vec<[DVec2; 3]> = chart.corners.iter().map(|t| t.map(|p| dvec2(p.x, -p.y) * scale)).collect();
        let low = flipped.iter().flatten().fold(DVec2::MAX, |m, p| m.min(*p)) - CELL as f64;
        let corners: Vec<[DVec2; 3]> = flipped.iter().map(|t| t.map(|p| p - low)).collect();
        let high = corners.iter().flatten().fold(DVec2::ZERO, |m, p| m.max(*p)) / CELL as f64;
        let mut mask = Mask::new(high.x as usize + 2, high.y as usize + 2);
        for triangle in &corners {
            let cells = triangle.map(|p| p / CELL as f64);
            let (from, to) = (cells[0].min(cells[1]).min(cells[2]), cells[0].max(cells[1]).max(cells[2]));
            for y in from.y as usize..=to.y as usize {
                (from.x as usize..=to.x as usize).filter(|&x| touches(&cells, x, y)).for_each(|x| mask.set(x, y));
            }
        }
        Self { corners, mask: mask.grown() }
    }

    /// Turns the piece by a quarter, within the box that its mask becomes.
    fn turn(&mut self) {
        let height = (self.mask.rows.len() * CELL) as f64;
        self.corners.iter_mut().flatten().for_each(|p| *p = dvec2(height - p.y, p.x));
        self.mask = self.mask.turned();
    }
}

/// Whether a triangle touches the unit cell at (x, y), by separating axes along its sides.
fn touches(triangle: &[DVec2; 3], x: usize, y: usize) -> bool {
    let centre = dvec2(x as f64 + 0.5, y as f64 + 0.5);
    (0..3).all(|i| {
        let (a, b, c) = (triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
        let normal = (b - a).perp();
        let normal = if normal.dot(c - a) < 0.0 { -normal } else { normal };
        normal.dot(centre - a) >= -0.5 * (normal.x.abs() + normal.y.abs())
    })
}
