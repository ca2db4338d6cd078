//! Numerical methods that several rooms share.
//!
//! | file | what it does |
//! | --- | --- |
//! | `complex` | functions of complex numbers, the same bits everywhere |
//! | `quadrature` | Gauss–Legendre rules |
//! | `least_squares` | Levenberg and Marquardt's method |
//! | `positive_definite` | small systems of normal equations |
//! | `similarity` | what a medium shows in depth, and what its particles do |
//! | `rounding` | what a search found, without the digits that depend on the processor |

pub(crate) mod complex;
pub(crate) mod least_squares;
pub(crate) mod positive_definite;
pub(crate) mod quadrature;
pub(crate) mod rounding;
pub(crate) mod similarity;
