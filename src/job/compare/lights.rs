//! The lights that slabs are looked at under.

/// A light on the sheet.
#[derive(Debug, Clone)]
pub(super) struct Lamp {
    /// For headings.
    pub name: &'static str,
    /// For keys of JSON.
    pub key: &'static str,
    /// Irradiance of each texel, row by row from the top.
    pub irradiance: Vec<f32>,
}

/// Diameter of the spot, a share of the shorter side.
const SPOT: f64 = 0.2;

/// Even light; light on the left half alone, as the paper's sharp shadow; a projected disc in the middle.
pub(super) fn lamps(width: usize, height: usize) -> [Lamp; 3] {
    let image = |lit: &dyn Fn(f64, f64) -> bool| {
        let centre = |at: usize| ((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
        (0..width * height).map(|at| f32::from(u8::from(lit(centre(at).0, centre(at).1)))).collect()
    };
    let (middle_x, middle_y) = (width as f64 / 2.0, height as f64 / 2.0);
    let radius = (0.5 * SPOT * width.min(height) as f64).max(0.5f64.sqrt());
    [
        Lamp { name: "area light", key: "area", irradiance: image(&|_, _| true) },
        Lamp { name: "shadow edge", key: "edge", irradiance: image(&|x, _| x < middle_x.max(1.0)) },
        Lamp {
            name: "projected spot",
            key: "spot",
            irradiance: image(&|x, y| libm::hypot(x - middle_x, y - middle_y) <= radius),
        },
    ]
}
