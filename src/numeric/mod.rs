//! Numerical methods that several rooms share.
//!
//! | file | what it does |
//! | --- | --- |
//! | `quadrature` | Gauss–Legendre rules |

pub(crate) mod quadrature;
