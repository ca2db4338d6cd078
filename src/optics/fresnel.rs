//! Unpolarised light at a plane boundary between two refractive indices: Snell's law and Fresnel's equations (Born and
//! Wolf, *Principles of Optics*, section 1.5).

/// Light that meets a boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Refraction {
    /// Share of the flux that is reflected; the same for the light that comes the other way.
    pub(crate) reflectance: f64,
    /// Cosine beyond the boundary, in (0, 1].
    pub(crate) cosine: f64,
}

/// Of light that meets the boundary from index `from` to index `into` at an angle of the given cosine in (0, 1];
/// `None`: all of it is reflected.
#[inline]
pub(crate) fn refraction(cosine: f64, from: f64, into: f64) -> Option<Refraction> {
    let ratio = from / into;
    let squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    if squared <= 0.0 {
        return None;
    }
    let beyond = squared.sqrt();
    let (parallel, perpendicular) = (
        (into * cosine - from * beyond) / (into * cosine + from * beyond),
        (from * cosine - into * beyond) / (from * cosine + into * beyond),
    );
    Some(Refraction { reflectance: 0.5 * (parallel * parallel + perpendicular * perpendicular), cosine: beyond })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of diffuse light that is reflected.
    fn diffuse(from: f64, into: f64) -> f64 {
        const STEPS: usize = 100_000;
        let share = |i: usize| {
            let mu = (i as f64 + 0.5) / STEPS as f64;
            2.0 * mu * refraction(mu, from, into).map_or(1.0, |found| found.reflectance)
        };
        (0..STEPS).map(share).sum::<f64>() / STEPS as f64
    }

    /// The closed form of Walsh 1926 for light from outside; what is reflected inside follows, for étendue times
    /// transmittance is the same both ways. n = 1.5 reflects 0.0918 of diffuse light from outside and 0.5963 from
    /// inside.
    #[test]
    fn diffuse_reflectance_is_that_of_walsh() {
        for n in [1.33_f64, 1.5, 1.8] {
            let (n2, n4) = (n * n, n.powi(4));
            let outside = 0.5
                + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
                + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
                - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
                + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
            let inside = 1.0 - (1.0 - outside) / n2;
            for (from, into, expected) in [(1.0, n, outside), (n, 1.0, inside)] {
                let found = diffuse(from, into);
                assert!((found - expected).abs() < 1e-6, "{from} to {into}: {found} instead of {expected}");
            }
        }
        assert!((diffuse(1.0, 1.5) - 0.0918).abs() < 5e-5 && (diffuse(1.5, 1.0) - 0.5963).abs() < 5e-5);
    }

    #[test]
    fn both_ways_are_one() {
        for cosine in [1.0, 0.8, 0.3, 1e-3] {
            let down = refraction(cosine, 1.0, 1.5).unwrap();
            let up = refraction(down.cosine, 1.5, 1.0).unwrap();
            assert!((up.cosine - cosine).abs() < 1e-12 && (up.reflectance - down.reflectance).abs() < 1e-12);
        }
    }

    #[test]
    fn brewsters_angle_and_the_vertical() {
        let vertical = refraction(1.0, 1.0, 1.5).unwrap();
        assert!((vertical.reflectance - 0.04).abs() < 1e-15 && vertical.cosine == 1.0);
        // At tanθ = n nothing polarised in the plane comes back; the rest is ((n² − 1)/(n² + 1))² of its half.
        let brewster = refraction(1.0 / 3.25_f64.sqrt(), 1.0, 1.5).unwrap();
        assert!((brewster.reflectance - 0.5 * (1.25 / 3.25_f64).powi(2)).abs() < 1e-15);
    }
}
