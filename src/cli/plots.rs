//! `--plot`: the file, and figures of profiles on logarithmic axes as in Figures 4 and 5 of Hašan et al. 2010.

use std::path::Path;

use lumislice::{
    optics::{ChannelPrediction, PredictedRing},
    plot::{Axis, BLUE, Figure, Format, GREEN, Panel, RED, Rgb, SERIES, Series, Shape},
};

use super::{Result, output_file::OutputFile};

/// A plot's file: its format is known and its place reserved before long work.
pub struct PlotFile {
    file: OutputFile,
    format: Format,
}

impl PlotFile {
    /// Checks the name's ending and that the file can be written.
    pub fn open(path: &Path) -> Result<Self> {
        let format = Format::of(path)?;
        Ok(Self { file: OutputFile::open(path)?, format })
    }

    /// Writes the whole file.
    pub fn finish(self, figure: &Figure) -> Result<()> {
        self.file.finish(&figure.encode(self.format)?)
    }
}

/// A profile to draw.
pub struct Curve<'a> {
    /// In the legend.
    pub name: String,
    /// What leaves the stack.
    pub light: &'a ChannelPrediction,
    /// Its colour.
    pub colour: Rgb,
    /// How it is drawn.
    pub look: Look,
    rings: Vec<PredictedRing>,
}

impl<'a> Curve<'a> {
    /// A profile to draw.
    pub fn new(name: String, light: &'a ChannelPrediction, colour: Rgb, look: Look) -> Self {
        Self { name, light, colour, look, rings: light.rings() }
    }

    /// The part of its rings that says something of one side: what photons counted; of what is transformed back from
    /// frequencies all up to where it first rises again, for beyond that the transform's own errors show.
    fn told(&self, side: Side) -> &[PredictedRing] {
        let rises = |pair: &[PredictedRing]| pair[0].r_mm >= CENTRE_MM && side.value(&pair[1]) >= side.value(&pair[0]);
        let end = match self.look {
            Look::Rings => None,
            Look::Solid | Look::Dashed => self.rings.windows(2).position(rises),
        };
        end.map_or(&self.rings, |end| &self.rings[..=end])
    }
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// A line.
    Solid,
    /// A dashed line.
    Dashed,
    /// Rings: what photons counted.
    Rings,
}

/// Which profile of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// R(r).
    Reflection,
    /// T(r).
    Transmission,
}

impl Side {
    fn value(self, ring: &PredictedRing) -> f64 {
        match self {
            Self::Reflection => ring.reflection_per_mm2,
            Self::Transmission => ring.transmission_per_mm2,
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Reflection => "R(r) [mm⁻²]",
            Self::Transmission => "T(r) [mm⁻²]",
        }
    }
}

/// Decades below the highest value that are shown: the paper's measurements reach five.
const DECADES: f64 = 6.0;
/// The centre is left out of what decides the axes: R grows like 1/r there.
const CENTRE_MM: f64 = 0.05;
/// Marks along a curve of photons.
const MARKS: usize = 40;

/// R or T of `curves` over r. `None` where there is no light to show.
pub fn profile_panel(side: Side, curves: &[Curve]) -> Option<Panel> {
    let rings = || curves.iter().flat_map(|curve| curve.told(side)).filter(|ring| ring.r_mm >= CENTRE_MM);
    let top = rings().map(|ring| side.value(ring)).fold(0.0, f64::max);
    if top <= 0.0 {
        return None;
    }
    let least = top * libm::pow(10_f64, -DECADES);
    let reach = rings().filter(|ring| side.value(ring) > least).map(|ring| ring.r_mm).fold(1.0, f64::max);
    let y = Axis::log(side.label()).range(least, 3.0 * top);
    let panel = Panel::new(Axis::linear("r [mm]").range(0.0, reach), y);
    Some(curves.iter().fold(panel, |panel, curve| {
        let points = curve.told(side).iter().map(|ring| [ring.r_mm, side.value(ring)]);
        let series = match curve.look {
            Look::Solid => Series::line(&curve.name, points),
            Look::Dashed => Series::line(&curve.name, points).dashed(),
            Look::Rings => Series::points(&curve.name, apart(points, reach)).shape(Shape::Ring),
        };
        panel.with(series.colour(curve.colour))
    }))
}

/// At most [`MARKS`] of the points up to `reach`, evenly apart.
fn apart(points: impl Iterator<Item = [f64; 2]>, reach: f64) -> Vec<[f64; 2]> {
    let step = reach / MARKS as f64;
    let mut next = 0.0;
    let mut kept = Vec::new();
    for point in points {
        if point[0] >= next {
            kept.push(point);
            next = point[0] + step;
        }
    }
    kept
}

/// The colours of channels: those of their names where they are primaries.
pub fn channel_colours(channels: &[String]) -> Vec<Rgb> {
    let colour = |(index, name): (usize, &String)| match name.as_str() {
        "R" => RED,
        "G" => GREEN,
        "B" => BLUE,
        _ => SERIES[index % SERIES.len()],
    };
    channels.iter().enumerate().map(colour).collect()
}
