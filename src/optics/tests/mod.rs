//! Laws of the optics room.

mod hankel;
mod laws;
mod materials;
mod monte_carlo;
mod profile_csv;
pub(super) mod reference;
mod stacks;
mod surfaces;
