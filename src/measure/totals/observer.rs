//! Spectra as red, green and blue: the CIE's observer of 1931 (2 degrees) under its daylight D65.
//!
//! A sheet's share of light in a channel is the mean of its spectrum, weighted by what the channel is made of: x̄, ȳ,
//! z̄ times D65, through the matrix of sRGB (IEC 61966-2-1). A white sheet has 1 in each. Weights are negative here and
//! there, so that a narrow band of colour may lie outside of what the three can hold.

/// Name as files say it.
pub(super) const NAME: &str = "CIE 1931 2 degrees under D65, linear sRGB";

const TABLE: &str = include_str!("cie-1931-d65.csv");
/// XYZ (white's Y = 1) to linear sRGB.
const TO_RGB: [[f64; 3]; 3] = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// Wavelength in nm and its weights in red, green and blue, each of which sums up to 1.
pub(super) fn weights() -> Vec<(f64, [f64; 3])> {
    let rows = TABLE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
    let mut all: Vec<(f64, [f64; 3])> = rows
        .map(|row| row.split(',').map(number).collect::<Vec<f64>>())
        .filter(|row| row.len() == 5)
        .map(|row| (row[0], TO_RGB.map(|m| (m[0] * row[1] + m[1] * row[2] + m[2] * row[3]) * row[4])))
        .collect();
    let sums = [0, 1, 2].map(|c| all.iter().map(|(_, weights)| weights[c]).sum::<f64>());
    all.iter_mut().for_each(|(_, weights)| (0..3).for_each(|c| weights[c] /= sums[c]));
    all
}

/// Red, green and blue of a spectrum, (nm, share) by rising wavelength; beyond its ends it stays as it ends.
pub(super) fn rgb(spectrum: &[(f64, f64)]) -> [f64; 3] {
    let at = |nm: f64| {
        let above = spectrum.partition_point(|point| point.0 <= nm);
        match (above.checked_sub(1).map(|i| spectrum[i]), spectrum.get(above)) {
            (Some(low), Some(high)) => low.1 + (nm - low.0) / (high.0 - low.0) * (high.1 - low.1),
            (Some(end), None) => end.1,
            (None, Some(end)) => end.1,
            (None, None) => f64::NAN,
        }
    };
    let mut sums = [0.0; 3];
    for (nm, weights) in weights() {
        let value = at(nm);
        (0..3).for_each(|c| sums[c] += weights[c] * value);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_and_the_table_is_daylight() {
        assert!(rgb(&[(380.0, 0.7), (730.0, 0.7)]).iter().all(|value| (value - 0.7).abs() < 1e-12));
        assert_eq!(weights().len(), 81);
        // White of D65 is (0.9505, 1, 1.089): so each channel's weights have the same sum before they are scaled.
        let rows: Vec<Vec<f64>> = TABLE
            .lines()
            .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
            .map(|row| row.split(',').map(|text| text.parse().unwrap()).collect())
            .collect();
        let sum = |i: usize| rows.iter().map(|row| row[i] * row[4]).sum::<f64>();
        assert!((sum(1) / sum(2) - 0.9505).abs() < 1e-3 && (sum(3) / sum(2) - 1.089).abs() < 1e-3);
    }

    /// What lies above 600 nm is red, what lies below 480 nm blue.
    #[test]
    fn bands_are_their_colours() {
        let band = |from: f64, to: f64| {
            let points: Vec<(f64, f64)> = (0..81)
                .map(|i| 380.0 + 5.0 * f64::from(i))
                .map(|nm| (nm, f64::from(u8::from(nm >= from && nm < to))))
                .collect();
            rgb(&points)
        };
        let ([r, _, b], [r2, _, b2]) = (band(600.0, 781.0), band(380.0, 480.0));
        assert!(r > 0.6 && b < 0.05 && b2 > 0.6 && r2 < 0.2, "{r} {b} {r2} {b2}");
    }
}
