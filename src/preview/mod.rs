//! Pictures of a sliced job, and the page that shows them.
//!
//! **In:** every slab of a job as it is streamed ([`PreviewBuilder`]), or the slices of a finished folder
//! ([`from_folder`]). **Out:** PNG files, and with [`report_html`] a page to read and print.
//!
//! | picture | what it shows |
//! | --- | --- |
//! | `preview/slices.png`  | twelve slices over the height |
//! | `preview/cuts.png`    | three orthogonal cuts through one point |
//! | `preview/cutaway.png` | the object with a quarter taken out, shaded |
//! | `preview/slice_K.png` | a few slices, large |
//! | `preview/checks.png` | the objects from three sides, marked where they will not print well |
//! | `preview/tray.png` | the tray from above, where objects are arranged on it |
//! | `preview/film.png` | many slices, small, for the page to leaf through |
//!
//! Memory is bounded whatever the job: a [`volume`] of at most 12 M cells (24 MB), and at most 18 [`section`]s of at
//! most 4 MB. Everything is sampled at positions that the lattice alone decides, so the pictures do not depend on
//! threads or slabs.

mod canvas;
mod collect;
mod cutaway;
mod cuts;
mod enclosed;
mod film;
mod folder;
mod legend;
mod light;
mod look;
mod march;
mod marked;
mod report;
mod sampling;
mod section;
mod sheet;
mod style;
#[cfg(test)]
mod tests;
mod text;
mod volume;
mod whereabouts;

use std::path::PathBuf;

use thiserror::Error;

pub use collect::PreviewBuilder;
pub use film::{FILM_STRIP, FilmStrip};
pub use folder::from_folder;
pub(crate) use folder::{SliceColours, decode_slice, read_slice};
pub(crate) use look::{LookPanel, Scale, look_panels, look_sheet};
pub(crate) use marked::{marked_sheet, tray_sheet};
pub use report::{ReportData, ReportFilm, ReportHealth, ReportMaterial, ReportPicture, ReportStacking, report_html};
pub use whereabouts::ReportLabel;

use crate::{
    blame::{Blame, Blamed},
    voxel::{MaterialId, Slab},
    watch::Stopped,
};

/// How a material looks in pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PreviewMaterial {
    /// Its id in the slabs.
    pub id: MaterialId,
    /// Its name in the legend.
    pub name: String,
    /// sRGB colour and alpha. Alpha 0 marks what is printed as background, the support: it is drawn hatched.
    pub rgba: [u8; 4],
}

impl PreviewMaterial {
    /// Whether the printer fills it in by itself.
    fn is_void(&self) -> bool {
        self.rgba[3] == 0
    }
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PreviewFile {
    /// Path relative to the output folder, with forward slashes.
    pub path: String,
    /// The file's content.
    pub png: Vec<u8>,
}

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PreviewError {
    /// A slice cannot be read.
    #[error("{}: reading failed: {source}", path.display())]
    Read {
        /// The slice.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A slice is not a PNG file, or a damaged one.
    #[error("{}: found a file that cannot be decoded ({reason}), expected a PNG slice", path.display())]
    Decode {
        /// The slice.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A slice is not as large as the lattice.
    #[error(
        "{}: found {} × {} pixels, expected the lattice's {} × \
            {}", path.display(), found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// The slice.
        path: PathBuf,
        /// Its width and height.
        found: [u32; 2],
        /// The lattice's.
        expected: [u32; 2],
    },
    /// A slice holds something that is no material's colour.
    #[error(
        "{}: found the colour {found:?} in column {column} of row {row}, expected the RGBA of one of the \
            materials", path.display()
    )]
    Colour {
        /// The slice.
        path: PathBuf,
        /// The first such pixel, from the left.
        column: usize,
        /// The first such pixel, from the top.
        row: usize,
        /// Its RGBA.
        found: [u8; 4],
    },
    /// A picture cannot be encoded.
    #[error("{path}: encoding a picture failed: {reason}")]
    Encode {
        /// The picture.
        path: String,
        /// Why.
        reason: String,
    },
    /// The watch asked for the end.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl Blamed for PreviewError {
    fn blame(&self) -> Blame {
        if let Self::Stopped(stopped) = self { stopped.blame() } else { Blame::Input }
    }
}

/// Material ids of some slices, wherever they come from.
trait Voxels: Sync {
    /// Copies row (j, k), which is `dims[0]` long.
    fn row(&self, j: u32, k: u32, row: &mut [u8]);
    /// One voxel.
    fn voxel(&self, index: [u32; 3]) -> u8;
}

impl Voxels for Slab {
    fn row(&self, j: u32, k: u32, row: &mut [u8]) {
        self.read_row(j, k, row);
    }

    fn voxel(&self, index: [u32; 3]) -> u8 {
        Slab::voxel(self, index).0
    }
}

/// Which voxels of an axis stand for `n` equal parts of it: the one around the middle of each part.
fn middles(n: usize, dim: u32) -> impl DoubleEndedIterator<Item = u32> + ExactSizeIterator {
    let last = dim.saturating_sub(1);
    (0..n).map(move |part| (((part as f64 + 0.5) / n as f64 * f64::from(dim)) as u32).min(last))
}
