//! The profile of every single texel, as `lumislice factor` keeps them in `profiles.npy`.

use std::{io::Read, path::Path};

use super::CompareError;
use crate::appearance::{TexelRings, bssrdf::NpyHeader};

/// Reads `profiles.npy`, `[row][column][channel][ring]` per mm² over rings between `edges_mm`, and returns for each
/// texel the light within each edge of `rings` and the albedo. `weights` say how the channels are mixed.
pub(super) fn within(
    path: &Path,
    shape: [usize; 3],
    edges_mm: &[f64],
    rings: &TexelRings,
    weights: &[f64],
) -> Result<(Vec<Vec<f64>>, Vec<f64>), CompareError> {
    let [height, width, channels] = shape;
    let fault = |found: String| CompareError::Profiles { path: path.to_owned(), found };
    let mut file = crate::regular_file::open(path).map_err(|error| fault(error.to_string()))?;
    let header = NpyHeader::read(&mut file).map_err(|error| fault(error.to_string()))?;
    let own = edges_mm.len() - 1;
    if header.shape != [height, width, channels, own] {
        return Err(fault(format!("an array of shape {:?}", header.shape)));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(|error| fault(error.to_string()))?;
    let mut values = vec![0.0_f32; height * width * channels * own];
    if (bytes.len() as u64) < header.value_bytes() {
        return Err(fault(format!("{} bytes of values", bytes.len())));
    }
    header.decode(&bytes, &mut values);
    let shares = shares(edges_mm, rings.edges_mm());
    let area = |ring: usize| std::f64::consts::PI * (edges_mm[ring + 1].powi(2) - edges_mm[ring].powi(2));
    let texel = |profiles: &[f32]| {
        let energies: Vec<f64> = (0..own)
            .map(|ring| {
                let value = |(channel, weight): (usize, &f64)| weight * f64::from(profiles[channel * own + ring]);
                weights.iter().enumerate().map(value).sum::<f64>() * area(ring)
            })
            .collect();
        let within = shares.iter().map(|row| row.iter().map(|(ring, share)| energies[*ring] * share).sum()).collect();
        (within, energies.iter().sum::<f64>())
    };
    Ok(values.chunks(channels * own).map(texel).unzip())
}

/// For each edge of `to` the share of each of the rings between `from` that lies within it; those that lie beyond are
/// left out.
fn shares(from: &[f64], to: &[f64]) -> Vec<Vec<(usize, f64)>> {
    let share = |edge: &f64, ring: usize| {
        let [low, high] = [from[ring] * from[ring], from[ring + 1] * from[ring + 1]];
        ((edge * edge - low) / (high - low)).clamp(0.0, 1.0)
    };
    let row =
        |edge: &f64| (0..from.len() - 1).map(|ring| (ring, share(edge, ring))).filter(|(_, s)| *s > 0.0).collect();
    to.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_are_shared_out_by_area() {
        let found = shares(&[0.0, 1.0, 2.0], &[0.0, 0.5, 1.0, 1.5, 3.0]);
        assert_eq!(found[0], []);
        assert_eq!(found[1], [(0, 0.25)]);
        assert_eq!(found[2], [(0, 1.0)]);
        assert_eq!(found[3], [(0, 1.0), (1, 1.25 / 3.0)]);
        assert_eq!(found[4], [(0, 1.0), (1, 1.0)]);
    }
}
