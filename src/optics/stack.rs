//! Layers over a core: what is searched for, predicted, printed and reported.
//!
//! One shape for all of them, by what stands for a resin: its [`ResinId`] where a set is at hand, its name in files and
//! reports, its coefficients in the models. In one line of text, layers of names are `white:0.5,support:1.0,black:0.5`,
//! from the observer down; what lies below them stands elsewhere.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::ResinId;
use crate::{toml_reader::Range, words::excerpt};

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

impl<R: Ord> Stack<R> {
    /// The resin that most of the layers are; the first of equals.
    pub fn mostly(&self) -> Option<&R> {
        let total = |resin: &R| self.pairs().filter(|(other, _)| *other == resin).map(|(_, mm)| mm).sum::<f64>();
        let resins = self.layers.iter().map(|layer| &layer.resin);
        resins.max_by(|a, b| total(a).total_cmp(&total(b)).then(b.cmp(a)))
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

/// Layers that a text may name, mm: 0.1 µm, far below the 14 µm a printer can do, to twice the longest tray of any
/// PolyJet machine.
pub(crate) const LAYER: Range = Range::new("a thickness in mm", 1e-4, 2000.0);

/// Most layers of a stack: 14 mm of the thinnest slices.
pub const MAX_LAYERS: usize = 1000;

/// What is wrong with a stack's text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StackError {
    /// There is no layer in it.
    #[error("found an empty stack, expected layers like white:0.5,support:1.0 (name:thickness in mm, top first)")]
    Empty,
    /// There are more layers in it than any printer lays.
    #[error("found {found} layers, expected at most {MAX_LAYERS}")]
    TooMany {
        /// How many.
        found: usize,
    },
    /// One of its elements is not a layer.
    #[error("layer {position} of the stack: found \"{found}\", expected {expected}")]
    Layer {
        /// Which one, from 1 at the top.
        position: usize,
        /// Its text.
        found: String,
        /// What would do.
        expected: String,
    },
}

impl crate::blame::Blamed for StackError {}

/// Layers of `name:thickness-in-mm`, separated by commas, top first, over nothing. Blanks around names and numbers are
/// allowed; a name may hold colons, the last one counts. Thicknesses are 0.0001 to 2000 mm, layers at most
/// [`MAX_LAYERS`]. Whether the resins exist is
/// not checked.
///
/// ```
/// use lumislice::optics::Stack;
///
/// let stack: Stack<String> = "white:0.5, support:1".parse().unwrap();
/// assert_eq!(stack, Stack::new([("white".to_owned(), 0.5), ("support".to_owned(), 1.0)]));
/// assert_eq!(stack.to_string(), "white:0.5,support:1");
/// ```
///
/// # Errors
/// [`StackError`], which names the element.
impl FromStr for Stack<String> {
    type Err = StackError;

    fn from_str(text: &str) -> Result<Self, StackError> {
        if text.trim().is_empty() {
            return Err(StackError::Empty);
        }
        let found = text.split(',').count();
        if found > MAX_LAYERS {
            return Err(StackError::TooMany { found });
        }
        let layer = |(index, element): (usize, &str)| {
            let error =
                |expected: String| StackError::Layer { position: index + 1, found: excerpt(element.trim()), expected };
            if element.contains(';') {
                return Err(error("a comma where `;` stands".to_owned()));
            }
            let (name, thickness) = element
                .rsplit_once(':')
                .map(|(name, thickness)| (name.trim(), thickness.trim()))
                .filter(|(name, _)| !name.is_empty())
                .ok_or_else(|| error("name:thickness, the thickness in mm".to_owned()))?;
            let thickness = thickness.parse().ok().filter(|&mm| LAYER.contains(mm));
            Ok(Layer::new(name.to_owned(), thickness.ok_or_else(|| error(format!("{LAYER} after the name")))?))
        };
        Ok(Self { layers: text.split(',').enumerate().map(layer).collect::<Result<_, _>>()?, core: None })
    }
}

/// The text that reads back to the same layers; it does not tell the core.
impl fmt::Display for Stack<String> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, Layer { resin, thickness_mm }) in self.layers.iter().enumerate() {
            write!(f, "{}{resin}:{thickness_mm}", if index == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn neighbours_of_one_resin_are_one_layer() {
        let stack = Stack::joined([("a", 1.0), ("a", 0.5), ("b", 0.0), ("a", 0.5), ("b", 2.0)]).over("c");
        assert_eq!(stack, Stack::new([("a", 2.0), ("b", 2.0)]).over("c"));
        assert_eq!(stack.thickness_mm(), 4.0);
    }

    #[test]
    fn layers_are_counted_and_separated_by_commas() {
        let layers = |count: usize| vec!["a:0.1"; count].join(",").parse::<Stack<String>>();
        assert_eq!(layers(MAX_LAYERS).unwrap().layers.len(), MAX_LAYERS);
        assert_eq!(layers(MAX_LAYERS + 1), Err(StackError::TooMany { found: MAX_LAYERS + 1 }));
        let error = "a:1; b:2".parse::<Stack<String>>().unwrap_err().to_string();
        assert_eq!(error, "layer 1 of the stack: found \"a:1; b:2\", expected a comma where `;` stands");
    }

    #[test]
    fn the_first_resin_that_fails_is_the_answer() {
        let stack = Stack::new([(1, 1.0), (2, 0.5)]).over(3);
        let below = |limit: i32| move |resin: &i32| if *resin < limit { Ok(10 * resin) } else { Err(*resin) };
        assert_eq!(stack.try_map(below(4)), Ok(Stack::new([(10, 1.0), (20, 0.5)]).over(30)));
        assert_eq!(stack.try_map(below(2)), Err(2));
        assert_eq!(stack.try_map(below(3)), Err(3));
    }

    #[test]
    fn every_error_names_the_element() {
        for (text, message) in [
            ("", "found an empty stack"),
            ("  ", "found an empty stack"),
            ("white", "layer 1 of the stack: found \"white\", expected name:thickness"),
            ("white:0.5,", "layer 2 of the stack: found \"\", expected name:thickness"),
            ("white:0.5,:1", "layer 2 of the stack: found \":1\", expected name:thickness"),
            ("a:1,b:1,c:x", "layer 3 of the stack: found \"c:x\", expected a thickness in mm from 0.0001 to 2000"),
            ("a:0", "layer 1 of the stack: found \"a:0\", expected a thickness"),
            ("a:-1", "layer 1 of the stack: found \"a:-1\", expected a thickness"),
            ("a:nan", "layer 1 of the stack: found \"a:nan\", expected a thickness"),
            ("a:inf", "layer 1 of the stack: found \"a:inf\", expected a thickness"),
            ("a:1mm", "layer 1 of the stack: found \"a:1mm\", expected a thickness"),
        ] {
            let error = text.parse::<Stack<String>>().unwrap_err().to_string();
            assert!(error.contains(message), "{text:?} gave {error:?}");
        }
    }

    proptest! {
        #[test]
        fn text_survives_the_round_trip(
            layers in prop::collection::vec(("[a-zA-Z][a-z :0-9]{0,8}[a-z]", 1e-4..2000.0f64), 1..8),
        ) {
            let stack = Stack::<String>::new(layers);
            prop_assert_eq!(stack.to_string().parse(), Ok(stack));
        }

        #[test]
        fn no_text_panics(text in ".*") {
            let _ = text.parse::<Stack<String>>();
        }
    }
}
