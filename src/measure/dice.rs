//! Noise for tests, the same everywhere.

/// Numbers from −1 to 1 with a variance of 1/3.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A value with so much noise, one standard deviation as a share of it.
    pub fn noisy(&mut self, value: f64, noise: f64) -> f64 {
        value * (1.0 + noise * 3f64.sqrt() * self.roll())
    }
}
