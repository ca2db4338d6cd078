//! Light by the measured 4D data themselves.

use super::CompareError;
use crate::appearance::{
    bssrdf::{Channel, Dataset},
    mirrored, spread,
};

/// Radiosity under each of `lights`: every lit texel spreads its light over its window. What a window puts beyond the
/// patch is mirrored, as equation 7 has it; what the measured albedo leaves for beyond the window is spread evenly.
pub(super) fn radiosity(
    dataset: &Dataset,
    channel: Channel,
    albedo_channel: usize,
    lights: &[Vec<f32>],
) -> Result<Vec<Vec<f32>>, CompareError> {
    let (width, height) = (dataset.width, dataset.height);
    let [window_width, window_height] = dataset.window;
    let area = (dataset.pitch_mm * dataset.pitch_mm) as f32;
    let mut seen = vec![vec![0.0_f32; width * height]; lights.len()];
    let mut beyond = vec![0.0_f32; width * height];
    let mut reader = dataset.responses.reader()?;
    let mut windows = Vec::new();
    for y in 0..height {
        reader.read(y, channel, &mut windows)?;
        let mut within = vec![0.0_f32; width];
        for (pixel, values) in windows.chunks(width).enumerate() {
            let dx = (pixel % window_width) as isize - (window_width / 2) as isize;
            let dy = (pixel / window_width) as isize - (window_height / 2) as isize;
            let row = width * mirrored(y as isize + dy, height);
            for (x, value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
                let (texel, lit) = (row + mirrored(x as isize + dx, width), x + width * y);
                within[x] += value * area;
                for (light, seen) in lights.iter().zip(&mut seen) {
                    seen[texel] += value * area * light[lit];
                }
            }
        }
        let albedo = |x: usize| {
            dataset.albedo.as_ref().map(|all| all[(x + width * y) * dataset.channels.len() + albedo_channel])
        };
        for (x, within) in within.into_iter().enumerate() {
            let left = albedo(x).filter(|albedo| albedo.is_finite()).map_or(0.0, |albedo| albedo - within);
            beyond[x + width * y] = left.max(0.0).sqrt();
        }
    }
    lights.iter().zip(&mut seen).for_each(|(light, seen)| spread(&beyond, light, seen));
    Ok(seen)
}
