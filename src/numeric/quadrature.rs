//! Gauss–Legendre rules: nodes and weights that integrate polynomials of degree 2n − 1 exactly.
//!
//! Rules that inner loops use are tables; their digits stay as they are, for results rest on them to the last bit. The
//! routine makes a rule of any number of nodes; its last bits differ from the tables'.

use std::f64::consts::PI;

/// Abscissae and weights of three nodes on [−1, 1].
pub(crate) const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// Abscissae and weights of four nodes on [−1, 1].
pub(crate) const GAUSS_4: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Abscissae and weights of eight nodes on [0, 1].
pub(crate) const GAUSS_8_OF_UNIT: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

/// A rule on [−1, 1] as one on [0, 1].
pub(crate) fn of_unit<const N: usize>(rule: [(f64, f64); N]) -> [(f64, f64); N] {
    rule.map(|(x, weight)| (0.5 * (x + 1.0), 0.5 * weight))
}

/// Nodes and weights of any number on (0, 1): roots of the Legendre polynomial by Newton's method.
pub(crate) fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let node = |i: usize| {
        let mut x = -libm::cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
        let mut slope = 1.0;
        for _ in 0..16 {
            let (mut before, mut here) = (1.0, x);
            for l in 2..=n {
                let l = l as f64;
                (before, here) = (here, ((2.0 * l - 1.0) * x * here - (l - 1.0) * before) / l);
            }
            slope = n as f64 * (x * here - before) / (x * x - 1.0);
            x -= here / slope;
        }
        (0.5 * (x + 1.0), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫₀¹ xᵈ dx = 1 / (d + 1).
    fn integrates_exactly(rule: &[(f64, f64)]) {
        let n = rule.len();
        for degree in 0..2 * n as i32 {
            let sum: f64 = rule.iter().map(|(x, weight)| weight * x.powi(degree)).sum();
            assert!((sum - 1.0 / f64::from(degree + 1)).abs() < 1e-14, "n {n}, degree {degree}: {sum}");
        }
    }

    #[test]
    fn polynomials_are_integrated_exactly() {
        integrates_exactly(&of_unit(GAUSS_3));
        integrates_exactly(&of_unit(GAUSS_4));
        integrates_exactly(&GAUSS_8_OF_UNIT);
        for n in 1..=32 {
            let (x, weight) = gauss_legendre(n);
            integrates_exactly(&x.into_iter().zip(weight).collect::<Vec<_>>());
        }
    }

    #[test]
    fn tables_and_routine_agree() {
        let apart = |rule: &[(f64, f64)]| {
            let (x, weight) = gauss_legendre(rule.len());
            let made = x.iter().zip(&weight);
            rule.iter().zip(made).map(|(a, (x, w))| (a.0 - x).abs().max((a.1 - w).abs())).fold(0.0, f64::max)
        };
        let tables: [&[(f64, f64)]; 3] = [&of_unit(GAUSS_3), &of_unit(GAUSS_4), &GAUSS_8_OF_UNIT];
        assert!(tables.into_iter().all(|rule| apart(rule) < 1e-15));
    }
}
