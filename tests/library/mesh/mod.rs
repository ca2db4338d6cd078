//! Laws of the mesh room: files round-trip, bad files are refused in words, closed meshes have integer winding numbers.

mod bad_input;
mod cases;
mod closing;
mod colours;
mod encodings;
mod formats;
mod fuzz;
mod joints;
mod painted;
mod placing;
mod printed;
mod shapes;
mod shared;
mod union;
mod winding;
mod writers;
