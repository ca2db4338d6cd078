//! Laws of the factorisation.

mod exact;
mod input;
mod laws;
mod patch;
