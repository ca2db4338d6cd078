//! Jobs: what to print, on which printer, from which resins, to look like what; and doing it.
//!
//! | room | request | record |
//! | --- | --- | --- |
//! | [`manifest`](mod@manifest) | what slicing found | the form of a finished folder |
//! | [`start`](mod@start) | a mesh alone | a job for it, as text |
//! | [`file`](mod@file) | a job file, TOML | a [`Job`], checked, with every default filled in |
//! | `plan`    | a [`Job`] | a [`Prepared`] job: resins, targets, stackings, fields on a lattice |
//! | `rounds`  | a [`Prepared`] job as a draft | the same job, its targets corrected where its print would miss |
//! | [`printable`](mod@printable) | a [`Prepared`] job | what of it will break, fall off or wash away |
//! | `run`     | a [`Prepared`] job | the output folder and its [`Manifest`] |
//! | `verdict` | a [`Manifest`] | what the job comes to, in a few sentences |
//! | [`verify`](mod@verify) | a finished folder | what is not as its manifest has it |
//! | [`factor`]  | a measured BSSRDF | a folder of profiles and clusters to print from |
//! | [`look`](mod@look) | a [`Prepared`] job, or its folder | what is asked for beside what is printed |
//! | [`compare`](mod@compare) | factored data and finished jobs | what each step to the print costs in appearance |

pub mod compare;
pub mod factor;
pub mod file;
mod finished;
pub mod look;
pub mod manifest;
mod plan;
pub mod printable;
mod record;
mod rounds;
mod run;
mod run_error;
pub mod start;
mod verdict;
pub mod verify;

pub use file::{Job, JobError};
pub use manifest::{MAPPING, Manifest, OWNER, REPORT};
pub use plan::{
    Asked, AskedMap, GamutMapEntry, InputFile, JobTarget, Prepared, PreparedObject, SearchEntry, StackingEntry,
    StackingReport, TransportEntry, VariantEntry, targets,
};
pub use record::{Ended, ObjectCorrection, ROUNDS, RoundRecord, Rounds};
pub use run::{
    ConvertError, Converted, Durations, Estimate, Finished, ObjectPlace, RedrawError, RunOptions, convert, redraw,
    refuse_another, run,
};
pub use run_error::RunError;
