//! What is said of a coupon's fit, and the material file.

use std::fmt::Write as _;

use super::{Coupon, CouponFit, Reading, fit::LEAST_PER_MM};
use crate::measure::MeasureError;
use crate::measure::figures::{percent, plus_minus};
use crate::words::toml_string;

/// A field off by so many errors is named.
const ODD: f64 = 5.0;
/// Uncertainties from here on are said: limits, not values.
const HARDLY_KNOWN: f64 = 0.25;
/// Coefficients that are so many times what the set says, or as much less, are named: pictures through a curve make
/// that of sound resins, and no field contradicts them.
const UNLIKE: f64 = 2.0;
/// Neighbours that add or take more than this share of a field are said.
const MUCH_ASIDE: f64 = 0.02;

impl Coupon {
    /// What to know before the numbers are believed.
    ///
    /// # Errors
    /// [`MeasureError::Scene`] for fits of another coupon.
    pub fn notes(&self, reading: &Reading, fits: &[CouponFit]) -> Result<Vec<String>, MeasureError> {
        self.check_fits(fits)?;
        let mut notes = reading.notes.clone();
        for (index, fit) in fits.iter().enumerate() {
            let channel = &fit.channel;
            if fit.is_missed() {
                notes.push(format!(
                    "channel {channel}: fields are missed by {:.1} times their errors, {:.4} of the light: errors are \
                     larger than stated, or the card, the light, an index or the print is not as stated, or pictures \
                     are not proportional to light",
                    fit.misfit, fit.residual
                ));
            }
            let odd = fit.missed.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            if let Some((number, off)) = odd.filter(|(_, off)| off.abs() > ODD) {
                notes.push(format!(
                    "channel {channel}: field {} ({}) is off by {:.1} of its errors, the farthest: dust, a scratch, a \
                     reflection?",
                    number + 1,
                    self.named(&self.fields[number]),
                    off.abs()
                ));
            }
            for (place, resin) in self.resins.iter().enumerate() {
                let found = fit.coefficients_with_errors(place);
                let set = resin.believed[index];
                let set = [set.sigma_s * (1.0 - set.g), set.sigma_a];
                let names = ["scattering (1 - g)", "absorption"];
                for (((value, error), set), what) in found.into_iter().zip(set).zip(names) {
                    if set >= LEAST_PER_MM
                        && error <= HARDLY_KNOWN * value
                        && !(1.0 / UNLIKE..=UNLIKE).contains(&(value / set))
                    {
                        notes.push(format!(
                            "channel {channel}: {what} of {} is {:.2} times what {} says: another resin, or pictures \
                             that are not proportional to light?",
                            resin.name,
                            value / set,
                            self.materials
                        ));
                    }
                    if error > HARDLY_KNOWN * value {
                        notes.push(format!(
                            "channel {channel}: {what} of {} is hardly known: {} per mm; fields of these thicknesses \
                             do not show it",
                            resin.name,
                            plus_minus(value, error)
                        ));
                    }
                }
            }
        }
        let aside = fits.iter().flat_map(|fit| &fit.aside).fold(0.0, |most: f64, share| most.max(share.abs()));
        if aside > MUCH_ASIDE {
            notes.push(format!(
                "light goes from field to field: up to {} of a field's, which is allowed for; a wider spacing tells \
                 more",
                percent(aside)
            ));
        }
        Ok(notes)
    }

    /// The material file.
    ///
    /// # Errors
    /// [`MeasureError::Scene`] for fits of another coupon, and unlike refractive indices.
    pub fn toml(&self, reading: &Reading, fits: &[CouponFit]) -> Result<String, MeasureError> {
        let mut text = String::from("# Written by `lumislice material fit --coupon`.\n");
        let index = self.refractive_index()?;
        for note in self.notes(reading, fits)? {
            let _ = writeln!(text, "# {note}");
        }
        let channels: Vec<String> = self.channels.iter().map(|channel| toml_string(channel)).collect();
        let fields = self.fields.len();
        let provenance = format!(
            "fitted to photographs of a coupon of {fields} fields, printed for {} ({})",
            self.printer, self.materials
        );
        let _ = writeln!(text, "channels = [{}]\nprovenance = {}", channels.join(", "), toml_string(&provenance));
        for (place, resin) in self.resins.iter().enumerate() {
            let list = |value: &dyn Fn(usize) -> String| {
                let all: Vec<String> = (0..fits.len()).map(value).collect();
                if let [one] = all.as_slice() { one.clone() } else { format!("[{}]", all.join(", ")) }
            };
            let _ = writeln!(text);
            for fit in fits {
                let [(reduced, its), (absorption, error)] = fit.coefficients_with_errors(place);
                let _ = writeln!(
                    text,
                    "# channel {}: scattering (1 - g) {}, absorption {} per mm",
                    fit.channel,
                    plus_minus(reduced, its),
                    plus_minus(absorption, error)
                );
            }
            let [r, g, b, a] = resin.rgba;
            let _ = write!(
                text,
                "[[resin]]\nname = {}\nrgba = [{r}, {g}, {b}, {a}]\ndensity-g-per-cm3 = {}\nscattering-per-mm = {}\n\
                 absorption-per-mm = {}\ng = {}\nrefractive-index = {index}\nnotes = {}\n",
                toml_string(&resin.name),
                resin.density_g_per_cm3,
                list(&|channel| format!("{:.6}", fits[channel].coefficients[place].sigma_s)),
                list(&|channel| format!("{:.6}", fits[channel].coefficients[place].sigma_a)),
                list(&|channel| fits[channel].coefficients[place].g.to_string()),
                toml_string("g and refractive index are assumed, not fitted"),
            );
        }
        Ok(text)
    }
}
