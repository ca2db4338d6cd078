//! What a search found, without the digits that depend on the processor.
//!
//! Linear algebra adds up in another order where vectors are wider, or rounds once where a processor multiplies and
//! adds in one step. So the last digits of a fit differ from machine to machine, by some 1e-12 of a thickness. What
//! goes into files and voxels is rounded far above that; a value within 1e-12 of the middle of two steps, one in some
//! million, may still go either way.

/// Of lengths in mm, shares, albedos and factors of them: 1 nm, far below a voxel, and 1e-6.
const DECIMALS: f64 = 1e6;

/// `value`, a length in mm, a share, an albedo or a factor, to six decimals.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * DECIMALS).round() / DECIMALS
}

/// `value` to four significant digits, as objectives need: sums of squares of small errors.
pub(crate) fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_digits_go() {
        assert_eq!(rounded(0.249_217_770_051_973_01), rounded(0.249_217_770_053));
        assert_eq!(rounded(1.2), 1.2);
        assert_eq!(four_digits(4.378_478_492e-7), 4.378e-7);
        assert_eq!(four_digits(0.0), 0.0);
        assert!(four_digits(f64::INFINITY).is_infinite());
    }
}
