//! A stage of the way from the data to the print, and how far it is from others.

use serde::Serialize;

use super::Difference;

/// A stage of the way from the data to the print.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// Its name, with the job's where there are several.
    pub name: String,
    /// By how much its job scaled the target.
    pub scale: f64,
    /// Differences from the first stage under each light, mean over channels; empty for the first.
    pub differences: Vec<Difference>,
    /// Differences from other stages of the same job, by their names.
    pub against: Vec<(String, Vec<Difference>)>,
    /// Mean radiosity of each column under the shadow edge, mean over channels.
    pub edge: Vec<f64>,
    /// Radiosity `[channel][light][texel]`.
    #[serde(skip)]
    pub(super) radiosity: Vec<Vec<Vec<f32>>>,
    /// One standard deviation of it, where it was counted.
    #[serde(skip)]
    pub(super) noise: Option<Vec<Vec<Vec<f32>>>>,
    /// Which texels count; `None`: all.
    #[serde(skip)]
    shown: Option<Vec<bool>>,
}

impl Stage {
    pub(super) fn new(
        name: impl Into<String>,
        scale: f64,
        radiosity: Vec<Vec<Vec<f32>>>,
        noise: Option<Vec<Vec<Vec<f32>>>>,
    ) -> Self {
        let name = name.into();
        Self {
            name,
            scale,
            differences: Vec::new(),
            against: Vec::new(),
            edge: Vec::new(),
            radiosity,
            noise,
            shown: None,
        }
    }

    /// The same where only some texels count.
    pub(super) fn only(self, shown: &[bool]) -> Self {
        Self { shown: Some(shown.to_vec()), ..self }
    }

    pub(super) fn scale_by(&mut self, scale: f64) {
        let factor = (scale / self.scale) as f32;
        self.radiosity.iter_mut().flatten().flatten().for_each(|value| *value *= factor);
        self.scale = scale;
    }

    /// The same picture had its job scaled the target by `scale`.
    pub(super) fn rescaled(&self, scale: f64) -> Self {
        let mut stage = self.clone();
        stage.scale_by(scale);
        stage
    }

    pub(super) fn compare_with_goal(&mut self, goal: &Self) {
        self.differences = self.apart(goal);
    }

    pub(super) fn compare_with(&mut self, other: &Self) {
        self.against.push((other.name.clone(), self.apart(other)));
    }

    /// Under each light, over the values of all channels together.
    fn apart(&self, other: &Self) -> Vec<Difference> {
        let all = |of: &Vec<Vec<Vec<f32>>>, lamp: usize| -> Vec<f32> {
            let counts = |texel: usize| self.shown.as_ref().is_none_or(|shown| shown[texel]);
            let picture = |channel: &Vec<Vec<f32>>| -> Vec<f32> {
                channel[lamp].iter().enumerate().filter(|(texel, _)| counts(*texel)).map(|(_, value)| *value).collect()
            };
            of.iter().flat_map(picture).collect()
        };
        let lamps = self.radiosity.first().map_or(0, Vec::len);
        let apart = |lamp: usize| {
            let noise = self.noise.as_ref().map(|noise| all(noise, lamp));
            Difference::new(&all(&self.radiosity, lamp), &all(&other.radiosity, lamp), noise.as_deref())
        };
        (0..lamps).map(apart).collect()
    }

    /// Takes `edge` from the pictures under the shadow edge, the second of the lights.
    pub(super) fn read_edge(&mut self, width: usize, height: usize) {
        let count = (self.radiosity.len() * height) as f64;
        let column = |x: usize| {
            let rows = self.radiosity.iter().flat_map(|lamps| lamps[1].chunks(width).map(move |row| f64::from(row[x])));
            rows.sum::<f64>() / count
        };
        self.edge = (0..width).map(column).collect();
    }
}
