//! A queue by cost: what costs alike, within a factor of √2, comes in the order in which it was put in.
//!
//! A heap keeps an exact order for the price of a walk through memory at every step; collapses do not need it.

use std::collections::VecDeque;

/// Classes of a factor of 2.
const PER_OCTAVE: u32 = 2;
/// Costs from 2^LEAST on are told apart, up to 2^GREATEST.
const LEAST: i32 = -110;
const GREATEST: i32 = 20;

/// Values, the least costly first.
#[derive(Debug)]
pub struct Queue<T> {
    classes: Vec<VecDeque<T>>,
    /// No class below has a value.
    lowest: usize,
}

impl<T> Default for Queue<T> {
    fn default() -> Self {
        let classes = (GREATEST - LEAST) as usize * PER_OCTAVE as usize + 1;
        Self { classes: std::iter::repeat_with(VecDeque::new).take(classes).collect(), lowest: 0 }
    }
}

impl<T> Queue<T> {
    /// Puts in a value of a cost that is not negative.
    pub fn push(&mut self, cost: f64, value: T) {
        // The bits of a double are its exponent, then its fraction: together nearly its logarithm.
        let class = (cost.to_bits() >> (53 - PER_OCTAVE)) as i64;
        let least = i64::from(1023 + LEAST) * i64::from(PER_OCTAVE);
        let class = (class - least).clamp(0, self.classes.len() as i64 - 1) as usize;
        self.classes[class].push_back(value);
        self.lowest = self.lowest.min(class);
    }

    /// Takes out a value of the least costly class.
    pub fn pop(&mut self) -> Option<T> {
        while self.lowest < self.classes.len() {
            if let Some(value) = self.classes[self.lowest].pop_front() {
                return Some(value);
            }
            self.lowest += 1;
        }
        None
    }
}
