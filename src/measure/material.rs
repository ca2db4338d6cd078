//! Both profiles, scaled and checked, as a material file.

use std::fmt::Write as _;

use super::albedo::{MeasuredAlbedo, albedo};
use super::aperture::Centre;
use super::figures::{percent, plus_minus};
use super::scan::{ScannedProfile, scan};
use super::{Capture, Finding, MeasureError, ResinFacts, Series};
use crate::optics::{
    CoefficientFit, FitRefusal, FrequencyGrid, Interface, MeasuredSlab, ProfileFile, RadialProfile, ResinSpectrum,
    Tail, fit_coefficients, fit_shapes,
};
use crate::watch::Watch;
use crate::words::toml_string;

const REFLECTION: &str = "reflection";
const TRANSMISSION: &str = "transmission";
const SERIES: [&str; 2] = [REFLECTION, TRANSMISSION];
/// Coefficients that leave more are noted: captures that were sound left 1e-5 to 1e-4.
const NOTED_RESIDUAL: f64 = 5e-4;
/// Or leave more than this share of the albedo of reflection.
const NOTED_SHARE: f64 = 4e-3;
/// Albedos are at odds with the shapes where they leave more than this, and twice as much as the shapes alone do: sound
/// captures left at most 1.4 times as much, an albedo that is off by 10% two to four times.
const AT_ODDS: f64 = 1.5e-4;
/// And where the shapes alone would have another albedo by this share: of 60 sound captures by another generator three,
/// of resins that absorb next to nothing, left 2e-4 to 3e-4 and two to three times less with free albedos that were the
/// same.
const AT_ODDS_SHARE: f64 = 0.02;
/// Light beyond the field is named from this share on: it is extrapolated, and scaled with the rest to the albedo.
const NAMED_BEYOND: f64 = 0.005;
/// An albedo contradicts the profiles' shapes if it is off by this share, and by so many standard deviations.
const CONTRADICTED_SHARE: f64 = 0.03;
const CONTRADICTED_SIGMAS: f64 = 4.0;
/// Shapes that know an albedo no better than this do not check it: black's leave a card that is off by 10%, and
/// scattering off by 9%, or a transmission that is off by 13%.
const UNCHECKED: f64 = 0.05;
/// Factor between a measured and a fitted albedo of reflection from which it is refused: exchanged, white is off by 12.
const UNBELIEVABLE: f64 = 3.0;

/// A resin, measured.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// What was photographed, and how.
    pub capture: Capture,
    /// One per channel of the material file.
    pub channels: Vec<ChannelMeasurement>,
}

/// One channel.
#[derive(Debug, Clone)]
pub struct ChannelMeasurement {
    /// Its name in the material file.
    pub name: String,
    /// Light coming back.
    pub reflection: SeriesMeasurement,
    /// Light coming through.
    pub transmission: SeriesMeasurement,
    /// What the two together brought up.
    pub findings: Vec<Finding>,
    /// Coefficients of this slab alone, as `predict`, `match` and jobs will fit them to the material file for the
    /// transport model.
    pub fit: Result<CoefficientFit, FitRefusal>,
}

/// One profile.
#[derive(Debug, Clone)]
pub struct SeriesMeasurement {
    /// As the camera has it, with all that was noticed.
    pub scan: ScannedProfile,
    /// What it was scaled to.
    pub albedo: MeasuredAlbedo,
    /// Scaled, per mm²; standard errors cover noise, scatter, exposure times, stray light and the albedo.
    pub profile: RadialProfile,
}

/// Measures a resin. `watch` hears a stage for every series of pictures, such as "reflection (1 of 2)", and is asked
/// between pictures whether to go on.
///
/// # Errors
/// [`MeasureError`]: a picture that cannot be read, pictures that show no measurement, or profiles no slab can have.
pub fn measure(capture: Capture, watch: &dyn Watch) -> Result<Measurement, MeasureError> {
    let names = capture.channels();
    let count = 2 * names.len();
    let mut channels = Vec::new();
    for (index, name) in names.into_iter().enumerate() {
        let series = |series: &Series, word: &str, centre: Centre, number: usize| {
            let what = if count == 2 { word.to_owned() } else { format!("{word}, channel {name}") };
            let of = format!("{what} ({} of {count})", 2 * index + number + 1);
            watch.stage_of_thousandths(&of);
            let plane = capture.planes[index];
            let mut scan = scan(series, &capture.camera, plane, capture.bin_mm, centre, &what, watch)?;
            let albedo = albedo(series, plane, index, &scan.sensor, &what, &mut scan.findings)?;
            let shape = scan.profile(albedo.error / albedo.value).map_err(|error| {
                MeasureError::scene(format!("{what}: ring {}", error.index), error.found, error.expected)
            })?;
            let integral = shape.hankel(&FrequencyGrid::default()).values.first().copied().unwrap_or(0.0);
            if !(integral > 0.0) {
                let expected = "a profile that holds light";
                return Err(MeasureError::scene(what, format!("an integral of {integral}"), expected));
            }
            Ok(SeriesMeasurement { profile: shape.scaled(albedo.value / integral), albedo, scan })
        };
        let reflection = series(&capture.reflection, REFLECTION, Centre::Pole, 0)?;
        let transmission = series(&capture.transmission, TRANSMISSION, Centre::Flat, 1)?;
        let unfitted = Err(FitRefusal::Residual { residual: f64::INFINITY });
        let mut channel = ChannelMeasurement { name, reflection, transmission, findings: Vec::new(), fit: unfitted };
        channel.check_energy(&capture.resin)?;
        channel.fit(&capture.resin)?;
        channels.push(channel);
    }
    Ok(Measurement { capture, channels })
}

impl ChannelMeasurement {
    /// R̂ + T̂ ≤ 1 at every frequency: a little more is taken off both, much more is refused.
    fn check_energy(
        &mut self,
        &ResinFacts { thickness_mm, refractive_index, .. }: &ResinFacts,
    ) -> Result<(), MeasureError> {
        let (r, t) = (&self.reflection.profile, &self.transmission.profile);
        let surfaces = Interface::between(1.0, refractive_index);
        let spectrum = ResinSpectrum::from_profiles(r, t, thickness_mm, surfaces, &FrequencyGrid::default());
        let spectrum = spectrum.map_err(|error| {
            let expected = "two profiles that one slab can have; are albedos and thickness right?";
            MeasureError::scene(format!("channel {}", self.name), error.to_string(), expected)
        })?;
        if spectrum.excess > 1e-6 {
            let factor = 1.0 / (1.0 + spectrum.excess);
            self.reflection.profile = r.scaled(factor);
            self.transmission.profile = t.scaled(factor);
            self.findings.push(Finding::EnergyExcess { excess: spectrum.excess });
        }
        if let Some(repair) = spectrum.repair {
            let text = format!("transmission is noise from {:.1} rad/mm on and is continued there", repair.from_k);
            self.findings.push(Finding::Remark(text));
        }
        if spectrum.clipped > 0 {
            let text = format!("{} negative coefficients of reflection are read as 0", spectrum.clipped);
            self.findings.push(Finding::Remark(text));
        }
        for (name, tail) in [(REFLECTION, spectrum.reflection_tail), (TRANSMISSION, spectrum.transmission_tail)] {
            if let Tail::Exponential { from_mm, share, .. } = tail {
                if share > NAMED_BEYOND {
                    self.findings.push(Finding::FieldEnds { series: name, reach_mm: from_mm, share });
                    continue;
                }
                let share = percent(share);
                let text = format!("{name}: {share} of the light is beyond {from_mm:.1} mm, out of the picture");
                self.findings.push(Finding::Remark(text));
            }
        }
        Ok(())
    }

    /// Coefficients that fit both profiles, and what they say of the albedos. A reflection that is another sample's is
    /// refused: whatever was predicted from it would be wrong.
    fn fit(&mut self, resin: &ResinFacts) -> Result<(), MeasureError> {
        let slab = MeasuredSlab {
            thickness_mm: resin.thickness_mm,
            reflection: &self.reflection.profile,
            transmission: &self.transmission.profile,
        };
        self.fit = fit_coefficients(&[slab], resin.refractive_index);
        let residual = match &self.fit {
            Ok(fit) => fit.residual,
            Err(FitRefusal::Residual { residual }) => *residual,
            Err(FitRefusal::KnowsNothing { .. }) => 0.0,
        };
        let noted = NOTED_RESIDUAL.min(NOTED_SHARE * self.reflection.albedo.value);
        if residual > noted && self.fit.is_ok() {
            self.findings.push(Finding::PoorFit { residual });
        }
        let shapes = fit_shapes(&slab, resin.refractive_index);
        let albedos = [(REFLECTION, self.reflection.albedo), (TRANSMISSION, self.transmission.albedo)];
        for (which, (series, albedo)) in albedos.into_iter().enumerate() {
            let known = shapes.map_or(f64::INFINITY, |shapes| shapes.totals[which].1 / albedo.value);
            if known > UNCHECKED {
                self.findings.push(Finding::AlbedoUnchecked { series, share: known.min(1.0) });
            }
        }
        if let Some(shapes) = shapes.filter(|shapes| shapes.residual < 0.5 * residual) {
            for ((series, albedo), (fitted, error)) in albedos.into_iter().zip(shapes.totals) {
                let off = (albedo.value - fitted).abs();
                if off > CONTRADICTED_SHARE * fitted && off > CONTRADICTED_SIGMAS * libm::hypot(error, albedo.error) {
                    let measured = albedo.value;
                    if series == REFLECTION && measured.max(fitted) > UNBELIEVABLE * measured.min(fitted) {
                        return Err(self.unbelievable(measured, fitted, error));
                    }
                    self.findings.push(Finding::AlbedoContradicted { series, measured, fitted, error });
                }
            }
            let told = self
                .findings
                .iter()
                .any(|it| matches!(it, Finding::AlbedoContradicted { .. } | Finding::PoorFit { .. }));
            let other = albedos
                .iter()
                .zip(shapes.totals)
                .any(|((_, albedo), (fitted, _))| (albedo.value - fitted).abs() > AT_ODDS_SHARE * fitted);
            if residual > AT_ODDS && other && !told && self.fit.is_ok() {
                self.findings.push(Finding::AlbedosAtOdds { with: residual, without: shapes.residual });
            }
        }
        if let Err(refusal) = &self.fit {
            let told = self.findings.iter().any(|finding| matches!(finding, Finding::AlbedoContradicted { .. }));
            let why = match refusal {
                FitRefusal::Residual { .. } if !told => {
                    " (are card and sample, or with and without, exchanged, is their light even, are the card's albedo \
                     and the thickness right?)"
                }
                _ => "",
            };
            self.findings.push(Finding::Remark(format!("{refusal}{why}; only the model km will know this resin")));
        }
        Ok(())
    }

    /// The refusal of a reflection that its own profile contradicts.
    fn unbelievable(&self, measured: f64, fitted: f64, error: f64) -> MeasureError {
        MeasureError::scene(
            format!("channel {}: the albedo of reflection", self.name),
            format!("{measured:.4}, where the profiles' shapes have {fitted:.3} ± {error:.3}"),
            "less than three times as much of one as of the other: are card and sample exchanged, are the card's \
             albedo and the thickness right?",
        )
    }

    /// The fitted coefficients with their uncertainties, per mm: scattering (1 − g), absorption, and g.
    pub fn coefficients(&self) -> Option<[(f64, f64); 3]> {
        let fit = self.fit.as_ref().ok()?;
        let found = fit.coefficients;
        let reduced = found.sigma_s * (1.0 - found.g);
        Some([
            (reduced, reduced * fit.reduced_scattering_share),
            (found.sigma_a, found.sigma_a * fit.absorption_share),
            (found.g, fit.g_uncertainty),
        ])
    }

    /// Everything noticed, each with the series it was noticed in.
    pub fn all_findings(&self) -> impl Iterator<Item = (&'static str, &Finding)> {
        fn of<'a>(
            name: &'static str,
            series: &'a SeriesMeasurement,
        ) -> impl Iterator<Item = (&'static str, &'a Finding)> {
            series.scan.findings.iter().map(move |finding| (name, finding))
        }
        let (reflection, transmission) = (of(REFLECTION, &self.reflection), of(TRANSMISSION, &self.transmission));
        reflection.chain(transmission).chain(self.findings.iter().map(|finding| ("both", finding)))
    }
}

impl Measurement {
    /// What a line about a channel begins with: its name, if there are several.
    pub fn prefix(&self, channel: &ChannelMeasurement) -> String {
        if self.channels.len() > 1 { format!("{} ", channel.name) } else { String::new() }
    }

    /// Names of the files that [`Measurement::files`] makes, in its order.
    pub fn file_names(capture: &Capture, stem: &str) -> Vec<String> {
        let channels = capture.channels();
        let suffix =
            |channel: &str| if channels.len() > 1 { format!("-{}", channel.to_lowercase()) } else { String::new() };
        let both =
            channels.iter().flat_map(|channel| SERIES.map(|word| format!("{stem}-{word}{}.csv", suffix(channel))));
        both.chain([format!("{stem}.toml")]).collect()
    }

    /// Name and text of the files next to a material file called `stem`.toml: the profiles, and the material file last.
    pub fn files(&self, stem: &str) -> Vec<(String, String)> {
        let mut names = Self::file_names(&self.capture, stem).into_iter();
        let (mut reflection, mut transmission, mut files) = (Vec::new(), Vec::new(), Vec::new());
        for channel in &self.channels {
            let both = [(&channel.reflection, &mut reflection), (&channel.transmission, &mut transmission)];
            for ((series, listed), (word, name)) in both.into_iter().zip(SERIES.into_iter().zip(&mut names)) {
                let profile = Some(series.profile.clone());
                let file = match word {
                    REFLECTION => ProfileFile { reflection: profile, transmission: None },
                    _ => ProfileFile { reflection: None, transmission: profile },
                };
                files.push((name.clone(), file.to_csv(&self.comment(channel, series, word))));
                listed.push(name);
            }
        }
        files.push((format!("{stem}.toml"), self.toml(&reflection, &transmission)));
        files
    }

    /// What a profile's file says of its origin.
    fn comment(&self, channel: &ChannelMeasurement, series: &SeriesMeasurement, word: &str) -> String {
        let resin = &self.capture.resin;
        let mut text = format!(
            "measured {} of {}, {} mm thick, channel {}, on {} with {}\n\
             integral {}; means over rings; standard errors cover noise, scatter, exposure times, stray light and \
             the albedo\n\
             centre {:.2}, {:.2}, each ± {:.4} pixels\n",
            word,
            resin.name,
            resin.thickness_mm,
            channel.name,
            self.capture.date,
            self.capture.camera.model,
            plus_minus(series.albedo.value, series.albedo.error),
            series.scan.centre_px[0],
            series.scan.centre_px[1],
            series.scan.centre_error_px,
        );
        if let Some(from) = series.scan.extrapolated_from {
            let _ = writeln!(text, "EXTRAPOLATED from r_lo_mm = {:.6} on", series.scan.edges_mm[from]);
        }
        series.scan.findings.iter().for_each(|finding| {
            let _ = writeln!(text, "{finding}");
        });
        text
    }

    fn toml(&self, reflection: &[String], transmission: &[String]) -> String {
        let (capture, resin) = (&self.capture, &self.capture.resin);
        let list = |names: &[String]| {
            let names: Vec<String> = names.iter().map(|name| toml_string(name)).collect();
            if self.channels.len() > 1 { format!("[{}]", names.join(", ")) } else { names.concat() }
        };
        let channels: Vec<String> = self.channels.iter().map(|channel| toml_string(&channel.name)).collect();
        let mut text = String::from("# Written by `lumislice material measure`.\n");
        for channel in &self.channels {
            for (series, finding) in channel.all_findings() {
                let _ =
                    writeln!(text, "# {}{series}: {}", self.prefix(channel), finding.to_string().replace('\n', " "));
            }
            if let Some(found) = channel.coefficients() {
                let [reduced, absorption, g] = found.map(|(value, error)| plus_minus(value, error));
                let _ = writeln!(
                    text,
                    "# {}fitted to this slab: scattering (1 - g) {reduced}, absorption {absorption} per mm, g {g}",
                    self.prefix(channel)
                );
            }
        }
        let provenance = format!("measured on {} with {}", capture.date, capture.camera.model);
        let albedos: Vec<String> = self
            .channels
            .iter()
            .map(|channel| {
                let (r, t) = (channel.reflection.albedo, channel.transmission.albedo);
                let [r, t] = [r, t].map(|albedo| plus_minus(albedo.value, albedo.error));
                format!("{}reflects {r}, transmits {t}", self.prefix(channel))
            })
            .collect();
        let notes = [resin.notes.clone(), albedos.join("; ")].into_iter().filter(|note| !note.is_empty());
        let notes = notes.collect::<Vec<_>>().join("; ");
        let [r, g, b, a] = resin.rgba;
        let _ = write!(
            text,
            "channels = [{}]\nprovenance = {}\n\n[[resin]]\nname = {}\nrgba = [{r}, {g}, {b}, {a}]\n\
             density-g-per-cm3 = {}\nthickness-mm = {}\nreflection = {}\ntransmission = {}\n",
            channels.join(", "),
            toml_string(&provenance),
            toml_string(&resin.name),
            resin.density_g_per_cm3,
            resin.thickness_mm,
            list(reflection),
            list(transmission),
        );
        if resin.refractive_index != 1.0 {
            let _ = writeln!(text, "refractive-index = {}", resin.refractive_index);
        }
        if resin.print_as_background {
            text.push_str("print-as = \"background\"\n");
        }
        let _ = writeln!(text, "notes = {}", toml_string(&notes));
        text
    }
}
