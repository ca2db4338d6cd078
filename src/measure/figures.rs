//! Numbers as people read them: no more digits than the error leaves, no fewer than the size needs.

/// Decimals that are ever written.
const MAX_DECIMALS: f64 = 12.0;

/// A value and its standard error, which has two digits that count; five significant digits where the error is 0.
pub fn plus_minus(value: f64, error: f64) -> String {
    if !(error > 0.0 && error.is_finite()) {
        return format!("{value:.*}", decimals(value, 5));
    }
    let decimals = decimals(error, 2);
    format!("{value:.decimals$} ± {error:.decimals$}")
}

/// A share in percent, two significant digits.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    format!("{percent:.*}%", decimals(percent, 2))
}

/// Decimals that show so many significant digits of a number.
fn decimals(number: f64, significant: u32) -> usize {
    if !(number.is_finite() && number != 0.0) {
        return 0;
    }
    (f64::from(significant) - 1.0 - libm::log10(number.abs()).floor()).clamp(0.0, MAX_DECIMALS) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_two_digits() {
        assert_eq!(plus_minus(0.627617, 0.001049), "0.6276 ± 0.0010");
        assert_eq!(plus_minus(0.0078583, 1.7e-6), "0.0078583 ± 0.0000017");
        assert_eq!(plus_minus(133.377, 25.0), "133 ± 25");
        assert_eq!(plus_minus(0.25, 0.0), "0.25000");
        assert_eq!((percent(0.0151), percent(8.2e-7), percent(0.0)), ("1.5%".into(), "0.000082%".into(), "0%".into()));
    }
}
