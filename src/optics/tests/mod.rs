//! Laws of the optics room.

mod hankel;
mod monte_carlo;
mod profile_csv;
mod reference;
