//! Plots: one description, drawn as SVG and as PNG with the same look.
//!
//! **In:** a [`Figure`] of [`Panel`]s with axes, series, and rasters. **Out:** the bytes of a file, the same for the
//! same description. Text is drawn as outlines of a bundled font ([`font`], SIL Open Font License), so a plot needs no
//! fonts of the system and looks the same in every viewer.
//!
//! ```text
//!   Figure ──► layout: axis (ticks), legend, font ──► Drawing ──► svg
//!                                                        └─────► pixels (PNG, two pixels per unit)
//! ```
//!
//! ```
//! use lumislice::plot::{Axis, Figure, Format, Panel, Series};
//!
//! let decay = (1..100).map(|i| 0.1 * f64::from(i)).map(|r| [r, (-r).exp() / r]);
//! let panel = Panel::new(Axis::linear("r [mm]"), Axis::log("R(r) [mm⁻²]")).with(Series::line("white", decay));
//! let svg = Figure::new("Reflection").with(panel).encode(Format::Svg)?;
//! assert!(svg.starts_with(b"<svg"));
//! # Ok::<(), lumislice::plot::PlotError>(())
//! ```

mod axis;
mod colour;
mod drawing;
mod font;
mod label;
mod layout;
mod legend;
mod pixels;
mod series;
mod svg;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::blame::{Blame, Blamed};
pub use axis::{Axis, Scale};
pub use colour::{BLACK, BLUE, GREEN, GREY, INK, ORANGE, PINK, RED, Rgb, SERIES, SKY, VERMILION, viridis};
pub(crate) use label::Label;
pub use series::{ColourBar, Mark, Note, Raster, Series, Shape};

/// A file format, by the file's extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Scalable vector graphics.
    Svg,
    /// Pixels, 8-bit RGB, two for each of the figure's units.
    Png,
}

/// Why there is no plot.
#[derive(Debug, Error)]
pub enum PlotError {
    /// A file name that tells no format.
    #[error("{}: found {found}, expected a file name that ends in .svg or .png", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
        /// Its extension.
        found: String,
    },
    /// More pixels than a picture may have.
    #[error(
        "plot: found {width} × {height} pixels, expected at most {limit} a side; use fewer or smaller panels, or .svg"
    )]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Most of either.
        limit: u32,
    },
    /// A picture that cannot be encoded.
    #[error("plot: encoding failed: {0}")]
    Encode(#[from] png::EncodingError),
    /// The disk.
    #[error("{}: writing failed: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Blamed for PlotError {
    fn blame(&self) -> Blame {
        if matches!(self, Self::Write { .. }) { Blame::Disk } else { Blame::Input }
    }
}

impl Format {
    /// The format that `path` asks for by its extension, in whatever case.
    ///
    /// # Errors
    /// [`PlotError::Extension`] for another or none.
    pub fn of(path: &Path) -> Result<Self, PlotError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some(other) => Err(PlotError::Extension { path: path.to_owned(), found: format!(".{other}") }),
            None => Err(PlotError::Extension { path: path.to_owned(), found: "no extension".to_owned() }),
        }
    }
}

/// Panels in rows under a title.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Above all panels; empty for none.
    pub title: String,
    /// Below all panels, small: where the data come from; empty for none.
    pub caption: String,
    /// From the left, row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row, at least 1.
    pub columns: usize,
    /// Width and height of a panel's frame, in units of half a PNG pixel; labels come on top.
    pub panel_size: [f64; 2],
}

/// Two axes and what is drawn between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Above the frame; empty for none.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// Below all series.
    pub raster: Option<Raster>,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Words at places.
    pub notes: Vec<Note>,
    /// Whether the legend stands at the right of all panels; else in the corner of this one where it hides least.
    pub legend_beside: bool,
}

impl Figure {
    /// A figure without panels yet, one panel to a row.
    pub fn new(title: impl Into<String>) -> Self {
        let (title, caption) = (title.into(), String::new());
        Self { title, caption, panels: Vec::new(), columns: 1, panel_size: [560.0, 380.0] }
    }

    /// Adds a panel.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Sets the number of panels in a row.
    #[must_use]
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Sets the size of the panels' frames.
    #[must_use]
    pub fn panel_size(mut self, width: f64, height: f64) -> Self {
        self.panel_size = [width, height];
        self
    }

    /// Sets the line below the panels.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// The bytes of a file.
    ///
    /// # Errors
    /// [`PlotError::Size`] or [`PlotError::Encode`], for PNG only.
    pub fn encode(&self, format: Format) -> Result<Vec<u8>, PlotError> {
        let drawing = layout::lay_out(self);
        match format {
            Format::Svg => Ok(svg::encode(&drawing, &self.title).into_bytes()),
            Format::Png => pixels::encode(&drawing),
        }
    }

    /// Writes the file in the format its extension asks for.
    ///
    /// # Errors
    /// Any [`PlotError`].
    pub fn write(&self, path: &Path) -> Result<(), PlotError> {
        let bytes = self.encode(Format::of(path)?)?;
        std::fs::write(path, bytes).map_err(|source| PlotError::Write { path: path.to_owned(), source })
    }
}

impl Panel {
    /// An empty panel: nothing is drawn of it before there is anything in it, but it keeps its place in its row.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { title: String::new(), x, y, raster: None, series: Vec::new(), notes: Vec::new(), legend_beside: false }
    }

    /// Whether it only keeps a place.
    fn is_gap(&self) -> bool {
        self.title.is_empty() && self.raster.is_none() && self.series.is_empty() && self.notes.is_empty()
    }

    /// Sets the title.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a series.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Puts a raster below everything.
    #[must_use]
    pub fn raster(mut self, raster: Raster) -> Self {
        self.raster = Some(raster);
        self
    }

    /// Puts the legend at the right of all panels, where it hides nothing.
    #[must_use]
    pub fn legend_beside(mut self) -> Self {
        self.legend_beside = true;
        self
    }

    /// Adds words.
    #[must_use]
    pub fn note(mut self, note: Note) -> Self {
        self.notes.push(note);
        self
    }
}
