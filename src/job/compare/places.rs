//! The numbers behind the pictures, texel by texel.

use std::fmt::Write as _;

use glam::DVec3;

use super::{Comparison, Stage};
use crate::appearance::bssrdf::write_npy;

impl Comparison {
    /// Radiosity per irradiance of every stage, `[stage][channel][light][row][column]`; stages, channels and lights in
    /// the order of `comparison.json`.
    pub(super) fn radiosity_npy(&self) -> Vec<u8> {
        self.array(|stage| Some(&stage.radiosity))
    }

    /// One standard deviation of it, alike; 0 where nothing was counted.
    pub(super) fn noise_npy(&self) -> Vec<u8> {
        self.array(|stage| stage.noise.as_ref())
    }

    fn array<'a>(&'a self, values: impl Fn(&'a Stage) -> Option<&'a Vec<Vec<Vec<f32>>>>) -> Vec<u8> {
        let (channels, lights, texels) = (self.channels.len(), self.lights.len(), self.width * self.height);
        let mut all = Vec::with_capacity(self.stages.len() * channels * lights * texels);
        for stage in &self.stages {
            match values(stage) {
                Some(values) => values.iter().flatten().for_each(|picture| all.extend_from_slice(picture)),
                None => all.resize(all.len() + channels * lights * texels, 0.0),
            }
        }
        write_npy(&[self.stages.len(), channels, lights, self.height, self.width], &all)
    }

    /// A row for every texel, or every pixel that shows an object: where it is, and the radiosity of every stage,
    /// channel and light there.
    pub(super) fn places_csv(&self) -> String {
        let mut text = String::from(
            "# Radiosity per irradiance, as linear shares; row 0 is the picture's top. Columns: stage, channel, light.\n\
             row,column,x_mm,y_mm",
        );
        if self.surface.is_some() {
            text += ",z_mm";
        }
        for (stage, _) in self.pictures_of() {
            for (channel, light) in self.channels.iter().flat_map(|c| self.lights.iter().map(move |l| (c, l))) {
                let _ = write!(text, ",\"{} {channel} {light}\"", stage.replace('"', "\"\""));
            }
        }
        text.push('\n');
        for texel in 0..self.width * self.height {
            let (row, column) = (texel / self.width, texel % self.width);
            match &self.surface {
                None => {
                    let [x, y] = [column as f64 + 0.5, (self.height - row) as f64 - 0.5].map(|at| at * self.pitch_mm);
                    let _ = write!(text, "{row},{column},{x:.4},{y:.4}");
                }
                Some(surface) => {
                    let Some(DVec3 { x, y, z }) = surface[texel] else { continue };
                    let _ = write!(text, "{row},{column},{x:.4},{y:.4},{z:.4}");
                }
            }
            for (_, radiosity) in self.pictures_of() {
                for picture in radiosity.iter().flatten() {
                    let _ = write!(text, ",{:.6}", picture[texel]);
                }
            }
            text.push('\n');
        }
        text
    }

    fn pictures_of(&self) -> impl Iterator<Item = (&String, &Vec<Vec<Vec<f32>>>)> {
        self.stages.iter().map(|stage| (&stage.name, &stage.radiosity))
    }
}
