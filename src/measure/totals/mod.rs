//! Coefficients from total reflectance and transmittance: what an integrating sphere or a spectrophotometer measures.
//!
//! **In:** sheets of several thicknesses, bare or over backings, each with the share of the light that comes back and,
//! where measured, that comes through; by channel, or as spectra. **Out:** σs′ = σs (1 − g) and σa per channel with
//! their uncertainties, and a material file.
//!
//! The model is the stack's own: transport through the sheet, with the boundaries of a resin of index n to air. A
//! backing lies under a film of air, as a sheet on a tile does, and spreads what it reflects evenly:
//!
//! ```text
//!   R = R_sheet + T_sheet ρ T_diffuse / (1 − ρ R_diffuse)
//! ```
//!
//! *Assumed:* n and g. Totals hardly know g: it is taken as stated, and what another one would make of the others is
//! part of their uncertainty; so is what a standard that is off makes of all reflectances.

mod observer;
mod read;
#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::Path;

pub use read::{Instrument, Sheet, SheetResin, Totals};

use super::MeasureError;
use super::chance::beyond_chance;
use super::figures::plus_minus;
use crate::numeric::least_squares::{Budget, Descent, curvature, dot, gradient};
use crate::optics::{FrequencyGrid, Light, Stack, Transport, TransportOptions, VolumeCoefficients};
use crate::watch::{Thousandths, Watch};
use crate::words::toml_string;

/// Totals need no azimuthal order but the first; at 12 polar angles they are within 1e-4 of 20 (`--lib totals`).
const OPTIONS: TransportOptions = TransportOptions { polar: 12, orders: 1 };
/// Starts, per mm: every scattering with every absorption.
const SCATTERING: [f64; 6] = [0.1, 0.4, 1.6, 5.0, 15.0, 50.0];
const ABSORPTION: [f64; 6] = [3e-4, 3e-3, 0.03, 0.2, 1.5, 10.0];
/// Where both may go, per mm.
const LEAST_PER_MM: f64 = 1e-5;
const MOST_PER_MM: f64 = 1e3;
/// Step of the differences in ln σ.
const DIFFERENCE: f64 = 1e-3;
const DESCENT: Descent = Descent { first_damping: 1e-3, most_damping: 1e8, least_gain: 1e-6 };
const STEPS: usize = 30;
/// How far g may be from what is stated.
const G_UNKNOWN: f64 = 0.2;
const G: std::ops::RangeInclusive<f64> = -0.5..=0.95;
/// Values missed by so much of the light, root mean square, are refused: no resin does that.
const MOST_MISFIT: f64 = 0.02;
/// Another reading of the instrument is named where it brings the sum of squares, in units of the errors, down by this
/// much and below half.
const CLEARLY_BETTER: f64 = 9.0;
/// Sheets thinner than this are asked about, mm.
const THIN_MM: f64 = 0.05;
/// Uncertainties of this size know nothing.
const KNOWS_NOTHING: f64 = 0.5;
/// Absorption counts from this share of the thickest sheet on.
const LEAST_ABSORBED: f64 = 0.005;

/// One channel's coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct TotalsFit {
    /// Name of the channel.
    pub channel: String,
    /// What was found, with g as stated.
    pub coefficients: VolumeCoefficients,
    /// One standard deviation of σs (1 − g), as a share of it.
    pub reduced_scattering_share: f64,
    /// The same of σa.
    pub absorption_share: f64,
    /// Root mean square of what the values are missed by, in units of their errors.
    pub misfit: f64,
    /// The same as a share of the light sent in.
    pub residual: f64,
    /// Numbers it rests on.
    pub values: usize,
    /// The misfit if reflectance were stated the other way, with or without what the surface mirrors; `None` where that
    /// is not clearly less.
    pub other_specular: Option<f64>,
}

impl TotalsFit {
    /// Values beyond the two that any two numbers can be fitted to.
    pub fn spare(&self) -> usize {
        self.values.saturating_sub(2)
    }

    /// Whether values are missed by more than their errors explain.
    fn is_missed(&self) -> bool {
        beyond_chance(self.misfit.powi(2) * self.values as f64, self.spare())
    }
}

/// Fits every channel. `watch` hears one stage.
///
/// # Errors
/// [`MeasureError::Scene`] for values that no resin of this index has, or that leave a coefficient open;
/// [`MeasureError::Stopped`].
pub fn fit_totals(totals: &Totals, watch: &dyn Watch) -> Result<Vec<TotalsFit>, MeasureError> {
    let stage = Thousandths::begin(watch, "fitting", totals.channels.len() as u64);
    let mut fits = Vec::new();
    for (index, channel) in totals.channels.iter().enumerate() {
        stage.go_on()?;
        fits.push(Data { totals, channel: index, watch }.fit(channel)?);
        stage.advance(1);
    }
    Ok(fits)
}

/// ln σs′, ln σa.
type Parameters = [f64; 2];

struct Point {
    at: Parameters,
    /// In units of the errors.
    residuals: Vec<f64>,
}

impl Point {
    fn objective(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }
}

struct Data<'a> {
    totals: &'a Totals,
    channel: usize,
    watch: &'a dyn Watch,
}

impl Data<'_> {
    fn fit(&self, channel: &str) -> Result<TotalsFit, MeasureError> {
        let g = self.totals.resin.g;
        let found = self.best(g)?;
        let values = found.residuals.len();
        let misfit = (found.objective() / values as f64).sqrt();
        let missed = self.light(found.at, g);
        let residual = (missed.squares / values as f64).sqrt();
        let wrong = |found: String, expected: &str| {
            MeasureError::scene(format!("channel {channel}: coefficients"), found, expected)
        };
        if residual > MOST_MISFIT {
            let expected = "at most 0.02: are thicknesses, refractive index, light and specular right, and is every \
                 sheet of one resin?";
            return Err(wrong(format!("values missed by {residual:.3} of the light, rms"), expected));
        }
        let slopes = self.slopes(&found, g);
        let c = curvature(&slopes);
        let determinant = c[0][0] * c[1][1] - c[0][1] * c[1][0];
        // Errors that turn out larger than stated count as they are.
        let spare = values.saturating_sub(2).max(1) as f64;
        let scale = (found.objective() / spare).sqrt().max(1.0);
        // What another g would make of them.
        let other = |by: f64| {
            let other = (g + by).clamp(*G.start(), *G.end());
            self.descend(found.at, other).at
        };
        let (low, high) = (other(-G_UNKNOWN), other(G_UNKNOWN));
        // Reflectances that are all off as the instrument's standard is.
        let together = gradient(&slopes, &missed.reflectances);
        let calibration = self.totals.instrument.calibration_error;
        let share = |i: usize| {
            if !(determinant > 0.0) {
                return f64::INFINITY;
            }
            let noise = scale * (c[1 - i][1 - i] / determinant).sqrt();
            let shift = calibration * (c[1 - i][1 - i] * together[i] - c[0][1] * together[1 - i]) / determinant;
            libm::hypot(libm::hypot(noise, shift), 0.5 * (high[i] - low[i]))
        };
        let shares = [share(0), share(1)];
        let [reduced, absorption] = found.at.map(libm::exp);
        let thickest = self.totals.sheets.iter().map(|sheet| sheet.thickness_mm).fold(0.0, f64::max);
        let names = ["scattering (1 - g)", "absorption"];
        for ((name, value), (share, counts)) in names
            .into_iter()
            .zip([reduced, absorption])
            .zip(shares.into_iter().zip([true, absorption * thickest > LEAST_ABSORBED]))
        {
            if counts && !(share < KNOWS_NOTHING) {
                let found = format!("{name} {value:.4} ± {:.4} per mm", value * share);
                return Err(wrong(found, "an uncertainty below half of it; sheets of other thicknesses tell more"));
            }
        }
        Ok(TotalsFit {
            channel: channel.to_owned(),
            coefficients: self.volume(found.at, g),
            reduced_scattering_share: shares[0],
            absorption_share: shares[1],
            misfit,
            residual,
            values,
            other_specular: self.other_specular(&found, g),
        })
    }

    /// The misfit with reflectance read the other way, where it is clearly less.
    fn other_specular(&self, found: &Point, g: f64) -> Option<f64> {
        let mut totals = self.totals.clone();
        totals.instrument.specular = !totals.instrument.specular;
        let objective = Data { totals: &totals, ..*self }.descend(found.at, g).objective();
        let better = objective < 0.5 * found.objective() && objective + CLEARLY_BETTER < found.objective();
        better.then(|| (objective / found.residuals.len() as f64).sqrt())
    }

    fn volume(&self, at: Parameters, g: f64) -> VolumeCoefficients {
        let [reduced, sigma_a] = at.map(|ln| libm::exp(ln).clamp(LEAST_PER_MM, MOST_PER_MM));
        let refractive_index = self.totals.resin.refractive_index;
        VolumeCoefficients { sigma_s: (reduced / (1.0 - g)).min(MOST_PER_MM), sigma_a, g, refractive_index }
    }

    fn best(&self, g: f64) -> Result<Point, MeasureError> {
        let nearer = |a: &Point, b: &Point| a.objective().total_cmp(&b.objective());
        // Transmittance alone has a valley of little scattering and one of much: each start's own is followed down.
        let mut ends = Vec::new();
        for scattering in SCATTERING {
            if self.watch.stop_requested() {
                return Err(crate::watch::Stopped.into());
            }
            let start = |absorption| self.point([libm::log(scattering), libm::log(absorption)], g);
            let start = ABSORPTION.map(start).into_iter().min_by(nearer);
            ends.extend(start.map(|start| self.descend(start.at, g)));
        }
        let best = ends.into_iter().min_by(nearer);
        best.ok_or_else(|| MeasureError::scene("sheets", "none", "at least one"))
    }

    fn descend(&self, from: Parameters, g: f64) -> Point {
        DESCENT.run(
            Budget::Steps(STEPS),
            self.point(from, g),
            Point::objective,
            |here| {
                let slopes = self.slopes(here, g);
                (curvature(&slopes), gradient(&slopes, &here.residuals))
            },
            |here, (c, gradient), damping| {
                let (a, d, b) = (c[0][0] * (1.0 + damping), c[1][1] * (1.0 + damping), c[0][1]);
                let determinant = a * d - b * b;
                if !(determinant.is_finite() && determinant > 0.0) {
                    return None;
                }
                let step = [(d * gradient[0] - b * gradient[1]), (a * gradient[1] - b * gradient[0])];
                let mut at = here.at;
                for (at, step) in at.iter_mut().zip(step) {
                    // No step leaves the region the slopes speak for.
                    *at = (*at - (step / determinant).clamp(-1.0, 1.0))
                        .clamp(libm::log(LEAST_PER_MM), libm::log(MOST_PER_MM));
                }
                Some(self.point(at, g))
            },
        )
    }

    fn slopes(&self, here: &Point, g: f64) -> [Vec<f64>; 2] {
        [0, 1].map(|i| {
            let mut at = here.at;
            at[i] += DIFFERENCE;
            let there = self.point(at, g).residuals;
            there.iter().zip(&here.residuals).map(|(there, here)| (there - here) / DIFFERENCE).collect()
        })
    }

    fn point(&self, at: Parameters, g: f64) -> Point {
        Point { at, residuals: self.light(at, g).residuals }
    }

    /// What every value is missed by.
    fn light(&self, at: Parameters, g: f64) -> Missed {
        let volume = self.volume(at, g);
        let instrument = &self.totals.instrument;
        let mut missed = Missed { residuals: Vec::new(), reflectances: Vec::new(), squares: 0.0 };
        for sheet in &self.totals.sheets {
            let backing = sheet.backing.as_ref().map(|backing| backing[self.channel]);
            let found = seen(volume, sheet.thickness_mm, backing, instrument);
            let measured = [(&sheet.reflectance, 1.0), (&sheet.transmittance, 0.0)];
            for (found, (measured, reflected)) in found.into_iter().zip(measured) {
                if let Some(measured) = measured.as_ref().map(|measured| measured[self.channel]) {
                    let (off, error) = (found - measured, instrument.error_of(measured));
                    missed.residuals.push(off / error);
                    missed.reflectances.push(reflected * measured / error);
                    missed.squares += off * off;
                }
            }
        }
        missed
    }
}

struct Missed {
    /// In units of the errors.
    residuals: Vec<f64>,
    /// The values themselves in these units; 0 for transmittances.
    reflectances: Vec<f64>,
    squares: f64,
}

/// Reflectance and transmittance of a sheet as an instrument sees them.
pub(crate) fn seen(
    volume: VolumeCoefficients,
    thickness_mm: f64,
    backing: Option<f64>,
    instrument: &Instrument,
) -> [f64; 2] {
    let stack = Stack::new([(volume, thickness_mm)]);
    let grid = FrequencyGrid::of(vec![0.0]);
    // Reflected, transmitted, mirrored by the surface.
    let under = |light| {
        let model = Transport { stack: &stack, light, options: OPTIONS };
        let found = model.spectra(&grid);
        let first = |values: Vec<f64>| values.first().copied().unwrap_or(0.0);
        [first(found.reflection), first(found.transmission), model.glint()]
    };
    let [r, t, glint] = under(instrument.light);
    let mut reflectance = if instrument.specular { r + glint } else { r };
    if let Some(rho) = backing.filter(|rho| *rho > 0.0) {
        let [r, through, glint] =
            if instrument.light == Light::Diffuse { [r, t, glint] } else { under(Light::Diffuse) };
        reflectance += t * rho * through / (1.0 - rho * (r + glint));
    }
    [reflectance, t]
}

impl Totals {
    /// What to know before the numbers are believed.
    pub fn notes(&self, fits: &[TotalsFit]) -> Vec<String> {
        let mut notes = self.remarks.clone();
        for fit in fits {
            let (channel, missed) = (&fit.channel, fit.misfit);
            let of_light = format!("{missed:.1} times their errors, {:.4} of the light", fit.residual);
            if let Some(other) = fit.other_specular {
                let [stated, better] = match self.instrument.specular {
                    true => ["included", "excluded"],
                    false => ["excluded", "included"],
                };
                notes.push(format!(
                    "channel {channel}: values are missed by {of_light}, and by {other:.1} times their errors with \
                     specular = \"{better}\" in place of \"{stated}\": which is it?"
                ));
            } else if fit.is_missed() {
                notes.push(format!(
                    "channel {channel}: values are missed by {of_light}: errors are larger than stated, or a \
                     thickness, the refractive index or the light is not as stated"
                ));
            }
        }
        if let Some(fit) = fits.iter().find(|fit| fit.spare() == 0) {
            notes.push(format!(
                "{} values for two numbers: nothing checks them; a sheet of another thickness would",
                fit.values
            ));
        }
        if let Some(sheet) = self.sheets.iter().find(|sheet| sheet.thickness_mm < THIN_MM) {
            notes.push(format!("a sheet of {} mm: are thicknesses in mm?", sheet.thickness_mm));
        }
        notes
    }

    /// The material file.
    pub fn toml(&self, fits: &[TotalsFit]) -> String {
        let resin = &self.resin;
        let list = |value: &dyn Fn(&TotalsFit) -> String| {
            let all: Vec<String> = fits.iter().map(value).collect();
            if let [one] = all.as_slice() { one.clone() } else { format!("[{}]", all.join(", ")) }
        };
        let mut text = String::from("# Written by `lumislice material fit`.\n");
        for note in self.notes(fits) {
            let _ = writeln!(text, "# {note}");
        }
        for fit in fits {
            let [(reduced, its), (absorption, error)] = fit.coefficients_with_errors();
            let _ = writeln!(
                text,
                "# channel {}: scattering (1 - g) {}, absorption {} per mm, from {} values missed by {:.4} of the \
                 light",
                fit.channel,
                plus_minus(reduced, its),
                plus_minus(absorption, error),
                fit.values,
                fit.residual
            );
        }
        let channels: Vec<String> = self.channels.iter().map(|channel| toml_string(channel)).collect();
        let light = if self.instrument.light == Light::Normal { "normal" } else { "diffuse" };
        let provenance =
            format!("fitted to totals of {} sheets, {light} light, {}", self.sheets.len(), self.instrument.model);
        let [r, g, b, a] = resin.rgba;
        let _ = write!(
            text,
            "channels = [{}]\nprovenance = {}\n\n[[resin]]\nname = {}\nrgba = [{r}, {g}, {b}, {a}]\n\
             density-g-per-cm3 = {}\nscattering-per-mm = {}\nabsorption-per-mm = {}\ng = {}\nrefractive-index = {}\n",
            channels.join(", "),
            toml_string(&provenance),
            toml_string(&resin.name),
            resin.density_g_per_cm3,
            list(&|fit| format!("{:.6}", fit.coefficients.sigma_s)),
            list(&|fit| format!("{:.6}", fit.coefficients.sigma_a)),
            resin.g,
            resin.refractive_index,
        );
        if resin.print_as_background {
            text.push_str("print-as = \"background\"\n");
        }
        let notes = [resin.notes.as_str(), "g is assumed, not fitted"].into_iter().filter(|note| !note.is_empty());
        let _ = writeln!(text, "notes = {}", toml_string(&notes.collect::<Vec<_>>().join("; ")));
        text
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`MeasureError`]: the first thing that is wrong, in it or in the table it names.
    pub fn read(path: &Path) -> Result<Self, MeasureError> {
        read::totals(path)
    }
}

impl TotalsFit {
    /// σs (1 − g) and σa per mm, each with one standard deviation.
    pub fn coefficients_with_errors(&self) -> [(f64, f64); 2] {
        let found = self.coefficients;
        let reduced = found.sigma_s * (1.0 - found.g);
        [(reduced, reduced * self.reduced_scattering_share), (found.sigma_a, found.sigma_a * self.absorption_share)]
    }
}
