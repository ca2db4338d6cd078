//! From photographs to a material file: Hašan et al. 2010, section 4.
//!
//! **In:** a [`Capture`]: which pictures show what. **Out:** a [`Measurement`]: R(r) and T(r) with errors, scaled to
//! their albedos, and a [`Finding`] for everything noticed and corrected on the way; as text, a material file.
//!
//! ```text
//!   CAPTURE.toml ─► capture     known keys, headers of all pictures
//!                     │
//!                   bracket     survey: labels, shifts, noise ─► merge: radiance and its variance per pixel, minus the dark
//!                     │
//!                   centre      highest radial symmetry; tilt and gradient by harmonics of the rings
//!                   outliers    hot pixels, dust
//!                   rings       means over rings, standard errors
//!                   background  level beyond the signal; tail out of the noise
//!                   aperture    the projector's pixel and the camera's, deconvolved near the centre
//!                     │
//!                   albedo      grey card, screen ─► scale
//!                     └─► material   TOML and CSV
//! ```
//!
//! Without a projector, a printed [`Coupon`] and two photographs tell the coefficients of all resins of a set
//! (`coupon`), and [`Totals`] of sheets in an integrating sphere become coefficients (`totals`).
//!
//! Radiance is in DN/s of the camera until the last step; only its shape counts. Pictures are read one at a time.

mod albedo;
mod aperture;
mod background;
mod bracket;
mod capture;
mod centre;
mod chance;
mod coupon;
#[cfg(test)]
mod dice;
mod error;
mod evenness;
mod figures;
mod finding;
mod frame;
mod material;
mod outliers;
mod report;
mod rings;
mod scan;
pub mod simulate;
mod totals;

pub use albedo::{CARD_ERROR, MeasuredAlbedo};
pub use capture::{Albedo, Aperture, Camera, Capture, Exposure, Rect, ResinFacts, Series};
pub use coupon::{Coupon, CouponFit, CouponResin, NamedResin, Photographs, Reading, fit_coupon};
pub use error::MeasureError;
pub use figures::plus_minus;
pub use finding::Finding;
pub use frame::{ColourPlane, Plane};
pub use material::{ChannelMeasurement, Measurement, SeriesMeasurement, measure};
pub use scan::{Preview, ScannedProfile, SeenTilt};
pub use totals::{Instrument, Sheet, SheetResin, Totals, TotalsFit, fit_totals};
