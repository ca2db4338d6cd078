//! The comparison sheet: pictures of every stage under every light, false-colour differences, and a page with the
//! numbers.

use std::fmt::Write as _;

use super::{Comparison, Stage};
use crate::{
    colour::{Rgb, linear_to_byte},
    page::{escape, page},
    plot::{Axis, Figure, Format, Panel, PlotError, Raster, Series},
};

/// Longer side of a picture, units of the plot: room for three ticks.
const PICTURE: f64 = 260.0;
/// The share of texels that may be brighter than white.
const OVEREXPOSED: f64 = 0.005;

impl Comparison {
    /// Pictures of all stages, a row each: under the three lights, then their differences from the goal.
    pub(super) fn pictures(&self) -> Figure {
        let whites: Vec<f64> = (0..self.lamps.len()).map(|lamp| self.white(lamp)).collect();
        let aspect = self.width as f64 / self.height as f64;
        let size = if aspect >= 1.0 { [PICTURE, PICTURE / aspect] } else { [PICTURE * aspect, PICTURE] };
        let mut figure = Figure::new(format!("{}: radiosity, and differences from {}", self.name, self.stages[0].name))
            .columns(2 * self.lamps.len())
            .panel_size(size[0], size[1])
            .caption(format!(
                "mm. Linear radiosity shown as sRGB, one exposure per light. Differences: blue is darker than {}, red \
                    brighter, full colour at ±{:.0}% of white.",
                self.stages[0].name,
                100.0 * FULL_COLOUR,
            ));
        for stage in &self.stages {
            for (lamp, white) in whites.iter().enumerate() {
                let pixels = self.pixels(|texel| self.colour(stage, lamp, texel, *white));
                figure = figure.with(self.panel(format!("{}, {}", stage.name, self.lamps[lamp].key), pixels));
            }
            for (lamp, white) in whites.iter().enumerate() {
                // What the others are compared with differs from nothing.
                figure = figure.with(stage.differences.get(lamp).map_or_else(
                    || Panel::new(Axis::linear(""), Axis::linear("")),
                    |apart| {
                        let pixels = self.pixels(|texel| self.false_colour(stage, lamp, texel, *white));
                        self.panel(format!("rms {:.3}, bias {:+.3}", apart.rms, apart.bias), pixels)
                    },
                ));
            }
        }
        figure
    }

    fn panel(&self, title: String, pixels: Vec<Rgb>) -> Panel {
        let [x, y] = [self.width, self.height].map(|texels| texels as f64 * self.pitch_mm);
        let axes = Panel::new(Axis::linear("").range(0.0, x), Axis::linear("").range(0.0, y));
        axes.title(title).raster(Raster::picture(self.width, pixels, [0.0, x], [0.0, y]))
    }

    fn pixels(&self, colour: impl Fn(usize) -> Rgb) -> Vec<Rgb> {
        (0..self.width * self.height).map(colour).collect()
    }

    /// The radiosity that is shown as white.
    fn white(&self, lamp: usize) -> f64 {
        let goal = &self.stages[0];
        let mut values: Vec<f32> = goal.radiosity.iter().flat_map(|channel| &channel[lamp]).copied().collect();
        values.sort_by(f32::total_cmp);
        let at = ((values.len() - 1) as f64 * (1.0 - OVEREXPOSED)) as usize;
        f64::from(values[at]).max(f64::MIN_POSITIVE)
    }

    fn colour(&self, stage: &Stage, lamp: usize, texel: usize, white: f64) -> Rgb {
        let channels = stage.radiosity.len();
        let channel = |c: usize| linear_to_byte(f64::from(stage.radiosity[c][lamp][texel]) / white);
        if channels == 3 { [channel(0), channel(1), channel(2)] } else { [channel(0); 3] }
    }

    /// Mean over the channels of the difference from the goal.
    fn false_colour(&self, stage: &Stage, lamp: usize, texel: usize, white: f64) -> Rgb {
        let (goal, channels) = (self.goal_of(stage), stage.radiosity.len() as f64);
        let apart = |c: usize| f64::from(stage.radiosity[c][lamp][texel]) - f64::from(goal[c][lamp][texel]);
        let mean = (0..stage.radiosity.len()).map(apart).sum::<f64>() / channels;
        diverging(mean / (FULL_COLOUR * white))
    }

    /// Light across the shadow edge: each stage's mean over all rows, column by column.
    pub(super) fn edge_figure(&self) -> Figure {
        let mut panel =
            Panel::new(Axis::linear("x [mm]; lit from 0 to the middle"), Axis::linear("mean radiosity / irradiance"));
        for stage in &self.stages {
            let points = stage.edge.iter().enumerate().map(|(x, value)| [(x as f64 + 0.5) * self.pitch_mm, *value]);
            let line = Series::line(stage.name.clone(), points);
            panel = panel.with(if stage.noise.is_some() { line.dashed() } else { line });
        }
        Figure::new("Across the shadow edge").with(panel).panel_size(720.0, 380.0)
    }

    /// The page: figures and numbers, with nothing to be fetched.
    pub(super) fn page(&self) -> Result<String, PlotError> {
        let svg = |figure: &Figure| -> Result<String, PlotError> {
            Ok(String::from_utf8_lossy(&figure.encode(Format::Svg)?).into_owned())
        };
        let mut body = format!("<h1>{}</h1>\n<p>{}</p>\n", escape(&self.name), escape(&self.words()));
        let _ = write!(body, "<figure>{}</figure>\n{}", svg(&self.pictures())?, self.fits());
        let _ = write!(body, "<h2>Pictures in numbers</h2>\n{}", self.table());
        for warning in &self.warnings {
            let _ = writeln!(body, "<p class=\"warning\">{}</p>", escape(warning));
        }
        if self.surface.is_none() {
            let _ = writeln!(body, "<figure>{}</figure>", svg(&self.edge_figure())?);
        }
        Ok(page(&self.name, CSS, &body))
    }

    fn words(&self) -> String {
        if let Some([azimuth, elevation]) = self.view_deg {
            return format!(
                "{} × {} pixels of {:.4} mm, seen from azimuth {azimuth}° and elevation {elevation}°. What is clustered \
                    and predicted is equation 7 over the mesh, by the clusters' profiles and by what the transport model \
                    says of their stackings as endless flat slabs; what is printed is light through the voxels. Radiosity \
                    per irradiance, over the pixels that show an object; rms and correlation have the photons' noise \
                    taken off.",
                self.width, self.height, self.pitch_mm
            );
        }
        format!(
            "{} × {} texels of {} mm. Each stage is compared with {}, scaled as its job scaled the target. Radiosity \
                per irradiance; rms and correlation have the photons' noise taken off. What is predicted rests on each \
                stacking as an endless flat slab, as its predicted_albedo does.",
            self.width, self.height, self.pitch_mm, self.stages[0].name
        )
    }

    fn table(&self) -> String {
        let mut rows = String::from(
            "<table><tr><th>stage</th><th>against</th><th>light</th><th>bias</th><th>rms</th><th>relative \
                rms</th><th>correlation</th><th>noise</th></tr>\n",
        );
        let mut row = |stage: &str, against: &str, lamp: &str, apart: &super::Difference| {
            let correlation = apart.correlation.map_or("–".to_owned(), |value| format!("{value:.4}"));
            let noise = if apart.noise > 0.0 { format!("{:.4}", apart.noise) } else { "–".to_owned() };
            let _ = writeln!(
                rows,
                "<tr><td>{}</td><td>{}</td><td>{lamp}</td><td>{:+.4}</td><td>{:.4}</td><td>{:.2}%</td><td>{correlation}</td><td>{noise}</td></tr>",
                escape(stage),
                escape(against),
                apart.bias,
                apart.rms,
                100.0 * apart.relative_rms,
            );
        };
        for stage in &self.stages {
            for (lamp, apart) in self.lamps.iter().zip(&stage.differences) {
                row(&stage.name, &self.stages[0].name, lamp.name, apart);
            }
            for (against, apart) in &stage.against {
                self.lamps.iter().zip(apart).for_each(|(lamp, apart)| row(&stage.name, against, lamp.name, apart));
            }
        }
        rows + "</table>\n"
    }

    /// How well each job's stackings fit.
    fn fits(&self) -> String {
        if self.jobs.is_empty() {
            return String::new();
        }
        let mut rows = String::from(
            "<h2>Stackings against clusters</h2>\n<p>Σ (R̂ − R̂<sub>t</sub>)² over the Hankel coefficients, with the \
                cluster's profile as its job scaled it.</p>\n\
             <table><tr><th>job</th><th>by transport: mean</th><th>worst</th><th>by Kubelka–Munk: \
             mean</th><th>worst</th><th>albedo rms</th><th>target scaled by</th></tr>\n",
        );
        for job in &self.jobs {
            let (transport, scalar) = (job.transport, job.kubelka_munk);
            let _ = writeln!(
                rows,
                "<tr><td>{}</td><td>{:.2e}</td><td>{:.2e}</td><td>{:.2e}</td><td>{:.2e}</td><td>{:.4}</td><td>{:.3}</td></tr>",
                escape(&job.name),
                transport.mean,
                transport.worst,
                scalar.mean,
                scalar.worst,
                job.albedo_rms,
                job.scale
            );
        }
        rows + "</table>\n"
    }
}

/// A difference of this share of white has its full colour.
const FULL_COLOUR: f64 = 0.25;

const CSS: &str = "body{font-family:system-ui,sans-serif;color:#1f2630;margin:2rem auto;max-width:1500px;padding:0 \
    1rem}\
figure{margin:1rem 0;overflow-x:auto}svg{max-width:100%;height:auto}table{border-collapse:collapse}\
td,th{padding:.2rem .7rem;text-align:right;border-bottom:1px solid \
#ddd}td:nth-child(-n+3),th:nth-child(-n+3){text-align:left}\
.warning{color:#a33}";

/// −1 blue, 0 white, 1 red.
fn diverging(value: f64) -> Rgb {
    const ENDS: [Rgb; 2] = [[0x21, 0x66, 0xac], [0xb2, 0x18, 0x2b]];
    let end = ENDS[usize::from(value > 0.0)];
    let part = value.abs().min(1.0);
    end.map(|channel| (255.0 + (f64::from(channel) - 255.0) * part).round() as u8)
}
