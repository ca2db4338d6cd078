//! The rings in which exits are counted.

#[cfg(test)]
use crate::optics::OpticsError;

/// Edges of concentric rings in mm, ascending, the first 0.
#[derive(Debug, Clone, PartialEq)]
pub struct RingEdges(Vec<f64>);

impl RingEdges {
    /// Rings between these edges.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] unless there are at least two, finite, ascending, starting at 0.
    #[cfg(test)]
    pub fn new(edges_mm: Vec<f64>) -> Result<Self, OpticsError> {
        let ascending = edges_mm.windows(2).all(|pair| pair[0] < pair[1]);
        if edges_mm.len() >= 2 && edges_mm[0] == 0.0 && ascending && edges_mm.iter().all(|edge| edge.is_finite()) {
            Ok(Self(edges_mm))
        } else {
            Err(OpticsError::parameter("ring edges", edges_mm.len(), "ascending radii in mm, the first 0".into()))
        }
    }

    /// 500 rings to 80 mm: 10 µm wide to 2 mm, 50 µm to 10 mm, 0.5 mm beyond; those of the reference data.
    #[cfg(test)]
    pub fn fine() -> Self {
        let step = |from: f64, width: f64, count: usize| (0..count).map(move |i| from + i as f64 * width);
        Self(step(0.0, 0.01, 200).chain(step(2.0, 0.05, 160)).chain(step(10.0, 0.5, 141)).collect())
    }

    /// About 200 rings to 80 mm, 10 µm wide to 0.4 mm and growing with r beyond: those of the built-in profiles. They
    /// give the Hankel coefficients of closed-form pairs up to 20 rad/mm as well as [`RingEdges::fine`] does, within
    /// 1e-5 (a test holds this).
    pub fn growing() -> Self {
        const GROWTH: f64 = 1.035;
        const LAST_MM: f64 = 80.0;
        let mut edges: Vec<f64> = (0..=40).map(|i| f64::from(i) * 0.01).collect();
        let mut edge = 0.4;
        while edge * GROWTH < LAST_MM {
            edge *= GROWTH;
            edges.push((edge * 1e4).round() / 1e4); // whole tenths of a micrometre, to print briefly
        }
        edges.push(LAST_MM);
        Self(edges)
    }

    /// The edges, one more than rings.
    pub fn as_slice(&self) -> &[f64] {
        &self.0
    }
}
