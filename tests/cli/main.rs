//! The command line as a script sees it: exit codes, stdout against stderr, files. Needs nothing but the program.
//!
//! | code | means |
//! | --- | --- |
//! | 0 | done |
//! | 1 | done, but the answer is no |
//! | 2 | bad usage, job or input |
//! | 3 | I/O failed while writing |
//! | 130 | interrupted |

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod cache;
mod compare;
mod containers;
mod docs;
mod events;
mod events_pipes;
mod factor;
mod fractions;
mod gamut;
mod interrupt;
#[path = "../common/json_schema.rs"]
mod json_schema;
mod look;
mod matching;
mod material;
mod measure;
mod predict;
mod printable;
#[path = "../common/shapes.rs"]
mod shapes;
mod slice_bad;
mod slice_bssrdf;
mod slice_bytes;
mod slice_colour;
mod slice_folder;
mod slice_mixtures;
mod slice_refined;
mod slice_resume;
mod slice_rounds;
mod slice_says;
mod slice_union;
mod start;
mod support;
mod usage;
mod verify;
