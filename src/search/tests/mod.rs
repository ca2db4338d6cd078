//! Laws of the search: it finds what brute force and the paper's algorithm find, and keeps the limits.

mod laws;
mod optimum;
pub(crate) mod resins;
