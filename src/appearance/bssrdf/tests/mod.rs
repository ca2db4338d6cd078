//! Laws of the factorisation.

mod belief;
mod exact;
mod input;
mod laws;
mod patch;
mod squares;
