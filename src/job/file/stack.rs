//! Layers in one line of text: `white:0.5,support:1.0,black:0.5`, from the observer down. What lies below them has a key of its own.

use std::{fmt, str::FromStr};

use super::ranges::LAYER;
use crate::{
    optics::{Layer, Stack},
    words::excerpt,
};

/// What is wrong with a stack's text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StackError {
    /// There is no layer in it.
    #[error("found an empty stack, expected layers like white:0.5,support:1.0 (name:thickness in mm, top first)")]
    Empty,
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

/// Layers of `name:thickness-in-mm`, separated by commas, top first, over nothing. Blanks around names and numbers are allowed;
/// a name may hold colons, the last one counts. Thicknesses are 0.0001 to 2000 mm. Whether the resins exist is
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
        let layer = |(index, element): (usize, &str)| {
            let error =
                |expected: String| StackError::Layer { position: index + 1, found: excerpt(element.trim()), expected };
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
        fn text_survives_the_round_trip(layers in prop::collection::vec(("[a-zA-Z][a-z :0-9]{0,8}[a-z]", 1e-4..2000.0f64), 1..8)) {
            let stack = Stack::<String>::new(layers);
            prop_assert_eq!(stack.to_string().parse(), Ok(stack));
        }

        #[test]
        fn no_text_panics(text in ".*") {
            let _ = text.parse::<Stack<String>>();
        }
    }
}
