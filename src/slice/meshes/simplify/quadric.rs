//! Quadrics: the sum of squared distances to planes. Garland and Heckbert 1997, *Surface simplification using quadric
//! error metrics*.

use glam::{DMat3, DVec3};

/// Weight that draws the best point to a given one along directions that no plane decides. A vertex of a corner joined
/// with one 10 mm away along its edge moves by 50 nm.
const DRAW: f64 = 1e-5;

/// The quadric Q(x) = xᵀ A x + 2 b·x + c of planes that are weighted by area, about an origin of the caller's.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quadric {
    /// xx, yy, zz, xy, xz, yz of A.
    a: [f64; 6],
    b: DVec3,
    c: f64,
    /// Sum of the weights, mm².
    pub weight: f64,
}

impl Quadric {
    /// The plane through `point` with unit normal `n`.
    pub fn plane(n: DVec3, point: DVec3, weight: f64) -> Self {
        let d = -n.dot(point);
        Self {
            a: [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z].map(|value| weight * value),
            b: weight * d * n,
            c: weight * d * d,
            weight,
        }
    }

    /// The planes of both.
    pub fn add(&mut self, other: &Self) {
        for (mine, its) in self.a.iter_mut().zip(other.a) {
            *mine += its;
        }
        self.b += other.b;
        self.c += other.c;
        self.weight += other.weight;
    }

    fn matrix(&self) -> DMat3 {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz))
    }

    /// Weighted sum of squared distances of `x`, mm⁴.
    pub fn at(&self, x: DVec3) -> f64 {
        (x.dot(self.matrix() * x) + 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// The point where it is least; of several the one nearest to `middle`.
    pub fn best(&self, middle: DVec3) -> DVec3 {
        let drawn = self.matrix() + DMat3::from_diagonal(DVec3::splat(DRAW * self.weight));
        middle - drawn.inverse() * (self.matrix() * middle + self.b)
    }
}
