//! A measurement for human eyes: a page with every step's picture, and what was noticed.

use super::figures::plus_minus;
use super::material::{ChannelMeasurement, Measurement, SeriesMeasurement};
use super::scan::SeenTilt;
use crate::page::{escape, page};
use crate::plot::{Axis, ColourBar, Figure, Format, GREY, Panel, PlotError, Raster, Scale, Series, VERMILION};

/// Powers of ten shown.
const DECADES: f64 = 7.0;
/// Points of the circle drawn about the centre.
const CIRCLE: usize = 96;

impl Measurement {
    /// The page, whole in itself.
    ///
    /// # Errors
    /// None is expected of SVG; [`PlotError`] if a plot fails.
    pub fn report_html(&self) -> Result<String, PlotError> {
        let resin = &self.capture.resin;
        let title = format!("{}, {} mm", resin.name, resin.thickness_mm);
        let mut body = format!(
            "<h1>{}</h1>\n<p>Photographed on {} with {}; measured by lumislice.</p>\n",
            escape(&title),
            escape(&self.capture.date),
            escape(&self.capture.camera.model),
        );
        for channel in &self.channels {
            if self.channels.len() > 1 {
                body += &format!("<h2>Channel {}</h2>\n", escape(&channel.name));
            }
            body += &table(channel);
            body += &coefficients(channel);
            body += "<h3>Noticed and corrected</h3>\n<ul>\n";
            let mut quiet = true;
            for (series, finding) in channel.all_findings() {
                body += &format!("<li>{series}: {}</li>\n", escape(&finding.to_string()));
                quiet = false;
            }
            body += if quiet { "<li>nothing</li>\n</ul>\n" } else { "</ul>\n" };
            for (name, series) in [("Reflection", &channel.reflection), ("Transmission", &channel.transmission)] {
                let svg = figure(name, series).encode(Format::Svg)?;
                body += &String::from_utf8_lossy(&svg);
                body.push('\n');
            }
            body += HOW_TO_READ;
        }
        Ok(page(&title, CSS, &body))
    }
}

const CSS: &str = "body{font:16px/1.45 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}\
    table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;text-align:left}\
    svg{max-width:100%;height:auto}td{white-space:nowrap}.how{color:#666;font-size:.9em}";

/// What the pictures' marks mean.
const HOW_TO_READ: &str = "<p class=\"how\">Tilt below x°: none was seen, and a smaller one than x would not be; it \
    is told by perspective, and not known \
    without distance-mm. Pictures: white where pixels are masked or no brighter than the dark; circles a quarter and \
    a half of the way to the edge. \
    Profiles: dotted as the camera sees them, before stray light and blur are taken off. Asymmetry: what is left of \
    each ring about its mean; a tilt or a \
    gradient shows in the 1st harmonic, ellipses in the 2nd.</p>\n";

/// What the slab's coefficients are, if any fit.
fn coefficients(channel: &ChannelMeasurement) -> String {
    let (Some(found), Ok(fit)) = (channel.coefficients(), &channel.fit) else { return String::new() };
    let [reduced, absorption, g] = found.map(|(value, error)| plus_minus(value, error));
    format!(
        "<p>Coefficients that fit this slab, for the transport model: scattering (1 − g) {reduced} per mm, absorption \
            {absorption} per mm, g {g}; \
         residual {:.1e} rms.</p>\n",
        fit.residual
    )
}

fn table(channel: &ChannelMeasurement) -> String {
    let mut text = String::from(
        "<table><tr><th></th><th>albedo</th><th>centre, pixels</th><th>half of the light</th><th>exposures</th>\
         <th>tilt</th><th>electrons per DN</th><th>blur left</th></tr>\n",
    );
    for (name, series) in [("reflection", &channel.reflection), ("transmission", &channel.transmission)] {
        let scan = &series.scan;
        let half = series.profile.radius_of_energy(0.5).map_or("—".into(), |radius| format!("{radius:.3} mm"));
        text += &format!(
            "<tr><th>{name}</th><td>{}</td><td>{:.2}, {:.2} ± \
                {:.4}</td><td>{half}</td><td>{}</td><td>{}</td><td>{:.2}</td>\
             <td>{:.2}%</td></tr>\n",
            plus_minus(series.albedo.value, series.albedo.error),
            scan.centre_px[0],
            scan.centre_px[1],
            scan.centre_error_px,
            exposures(&scan.exposures_s),
            tilt(scan.tilt),
            scan.gain_e_per_dn,
            100.0 * scan.blur_bound,
        );
    }
    text + "</table>\n"
}

fn exposures(seconds: &[f64]) -> String {
    let time = |seconds: f64| if seconds < 0.3 { format!("1/{:.0}", 1.0 / seconds) } else { format!("{seconds:.3}") };
    let time = |seconds: f64| time(seconds).trim_end_matches('0').trim_end_matches('.').to_owned();
    match seconds {
        [] => "none".into(),
        [one] => format!("{} s", time(*one)),
        [shortest, .., longest] => format!("{}, {} to {} s", seconds.len(), time(*shortest), time(*longest)),
    }
}

fn tilt(seen: Option<SeenTilt>) -> String {
    match seen {
        None => "not known".into(),
        Some(tilt) if tilt.is_seen() => format!("{}°", plus_minus(tilt.degrees, tilt.error)),
        Some(tilt) => format!("below {:.1}°", tilt.least()),
    }
}

/// Picture, profile, harmonics.
fn figure(name: &str, series: &SeriesMeasurement) -> Figure {
    Figure::new(name)
        .columns(3)
        .panel_size(330.0, 330.0)
        .with(picture(series))
        .with(profile(series))
        .with(harmonics(series))
}

fn picture(series: &SeriesMeasurement) -> Panel {
    let preview = &series.scan.preview;
    let half = 0.5 * preview.side as f64 * preview.mm_per_pixel;
    let values: Vec<f64> = preview.log10.iter().map(|log| f64::from(*log)).collect();
    let bar =
        ColourBar { label: "log₁₀ of the brightest".into(), range: [-DECADES + 1.0, 0.0], scale: Scale::Linear };
    let circle = |radius: f64| {
        (0..=CIRCLE).map(move |i| {
            let angle = i as f64 * std::f64::consts::TAU / CIRCLE as f64;
            [radius * libm::cos(angle), radius * libm::sin(angle)]
        })
    };
    let axis = |label: &str| Axis::linear(label).range(-half, half);
    Panel::new(axis("x [mm]"), axis("y [mm]"))
        .title("Exposures merged, dark subtracted")
        .raster(Raster::heat_map(preview.side, &values, [-half, half], [-half, half], bar))
        .with(Series::line("", circle(0.25 * half)).colour(GREY).size(1.0))
        .with(Series::line("", circle(0.5 * half)).colour(GREY).size(1.0))
        .with(Series::line("", circle(0.01 * half)).colour(VERMILION).size(2.0))
}

fn profile(series: &SeriesMeasurement) -> Panel {
    let (r, value) = (series.profile.r_mm(), series.profile.value_per_mm2());
    let error = series.profile.standard_error().unwrap_or(&[]);
    let scan = &series.scan;
    let measured = scan.extrapolated_from.unwrap_or(r.len());
    let factor = value.first().zip(scan.value.first()).map_or(1.0, |(scaled, value)| scaled / value);
    let top = value.iter().copied().fold(0.0, f64::max);
    let points = |range: std::ops::Range<usize>| range.map(|i| [r[i], value[i]]);
    let low = |i: usize| (value[i] - error.get(i).unwrap_or(&0.0)).max(1e-12 * top);
    let band = (0..r.len()).map(|i| [r[i], low(i), value[i] + error.get(i).unwrap_or(&0.0)]);
    let bin = scan.edges_mm.get(1).copied().unwrap_or(1.0);
    let seen = scan.seen.iter().enumerate().map(|(i, seen)| [(i as f64 + 0.5) * bin, seen * factor]);
    // As far as light is shown, and no farther down than it goes.
    let least = value.iter().copied().filter(|value| *value > 0.0).fold(top, f64::min);
    let bottom = (0.5 * least).max(top * libm::pow(10_f64, -DECADES));
    let end = r.iter().zip(value).rev().find(|(_, value)| **value > bottom).map_or(1.0, |(r, _)| *r);
    let panel = Panel::new(Axis::linear("r [mm]").range(0.0, end), Axis::log("per mm²").range(bottom, 2.0 * top))
        .title("Profile")
        .with(Series::line("as seen", seen).colour(GREY).dotted())
        .with(Series::band("± 1 σ", band))
        .with(Series::line("measured", points(0..measured)));
    if measured == r.len() {
        return panel;
    }
    panel.with(Series::line("extrapolated", points(measured..r.len())).dashed())
}

fn harmonics(series: &SeriesMeasurement) -> Panel {
    let scan = &series.scan;
    let bin = scan.edges_mm.get(1).copied().unwrap_or(1.0);
    let end = scan.extrapolated_from.unwrap_or(scan.harmonics.len()).min(scan.harmonics.len());
    let points = |index: usize| {
        let values = scan.harmonics[..end].iter().enumerate();
        values.map(move |(i, amplitudes)| [(i as f64 + 0.5) * bin, amplitudes[index]]).collect::<Vec<_>>()
    };
    Panel::new(Axis::linear("r [mm]"), Axis::log("part of the ring's mean"))
        .title("Asymmetry")
        .with(Series::line("1st harmonic", points(0)))
        .with(Series::line("2nd harmonic", points(1)))
}
