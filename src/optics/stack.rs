//! Layers over a core: what is searched for, predicted, printed and reported.
//!
//! One shape for all of them, by what stands for a resin: its [`ResinId`] where a set is at hand, its name in files and reports, its
//! coefficients in the models.

use serde::{Deserialize, Serialize};

use super::ResinId;

/// One homogeneous layer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Layer<R = ResinId> {
    /// What it is made of.
    pub resin: R,
    /// How thick it is, mm.
    pub thickness_mm: f64,
}

/// Layers from the observer down, and what lies below them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stack<R = ResinId> {
    /// Top layer first.
    pub layers: Vec<Layer<R>>,
    /// The resin of the half-space below; `None`: nothing lies there and no light returns.
    pub core: Option<R>,
}

impl<R> Default for Stack<R> {
    /// No layers over nothing.
    fn default() -> Self {
        Self { layers: Vec::new(), core: None }
    }
}

impl<R> Layer<R> {
    /// A layer of `resin`, `thickness_mm` thick.
    pub fn new(resin: R, thickness_mm: f64) -> Self {
        Self { resin, thickness_mm }
    }
}

impl<R> Stack<R> {
    /// These layers as they stand, over nothing: (resin, mm) from the observer down.
    pub fn new(layers: impl IntoIterator<Item = (R, f64)>) -> Self {
        let layer = |(resin, thickness_mm)| Layer { resin, thickness_mm };
        Self { layers: layers.into_iter().map(layer).collect(), core: None }
    }

    /// The same layers over a half-space of `core`, or over nothing.
    #[must_use]
    pub fn over(self, core: impl Into<Option<R>>) -> Self {
        Self { core: core.into(), ..self }
    }

    /// The same layers of what `resin` makes of their resins, and the same core.
    pub fn map<'a, S>(&'a self, resin: impl Fn(&'a R) -> S) -> Stack<S> {
        let layer = |layer: &'a Layer<R>| Layer { resin: resin(&layer.resin), thickness_mm: layer.thickness_mm };
        Stack { layers: self.layers.iter().map(layer).collect(), core: self.core.as_ref().map(&resin) }
    }

    /// [`Self::map`] by what may fail: layers first, from the top, then the core.
    ///
    /// # Errors
    /// The first error of `resin`.
    pub fn try_map<'a, S, E>(&'a self, resin: impl Fn(&'a R) -> Result<S, E>) -> Result<Stack<S>, E> {
        let layer = |layer: &'a Layer<R>| Ok(Layer { resin: resin(&layer.resin)?, thickness_mm: layer.thickness_mm });
        let layers = self.layers.iter().map(layer).collect::<Result<_, E>>()?;
        Ok(Stack { layers, core: self.core.as_ref().map(&resin).transpose()? })
    }

    /// Sum of the layers, mm.
    pub fn thickness_mm(&self) -> f64 {
        self.layers.iter().map(|layer| layer.thickness_mm).sum()
    }

    /// (resin, mm) of the layers, from the observer down.
    pub fn pairs(&self) -> impl DoubleEndedIterator<Item = (&R, f64)> + Clone {
        self.layers.iter().map(|layer| (&layer.resin, layer.thickness_mm))
    }
}

impl<R: PartialEq> Stack<R> {
    /// Joins neighbours of one resin and drops layers of thickness 0; (resin, mm) from the observer down, over nothing.
    pub fn joined(layers: impl IntoIterator<Item = (R, f64)>) -> Self {
        let mut joined: Vec<Layer<R>> = Vec::new();
        for (resin, thickness_mm) in layers {
            match joined.last_mut() {
                _ if thickness_mm == 0.0 => {}
                Some(last) if last.resin == resin => last.thickness_mm += thickness_mm,
                _ => joined.push(Layer { resin, thickness_mm }),
            }
        }
        Self { layers: joined, core: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_one_resin_are_one_layer() {
        let stack = Stack::joined([("a", 1.0), ("a", 0.5), ("b", 0.0), ("a", 0.5), ("b", 2.0)]).over("c");
        assert_eq!(stack, Stack::new([("a", 2.0), ("b", 2.0)]).over("c"));
        assert_eq!(stack.thickness_mm(), 4.0);
    }

    #[test]
    fn the_first_resin_that_fails_is_the_answer() {
        let stack = Stack::new([(1, 1.0), (2, 0.5)]).over(3);
        let below = |limit: i32| move |resin: &i32| if *resin < limit { Ok(10 * resin) } else { Err(*resin) };
        assert_eq!(stack.try_map(below(4)), Ok(Stack::new([(10, 1.0), (20, 0.5)]).over(30)));
        assert_eq!(stack.try_map(below(2)), Err(2));
        assert_eq!(stack.try_map(below(3)), Err(3));
    }
}
