//! Laws of the mesh room: files round-trip, bad files are refused in words, closed meshes have integer winding numbers.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod bad_input;
mod closing;
mod formats;
mod placing;
mod shapes;
mod shared;
mod winding;
mod writers;
