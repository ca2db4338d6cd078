//! Functions of complex numbers that give the same bits everywhere: those of [`c64`] itself ask the C library for exp,
//! sin and cos, which picks them by the processor.

use faer::c64;

/// |z|.
pub(crate) fn norm(z: c64) -> f64 {
    libm::hypot(z.re, z.im)
}

/// e^z.
pub(crate) fn exp(z: c64) -> c64 {
    let (size, (sin, cos)) = (libm::exp(z.re), libm::sincos(z.im));
    c64::new(size * cos, size * sin)
}

/// The square root that has no negative real part.
pub(crate) fn sqrt(z: c64) -> c64 {
    let size = norm(z);
    // The larger part first: the other would be a difference of what is nearly equal.
    let larger = (0.5 * (size + z.re.abs())).sqrt();
    if larger == 0.0 {
        return c64::new(0.0, z.im);
    }
    let other = 0.5 * z.im / larger;
    if z.re >= 0.0 { c64::new(larger, other) } else { c64::new(other.abs(), larger.copysign(z.im)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_and_powers_undo_each_other() {
        for z in [(4.0, 0.0), (-4.0, 0.0), (-4.0, -0.0), (1e-200, -3.0), (-2.0, 1e-9), (-3.0, -4.0), (0.0, 0.0)] {
            let z = c64::new(z.0, z.1);
            let root = sqrt(z);
            assert!(norm(root * root - z) <= 4e-16 * norm(z) && root.re >= 0.0, "{z}: {root}");
            assert!(root.im * z.im >= 0.0, "{z}: {root}");
            assert!(norm(exp(z) - z.exp()) <= 4e-16 * norm(exp(z)), "{z}");
        }
    }
}
