//! Where materials end: texels of unlike albedo side by side, between which nothing is interpolated.
//!
//! *Guaranteed:* across a border every point has layers of the side that its nearest texel is on. *Not:* that being of
//! one side is handed on. Of texels with albedos 0.3, 0.42 and 0.6 the outer two are apart, and the middle one is of
//! either side: in a gradient as steep as that a step is left where the nearest texel changes.

use super::textured::TexturedLayers;
use crate::parallel;

/// Stands for the chart of a texel beside a border of materials, so that it is looked at more closely; no triangle has
/// a chart of that number.
pub(super) const BORDER: u16 = u16::MAX;

/// Logarithm of the ratio from which albedos are those of different materials: half as light again. Clusters of smooth
/// maps (samples/bssrdf: marble, stone) differ by less from texel to texel; a chess board's squares by 1.1.
const UNLIKE: f32 = 0.4;
/// Albedos below this are alike.
const BLACK: f64 = 1e-3;

/// The borders of a surface's labels.
#[derive(Debug, Clone, Default)]
pub(super) struct Borders {
    /// Logarithms of the albedos of every label, by channel.
    ln_albedo: Vec<Vec<f32>>,
    /// The charts of all texels, where some are beside a border; else none.
    pub charts: Vec<u16>,
}

impl Borders {
    /// Of labels with an `albedo` by channel; without any texels as yet.
    pub fn of(albedo: &[Vec<f64>]) -> Self {
        let ln = |albedo: &f64| libm::log(albedo.max(BLACK)) as f32;
        let ln_albedo = albedo.iter().map(|channels| channels.iter().map(ln).collect()).collect();
        Self { ln_albedo, charts: Vec::new() }
    }

    /// Whether no texel is beside one.
    #[inline(always)]
    pub fn are_none(&self) -> bool {
        self.charts.is_empty()
    }

    /// Whether two labels are those of different materials.
    pub fn part(&self, a: u16, b: u16) -> bool {
        let [Some(a), Some(b)] = [a, b].map(|label| self.ln_albedo.get(usize::from(label))) else { return false };
        a.iter().zip(b).any(|(a, b)| (a - b).abs() > UNLIKE)
    }
}

impl TexturedLayers {
    /// With borders where labels differ much in their `albedo`, by channel: materials that lie side by side do not fade
    /// into each other, and texels show where they end.
    #[must_use]
    pub fn parted(mut self, albedo: &[Vec<f64>]) -> Self {
        let mut borders = Borders::of(albedo);
        let mut at_border = Vec::new();
        for page in &self.pages {
            let (width, height) = (page.width as usize, page.height as usize);
            let texel = |x: usize, y: usize| self.texels[page.start + x + width * y];
            let of_row = |y: usize| -> Vec<bool> {
                let is_apart = |x: usize| {
                    let here = texel(x, y);
                    let around = [0, 1, 2].map(|dy| (y + height + dy - 1) % height);
                    let all = around.iter().flat_map(|&y| [0, 1, 2].map(|dx| texel((x + width + dx - 1) % width, y)));
                    all.into_iter().any(|there| there.chart == here.chart && borders.part(here.label, there.label))
                };
                (0..width).map(is_apart).collect()
            };
            at_border.extend(parallel::map(height, of_row).into_iter().flatten());
        }
        if at_border.contains(&true) {
            borders.charts = self.texels.iter().map(|texel| texel.chart).collect();
            let marked = self.texels.iter_mut().zip(at_border).filter(|(_, at_border)| *at_border);
            marked.for_each(|(texel, _)| texel.chart = BORDER);
        }
        self.borders = borders;
        self
    }
}
