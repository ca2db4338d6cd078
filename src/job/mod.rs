//! Jobs: what to print, on which printer, from which resins, to look like what; and doing it.
//!
//! | room | request | record |
//! | --- | --- | --- |
//! | `file`    | a job file, TOML | a [`Job`], checked, with every default filled in |
//! | `plan`    | a [`Job`] | a [`Prepared`] job: resins, targets, stackings, fields on a lattice |
//! | `run`     | a [`Prepared`] job | the output folder and its [`Manifest`] |
//! | [`verify`](mod@verify) | a finished folder | what is not as its manifest has it |
//! | `factor`  | a measured BSSRDF | a folder of profiles and clusters to print from |
//! | `compare` | factored data and finished jobs | what each step to the print costs in appearance |

mod compare;
mod factor;
mod file;
mod manifest;
mod plan;
mod run;
mod run_error;
pub mod verify;

pub use compare::{CompareError, CompareRequest, Comparison, Difference, JobFit, Spread, Stage, compare, compare_into};
pub use factor::{
    ChannelFit, ClusterRecord, FACTORED, FACTORED_VERSION, FactorError, FactorRequest, FactorSettings, Factored,
    LABELS, PROFILES, RingResidual, RoundRecord, Simpler, TailRecord, factor_into,
};
pub use file::{
    AlbedoSource, ClusterOptions, DepthFrom, Distance, FieldOptions, InputPath, Job, JobError, MAX_JOB_BYTES,
    MaterialSource, NamedLimit, ObjectJob, OutputFormat, OutputOptions, Overlap, Place, ResolvedJob, SUPPORT,
    SUPPORT_MIN_DEPTH_MM, Scaling, StackingModel, StackingOptions, TargetSpec, Unit,
};
pub use manifest::{
    LatticeRecord, MANIFEST_VERSION, Manifest, MaterialRecord, MaterialSetRecord, MeshRecord, ObjectRecord, STACKINGS,
};
pub use plan::{
    GamutMapEntry, InputFile, JobTarget, Prepared, PreparedObject, SearchEntry, StackingEntry, StackingReport,
    TransportEntry, targets,
};
pub use run::{Estimate, Finished, REPORT, RedrawError, RunOptions, draw_again, redraw, report_data, run};
pub use run_error::RunError;
