//! Why there is no comparison.

use std::path::PathBuf;

use thiserror::Error;

use crate::{
    appearance::bssrdf::BssrdfError,
    blame::{Blame, Blamed, Remedy},
    job::{RunError, finished::VerifyError, look::LookError},
    optics::OpticsError,
    output::OutputError,
    plot::PlotError,
};

/// Why there is no comparison.
#[derive(Debug, Error)]
pub enum CompareError {
    /// A job's folder.
    #[error("{}: found {found}, expected {expected}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// A slice.
    #[error("{}: found {found}, expected a slice of the job", path.display())]
    Slice {
        /// The slice.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// Profiles of texels.
    #[error("{}: found {found}, expected what factored.json says of it", path.display())]
    Profiles {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// A resin whose photons cannot be traced.
    #[error(
        "material set {set}: resin {resin}: found no coefficients, expected scattering-per-mm and absorption-per-mm \
            to trace photons by"
    )]
    NoCoefficients {
        /// The set.
        set: String,
        /// The resin.
        resin: String,
    },
    /// The dataset is of another patch than the map.
    #[error("{}: found {found}, expected the dataset that the map was factored from", path.display())]
    OtherPatch {
        /// The dataset.
        path: PathBuf,
        /// Its size.
        found: String,
    },
    /// A job's folder without a manifest.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// The map.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The resins.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The dataset.
    #[error(transparent)]
    Dataset(#[from] BssrdfError),
    /// Light through an object.
    #[error(transparent)]
    Look(#[from] LookError),
    /// The output folder.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A picture.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

impl Blamed for CompareError {
    fn blame(&self) -> Blame {
        match self {
            Self::Verify(error) => error.blame(),
            Self::Run(error) => error.blame(),
            Self::Look(error) => error.blame(),
            Self::Optics(error) => error.blame(),
            Self::Dataset(error) => error.blame(),
            Self::Output(error) => error.blame(),
            Self::Plot(error) => error.blame(),
            Self::Folder { .. }
            | Self::Slice { .. }
            | Self::Profiles { .. }
            | Self::NoCoefficients { .. }
            | Self::OtherPatch { .. } => Blame::Input,
        }
    }

    fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Output(error) => error.remedy(),
            Self::Run(error) => error.remedy(),
            Self::Look(error) => error.remedy(),
            _ => None,
        }
    }
}
