//! What stands between two axes.

use super::{Rgb, SERIES, Scale, viridis};

/// How the points of a series are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line from point to point; one that is not finite, or not above 0 on a logarithmic axis, leaves a gap.
    Line {
        /// Width, units.
        width: f64,
        /// Lengths of dash and gap, units.
        dash: Option<[f64; 2]>,
    },
    /// A mark at every point.
    Points {
        /// Its form.
        shape: Shape,
        /// Its diameter, units.
        size: f64,
    },
    /// The area between [`Series::low`] and the points.
    Band,
    /// The area that the points go around.
    Area,
}

/// Form of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A filled disc.
    Disc,
    /// A ring.
    Ring,
    /// A filled square.
    Square,
    /// A filled triangle.
    Triangle,
    /// Two crossing strokes.
    Cross,
}

/// Points with a name and a colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// In the legend; empty for none.
    pub name: String,
    /// (x, y) in the axes' units.
    pub points: Vec<[f64; 2]>,
    /// Lower bounds of a band, one for each point; else empty.
    pub low: Vec<f64>,
    /// How.
    pub mark: Mark,
    /// `None`: the next of [`SERIES`].
    pub colour: Option<Rgb>,
    /// 0 to 1.
    pub opacity: f64,
}

impl Series {
    fn new(name: impl Into<String>, points: Vec<[f64; 2]>, mark: Mark) -> Self {
        Self { name: name.into(), points, low: Vec::new(), mark, colour: None, opacity: 1.0 }
    }

    /// A line.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::new(name, points.into_iter().collect(), Mark::Line { width: 2.0, dash: None })
    }

    /// Discs.
    pub fn points(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::new(name, points.into_iter().collect(), Mark::Points { shape: Shape::Disc, size: 6.0 })
    }

    /// The area between two bounds, from (x, low, high).
    pub fn band(name: impl Into<String>, bounds: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let (points, low) = bounds.into_iter().map(|[x, low, high]| ([x, high], low)).unzip();
        Self { low, opacity: 0.22, ..Self::new(name, points, Mark::Band) }
    }

    /// The area within a polygon.
    pub fn area(name: impl Into<String>, corners: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self { opacity: 0.22, ..Self::new(name, corners.into_iter().collect(), Mark::Area) }
    }

    /// Sets the colour.
    #[must_use]
    pub fn colour(mut self, colour: Rgb) -> Self {
        self.colour = Some(colour);
        self
    }

    /// Sets the opacity, 0 to 1.
    #[must_use]
    pub fn opacity(mut self, opacity: f64) -> Self {
        self.opacity = opacity;
        self
    }

    /// Sets the width of a line or the diameter of marks, units.
    #[must_use]
    pub fn size(mut self, to: f64) -> Self {
        match &mut self.mark {
            Mark::Line { width: size, .. } | Mark::Points { size, .. } => *size = to,
            Mark::Band | Mark::Area => {}
        }
        self
    }

    /// Makes a line dashed.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        if let Mark::Line { dash, .. } = &mut self.mark {
            *dash = Some([7.0, 4.0]);
        }
        self
    }

    /// Makes a line dotted.
    #[must_use]
    pub fn dotted(mut self) -> Self {
        if let Mark::Line { dash, .. } = &mut self.mark {
            *dash = Some([1.5, 3.5]);
        }
        self
    }

    /// Sets the form of marks.
    #[must_use]
    pub fn shape(mut self, to: Shape) -> Self {
        if let Mark::Points { shape, .. } = &mut self.mark {
            *shape = to;
        }
        self
    }

    /// The colour of the series that comes `index`-th in its panel.
    pub(super) fn colour_at(&self, index: usize) -> Rgb {
        self.colour.unwrap_or(SERIES[index % SERIES.len()])
    }
}

/// Cells of colour that fill a rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Cells in a row.
    pub columns: usize,
    /// sRGB, row by row from the top.
    pub pixels: Vec<Rgb>,
    /// Where the left and right edges lie, in the x axis' units.
    pub x: [f64; 2],
    /// Where the lower and upper edges lie, in the y axis' units.
    pub y: [f64; 2],
    /// What the colours mean.
    pub bar: Option<ColourBar>,
}

/// The meaning of a heat map's colours.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourBar {
    /// Quantity and unit.
    pub label: String,
    /// Values of the first and the last colour.
    pub range: [f64; 2],
    /// Between them.
    pub scale: Scale,
}

impl Raster {
    /// A picture: `pixels` row by row from the top.
    pub fn picture(columns: usize, pixels: Vec<Rgb>, x: [f64; 2], y: [f64; 2]) -> Self {
        Self { columns, pixels, x, y, bar: None }
    }

    /// A heat map with its colour bar: `values` row by row from the top. What is not finite, or not above 0 on a
    /// logarithmic bar, is left white.
    pub fn heat_map(columns: usize, values: &[f64], x: [f64; 2], y: [f64; 2], bar: ColourBar) -> Self {
        let [low, high] = bar.range.map(|value| bar.scale.forward(value));
        let colour = |&value: &f64| {
            let part = (bar.scale.forward(value) - low) / (high - low);
            if part.is_finite() { viridis(part) } else { super::colour::PAPER }
        };
        Self { columns, pixels: values.iter().map(colour).collect(), x, y, bar: Some(bar) }
    }
}

/// Words at a place.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Where, in the axes' units: the words begin here.
    pub at: [f64; 2],
    /// The words.
    pub text: String,
    /// Their colour.
    pub colour: Rgb,
}

impl Note {
    /// Words in the colour of text.
    pub fn new(at: [f64; 2], text: impl Into<String>) -> Self {
        Self { at, text: text.into(), colour: super::INK }
    }
}
