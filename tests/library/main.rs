//! The library through its doors, room by room.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)] // helpers of tests

#[path = "../common/mod.rs"]
mod common;

mod faces_alike;
mod job;
#[path = "../common/json_schema.rs"]
mod json_schema;
#[cfg(feature = "measure")]
mod measure;
mod mesh;
mod preview;
mod refined_by_photons;
