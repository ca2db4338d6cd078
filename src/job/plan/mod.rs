//! From a job to objects on a lattice: everything that is done before the first slice.
//!
//! **In:** a [`Job`](super::Job). **Out:** a [`Prepared`] job.
//!
//! | file | what it does |
//! | --- | --- |
//! | `placed`, `solids` | read the inputs, place the meshes on the tray |
//! | `prepare`  | builds the fields |
//! | `asked`, `appearance`, `images`, `factored` | what each surface point should reflect: targets, and where each is wanted |
//! | `stackings`, `gamut_mapping`  | one stacking per target |
//! | `on_surface`, `lattice`, `answers` | other stackings where an object is thin, or its print would miss |
//! | `stacking_report` | what was found, as files and reports have it |
//! | `arrange` | places on the tray |
//! | `checks`   | what will print badly |

mod answers;
mod appearance;
mod arrange;
mod asked;
mod checks;
mod context;
mod factored;
mod gamut_mapping;
mod image_checks;
mod images;
mod job_targets;
mod lattice;
mod layer_maps;
mod object;
mod on_surface;
mod placed;
mod prepare;
mod solids;
mod stacking_report;
mod stackings;

pub(super) use appearance::TEXEL_BYTES;
pub use asked::{Asked, AskedMap};
pub(super) use factored::FactoredMap;
pub(super) use images::read_picture;
pub use job_targets::{JobTarget, targets};
pub(super) use lattice::CHANNELS;
pub(super) use layer_maps::LayerMaps;
pub use object::PreparedObject;
pub use on_surface::VariantEntry;
pub(super) use on_surface::{HALF_THICKNESSES_MM, ObjectPlan};
pub use prepare::{InputFile, Prepared};
pub use stacking_report::{GamutMapEntry, SearchEntry, StackingEntry, StackingReport, TransportEntry};
