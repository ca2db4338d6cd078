//! Laws of the mesh room: files round-trip, bad files are refused in words, closed meshes have integer winding numbers.

mod bad_input;
mod closing;
mod formats;
mod fuzz;
mod placing;
mod shapes;
mod shared;
mod winding;
mod writers;
