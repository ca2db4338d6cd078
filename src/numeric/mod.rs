//! Numerical methods that several rooms share.
//!
//! | file | what it does |
//! | --- | --- |
//! | `quadrature` | Gauss–Legendre rules |
//! | `least_squares` | Levenberg and Marquardt's method |

pub(crate) mod least_squares;
pub(crate) mod quadrature;
