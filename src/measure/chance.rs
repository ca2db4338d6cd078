//! Whether what a fit leaves is more than its errors explain.

/// Whether a sum of squares, in units of the errors, is more than chance makes of so many values to spare: of a thousand
/// about one is where there is one, and fewer where there are more.
pub(super) fn beyond_chance(squares: f64, spare: usize) -> bool {
    let spare = spare.max(1) as f64;
    squares > spare + 4.0 * (2.0 * spare).sqrt() + 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chance_is_that_of_chi_squared() {
        // Exceeded once in a thousand (Abramowitz and Stegun, table 26.8).
        for (spare, quantile) in [(1, 10.828), (10, 29.588), (40, 73.402)] {
            assert!(beyond_chance(1.1 * quantile, spare) && !beyond_chance(0.98 * quantile, spare), "{spare}");
        }
    }
}
