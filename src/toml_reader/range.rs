//! What a number may be.

use std::fmt;

/// A closed range of finite numbers, and what they are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Range {
    pub noun: &'static str,
    pub min: f64,
    pub max: f64,
}

impl Range {
    pub const fn new(noun: &'static str, min: f64, max: f64) -> Self {
        Self { noun, min, max }
    }

    /// False for NaN and infinities too.
    pub fn contains(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} from {} to {}", self.noun, self.min, self.max)
    }
}

/// A closed range of whole numbers, and what they are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct IntRange {
    pub noun: &'static str,
    pub min: u64,
    pub max: u64,
}

impl fmt::Display for IntRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} from {} to {}", self.noun, self.min, self.max)
    }
}
