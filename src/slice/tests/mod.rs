//! Laws of the slicer that do not depend on files.

mod distance;
