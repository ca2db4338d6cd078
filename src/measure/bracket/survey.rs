//! First look at a bracket: a window around the light out of every exposure, and the largest values.

use super::{Sensor, for_each};
use crate::measure::MeasureError;
use crate::measure::capture::Exposure;
use crate::measure::frame::{ColourPlane, Plane};
use crate::watch::Watch;

/// Side of the window, pixels: 22 mm at the paper's 44 µm, 2 MB an exposure as they are kept.
const WINDOW: usize = 512;
/// The brightest spot is the brightest square of this side, so that a hot pixel is none.
const SPOT: usize = 6;

/// One exposure's window.
pub(in crate::measure) struct Window {
    pub exposure: Exposure,
    pub plane: Plane,
    /// Largest value of the whole picture.
    pub top: f32,
}

/// What the first look saw.
pub(in crate::measure) struct Survey {
    /// Windows of the lit exposures, by rising exposure time.
    pub windows: Vec<Window>,
    /// The window of the shortest dark exposure, if there is one.
    pub dark: Option<Plane>,
    /// Centre of the brightest spot: column, row.
    pub brightest: [usize; 2],
}

impl Survey {
    pub fn take(
        frames: &[Exposure],
        dark: &[Exposure],
        plane: ColourPlane,
        watch: &dyn Watch,
    ) -> Result<Self, MeasureError> {
        let mut sorted: Vec<&Exposure> = frames.iter().collect();
        sorted.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let (mut windows, mut brightest, mut corner) = (Vec::new(), [0; 2], [0; 2]);
        for_each(&sorted, plane, watch, |i, picture| {
            if i == 0 {
                brightest = brightest_spot(&picture);
                let start = |at: usize, length: usize| at.saturating_sub(WINDOW / 2).min(length.saturating_sub(WINDOW));
                corner = [start(brightest[0], picture.width), start(brightest[1], picture.height)];
            }
            let top = picture.values.iter().copied().filter(|value| value.is_finite()).fold(f32::MIN, f32::max);
            let window = picture.crop(corner[0], corner[1], WINDOW, WINDOW);
            windows.push(Window { exposure: sorted[i].clone(), plane: window, top });
            Ok(())
        })?;
        let shortest = dark.iter().min_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let mut dark_window = None;
        for_each(&shortest.into_iter().collect::<Vec<_>>(), plane, watch, |_, picture| {
            dark_window = Some(picture.crop(corner[0], corner[1], WINDOW, WINDOW));
            Ok(())
        })?;
        Ok(Self { windows, dark: dark_window, brightest })
    }

    /// Largest value of all lit exposures.
    pub fn top(&self) -> f32 {
        self.windows.iter().map(|window| window.top).fold(f32::MIN, f32::max)
    }

    /// Whether values are whole numbers, as sensors give them; else the file is of floating point, and its numbers of
    /// any size.
    pub fn whole_numbers(&self) -> bool {
        self.windows.iter().all(|window| window.plane.values.iter().all(|value| value.fract() == 0.0 || value.is_nan()))
    }

    /// Refuses labels that rise while the pictures darken.
    pub fn require_order(&self, what: &str, sensor: &Sensor) -> Result<(), MeasureError> {
        let most = if sensor.clipped.is_finite() { sensor.clipped } else { f64::INFINITY };
        let light = |window: &Window| {
            let values = window.plane.values.iter().filter(|value| value.is_finite());
            values.map(|value| f64::from(*value).min(most)).sum::<f64>()
        };
        let lights: Vec<f64> = self.windows.iter().map(light).collect();
        let seconds = |i: usize| self.windows[i].exposure.seconds;
        let pairs = (0..lights.len()).flat_map(|i| (i + 1..lights.len()).map(move |j| (i, j)));
        let differ = pairs.filter(|&(i, j)| seconds(j) > 1.05 * seconds(i));
        let (darker, all) =
            differ.fold((0, 0), |(darker, all), (i, j)| (darker + usize::from(lights[j] < lights[i]), all + 1));
        if all >= 3 && 4 * darker > 3 * all {
            let found = format!(
                "pictures that grow darker as their times grow, from {} s to {} s",
                seconds(0),
                seconds(lights.len() - 1)
            );
            let expected = "a time for each picture in the order of their names; the times are in reverse";
            return Err(MeasureError::scene(format!("{what}: exposure times"), found, expected));
        }
        Ok(())
    }

    /// Refuses a bracket whose shortest exposure is saturated at the light, or shows none.
    pub fn require_light(&self, what: &str, sensor: &Sensor) -> Result<(), MeasureError> {
        let Some(shortest) = self.windows.first() else { return Ok(()) };
        let bright =
            |window: &Window| window.plane.values.iter().filter(|value| !(f64::from(**value) < sensor.clipped)).count();
        if bright(shortest) >= SPOT * SPOT / 2 {
            let found = format!(
                "{} pixels at or above {:.0} in the shortest exposure, {} s",
                bright(shortest),
                sensor.clipped,
                shortest.exposure.seconds
            );
            return Err(MeasureError::scene(format!("{what}: saturated"), found, "a shorter exposure as well"));
        }
        let seen = |window: &Window| {
            let (signal, noise) = (spot_mean(&window.plane), sensor.read_noise_dn / SPOT as f64);
            signal - sensor.black > 10.0 * noise
        };
        if !self.windows.iter().any(seen) {
            let expected = "a spot of light above the noise; is the black level right?";
            return Err(MeasureError::scene(format!("{what}: light"), "none in any exposure", expected));
        }
        Ok(())
    }
}

/// A pixel no brighter than its brightest neighbour to the left, right, above or below: hot ones do not count.
fn without_hot(plane: &Plane, x: usize, y: usize) -> f32 {
    let neighbours = [plane.at(x - 1, y), plane.at(x + 1, y), plane.at(x, y - 1), plane.at(x, y + 1)];
    plane.at(x, y).min(neighbours.into_iter().fold(f32::MIN, f32::max))
}

/// Centre of the brightest square.
fn brightest_spot(plane: &Plane) -> [usize; 2] {
    let mut best = (f32::MIN, [plane.width / 2, plane.height / 2]);
    let mut column_sums = vec![0.0_f32; plane.width];
    for top in (1..plane.height.saturating_sub(SPOT)).step_by(SPOT / 2) {
        column_sums.fill(0.0);
        for y in top..top + SPOT {
            (1..plane.width - 1).for_each(|x| column_sums[x] += without_hot(plane, x, y));
        }
        for left in (1..plane.width.saturating_sub(SPOT)).step_by(SPOT / 2) {
            let sum: f32 = column_sums[left..left + SPOT].iter().sum();
            if sum > best.0 {
                best = (sum, [left + SPOT / 2, top + SPOT / 2]);
            }
        }
    }
    best.1
}

/// Mean of the brightest square.
fn spot_mean(plane: &Plane) -> f64 {
    let [x, y] = brightest_spot(plane);
    let spot = plane.crop(x.saturating_sub(SPOT / 2), y.saturating_sub(SPOT / 2), SPOT, SPOT);
    spot.values.iter().map(|value| f64::from(*value)).sum::<f64>() / spot.values.len() as f64
}
