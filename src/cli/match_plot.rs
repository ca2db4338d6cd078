//! `match --plot`: the target and what the models say of the answer.

use lumislice::{
    optics::{ChannelPrediction, FrequencyGrid, Prediction},
    plot::{Axis, BLACK, BLUE, Figure, GREEN, Panel, Rgb, Series, Shape, VERMILION},
    search::SearchTarget,
};

use super::plots::{Curve, Look, Side, profile_panel};

/// What is drawn; every prediction has the target's channels.
pub struct MatchPlot<'a> {
    pub title: String,
    pub caption: String,
    pub target: &'a SearchTarget,
    pub grid: &'a FrequencyGrid,
    pub km: Prediction,
    pub transport: Option<Prediction>,
    pub monte_carlo: Option<&'a Prediction>,
}

/// A prediction's name, colour and look.
type Shown<'a> = (&'static str, Rgb, Look, &'a Prediction);

impl MatchPlot<'_> {
    fn predictions(&self) -> Vec<Shown<'_>> {
        let km = std::iter::once(("Kubelka–Munk", BLUE, Look::Dashed, &self.km));
        let transport = self.transport.iter().map(|found| ("transport", VERMILION, Look::Solid, found));
        let photons = self.monte_carlo.map(|found| ("Monte Carlo", BLACK, Look::Rings, found));
        km.chain(transport).chain(photons).collect()
    }

    /// A row per channel: the profile over r and its transform over k.
    pub fn figure(&self) -> Figure {
        let mut figure = Figure::new(&self.title).columns(2).caption(&self.caption);
        for (channel, name) in self.km.channels.iter().enumerate() {
            let wanted = &self.target.channels[channel];
            let dark = vec![0.0; wanted.len()];
            let target = ChannelPrediction::from_spectra(wanted.clone(), dark, self.grid);
            let target = Curve::new("target".into(), &target, GREEN, Look::Solid);
            let predictions = self.predictions();
            let curves: Vec<Curve> =
                std::iter::once(target)
                    .chain(predictions.iter().map(|&(name, colour, look, found)| {
                        Curve::new(name.into(), &found.light[channel], colour, look)
                    }))
                    .collect();
            let suffix = if self.km.channels.len() > 1 { format!(", channel {name}") } else { String::new() };
            let profile = profile_panel(Side::Reflection, &curves);
            figure.panels.extend(profile.map(|panel| panel.title(format!("Profile{suffix}"))));
            figure.panels.push(self.spectra(&curves).title(format!("Hankel transform{suffix}")));
        }
        figure
    }

    fn spectra(&self, curves: &[Curve]) -> Panel {
        let panel = Panel::new(Axis::linear("k [rad/mm]"), Axis::log("R\u{302}(k)"));
        curves.iter().fold(panel, |panel, curve| {
            let points = self.grid.as_slice().iter().zip(&curve.light.reflection_hankel).map(|(k, r)| [*k, *r]);
            let series = match curve.look {
                Look::Solid => Series::line(&curve.name, points),
                Look::Dashed => Series::line(&curve.name, points).dashed(),
                Look::Rings => Series::points(&curve.name, points.step_by(4)).shape(Shape::Ring),
            };
            panel.with(series.colour(curve.colour))
        })
    }
}
