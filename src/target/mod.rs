//! What every surface point should reflect, and the layers that do it.
