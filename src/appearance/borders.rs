//! Where materials end: texels of unlike albedo side by side, between which nothing is interpolated.
//!
//! *Guaranteed:* across a border every point has layers of the side that its nearest texel is on. *Not:* that being of
//! one side is handed on. Of texels with albedos 0.3, 0.42 and 0.6 the outer two are apart, and the middle one is of
//! either side: in a gradient as steep as that a step is left where the nearest texel changes.

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
