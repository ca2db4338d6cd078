//! What a measurement noticed about its own pictures, each with its size: to be read before the numbers are believed.

use std::fmt;
use std::path::{Path, PathBuf};

use super::figures::{percent, plus_minus};

/// Places of hot pixels written out.
const SHOWN: usize = 6;

/// Something that was found in the pictures, and what was done about it.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// No dark series: what the projector leaks and the sensor adds is told from the outskirts of the picture only.
    NoDarkSeries,
    /// A value of the camera that the capture file does not say, estimated from the pictures.
    Estimated {
        /// Which one, with its unit.
        what: &'static str,
        /// Its estimate.
        value: f64,
    },
    /// An exposure whose label does not fit the light in it; left out.
    MislabelledExposure {
        /// The picture.
        file: PathBuf,
        /// What it says, s.
        label_s: f64,
        /// What the other exposures say, s.
        measured_s: f64,
    },
    /// An exposure a little off its label, as shutters and lamps are; used at its measured time.
    ExposureCorrected {
        /// The picture.
        file: PathBuf,
        /// What it says, s.
        label_s: f64,
        /// What was used, s.
        measured_s: f64,
    },
    /// An exposure with light of its own in every pixel, as a door lets in; left out.
    LitUp {
        /// The picture.
        file: PathBuf,
        /// That light, DN.
        level_dn: f64,
    },
    /// The numbers of no light are others than the black level that was used.
    BlackOff {
        /// Black level that was used, DN.
        used_dn: f64,
        /// What the exposures say together, DN.
        seen_dn: f64,
    },
    /// Numbers pile up below the saturation level that was stated; what is there is taken for saturated.
    SaturationBelow {
        /// Stated, DN.
        stated: f64,
        /// Where they end, DN.
        seen: f64,
    },
    /// No flat field: what the lens' shading takes off is not given back.
    NoFlatField,
    /// The spot is so near the border that whole rings end where there still is light.
    NearBorder {
        /// Radius of the last whole ring, mm.
        reach_mm: f64,
        /// Radius that the pictures reach to in the other direction, mm.
        farthest_mm: f64,
        /// Light of the last rings over that of the largest.
        share: f64,
    },
    /// Light goes on beyond the last whole ring; the profile is continued there as it fell.
    FieldEnds {
        /// "reflection" or "transmission".
        series: &'static str,
        /// Radius of the last whole ring, mm.
        reach_mm: f64,
        /// Light beyond, as a share of all.
        share: f64,
    },
    /// Outer rings that fall to a level below 0: not subtracted.
    BelowDark {
        /// Share of the light in the largest full ring.
        share: f64,
        /// One standard deviation of it.
        error: f64,
    },
    /// Rings whose light differs from direction to direction by more than noise, tilt or a gradient make it.
    Uneven {
        /// From this radius, mm.
        from_mm: f64,
        /// To this one.
        to_mm: f64,
        /// Scatter of eight directions, as a share of the light.
        share: f64,
    },
    /// Lopsided rings that no tilt explains.
    Lopsided {
        /// First harmonic over the mean where it is largest, as a share.
        share: f64,
        /// At this radius, mm.
        at_mm: f64,
    },
    /// Light on the grey card's picture is uneven: sample and card have not the same.
    UnevenCard {
        /// By how much, as a share of the albedo.
        share: f64,
    },
    /// An albedo that the profiles' shapes contradict.
    AlbedoContradicted {
        /// "reflection" or "transmission".
        series: &'static str,
        /// As measured.
        measured: f64,
        /// What coefficients say that fit the shapes alone, and their uncertainty.
        fitted: f64,
        /// Uncertainty of that.
        error: f64,
    },
    /// An albedo that nothing else in the capture checks, as of dark resins.
    AlbedoUnchecked {
        /// "reflection" or "transmission".
        series: &'static str,
        /// What the shapes of the profiles know it to, as a share; 1 at most.
        share: f64,
    },
    /// Albedos without which the profiles fit much better.
    AlbedosAtOdds {
        /// What coefficients leave with them, root mean square.
        with: f64,
        /// And without.
        without: f64,
    },
    /// Coefficients that fit worse than photographs of a slab should.
    PoorFit {
        /// Root mean square of what they leave.
        residual: f64,
    },
    /// An exposure that is shifted against the others; left out.
    Misaligned {
        /// The picture.
        file: PathBuf,
        /// By how much, in pixels to the right and down.
        shift_px: [f64; 2],
    },
    /// Pixels that are bright in the dark, or alone against their ring and neighbours; masked.
    HotPixels {
        /// How many.
        count: usize,
        /// The first few: column, row.
        first: Vec<[u32; 2]>,
    },
    /// Patches that stand out of their rings, as dust and scratches do; masked.
    Blemishes {
        /// How many patches.
        count: usize,
        /// Pixels in all.
        pixels: usize,
    },
    /// Rings are lopsided as a tilt of the sample against the camera makes them; shading and flare can look alike.
    Tilt {
        /// Angle in degrees.
        degrees: f64,
        /// One standard deviation.
        error: f64,
    },
    /// Light that does not fall with the radius: glare in lens and tent. Subtracted.
    StrayLight {
        /// Share of the light in the largest full ring.
        share: f64,
        /// One standard deviation of it.
        error: f64,
    },
    /// A gradient across the field, which cancels over full rings.
    Gradient {
        /// Slope over the stray level or, where there is none, over the signal at the edge; per mm.
        per_mm: f64,
        /// In units of its standard deviation.
        significance: f64,
    },
    /// Rings that are ellipses: a stretched sensor, a lens, a strongly tilted sample. Averaged over.
    Ellipticity {
        /// Difference of the axes over their mean.
        share: f64,
        /// One standard deviation.
        error: f64,
    },
    /// From here on noise is larger than light, and the profile is continued as the diffuse tail falls.
    Extrapolated {
        /// From this radius, mm.
        from_mm: f64,
        /// Share of the energy beyond.
        share: f64,
    },
    /// Reflection and transmission sum to more than 1 at some frequency; both were scaled.
    EnergyExcess {
        /// By how much at worst.
        excess: f64,
    },
    /// What the material room had to do to the profiles, in its words.
    Remark(String),
}

impl Finding {
    /// Whether it may be why a measurement is wrong; others tell what is usual, or where what can be seen ends.
    pub fn is_doubt(&self) -> bool {
        !matches!(
            self,
            Self::NoDarkSeries
                | Self::Estimated { .. }
                | Self::NoFlatField
                | Self::AlbedoUnchecked { .. }
                | Self::StrayLight { .. }
                | Self::Extrapolated { .. }
                | Self::Remark(_)
        )
    }
}

fn name(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDarkSeries => {
                write!(f, "no dark series: only a constant level, told from the outskirts, is subtracted")
            }
            Self::Estimated { what, value } => {
                write!(f, "{what} is not given, estimated as {}", plus_minus(*value, 0.0))
            }
            Self::MislabelledExposure { file, label_s, measured_s } => write!(
                f,
                "{} is mislabelled: it says {label_s:.4} s, its light says {measured_s:.4} s; left out",
                name(file)
            ),
            Self::ExposureCorrected { file, label_s, measured_s } => {
                let percent = 100.0 * (measured_s / label_s - 1.0);
                write!(f, "{} is {percent:+.1}% off its {label_s:.4} s, used at {measured_s:.4} s", name(file))
            }
            Self::Misaligned { file, shift_px: [x, y] } => {
                write!(f, "{} is shifted by {x:+.2}, {y:+.2} pixels against the others; left out", name(file))
            }
            Self::LitUp { file, level_dn } => write!(
                f,
                "{} has light of its own, {level_dn:.0} DN in every pixel, or less if below 0 (a door, a lamp, another \
                 black level); left out",
                name(file)
            ),
            Self::BlackOff { used_dn, seen_dn } => write!(
                f,
                "the exposures together say that no light is {seen_dn:.0} DN, where {used_dn:.0} is used: is \
                 black-level right, and are the values linear?"
            ),
            Self::SaturationBelow { stated, seen } => write!(
                f,
                "values end at {seen:.0}, below the saturation level of {stated:.0}; from there on they count as \
                 saturated"
            ),
            Self::NoFlatField => write!(f, "no flat field: the lens' shading is not corrected"),
            Self::NearBorder { reach_mm, farthest_mm, share } => write!(
                f,
                "the spot is {reach_mm:.1} mm from the border, {farthest_mm:.1} mm from the farthest one: whole rings \
                 end at {} of the brightest, and stray light and the fall beyond are known poorly",
                percent(*share)
            ),
            Self::FieldEnds { series, reach_mm, share } => write!(
                f,
                "{series}: whole rings end at {reach_mm:.1} mm, and {} of the light lies beyond by the fall of the \
                 last ones: a larger field, or a spot nearer to its middle, tells more",
                percent(*share)
            ),
            Self::BelowDark { share, error } => write!(
                f,
                "outer rings fall to a level below the dark, {}% of the light: the field ends in the light, or the \
                 dark series has light of its own; not subtracted",
                plus_minus(100.0 * share, 100.0 * error)
            ),
            Self::Uneven { from_mm, to_mm, share } => write!(
                f,
                "rings between {from_mm:.2} and {to_mm:.2} mm are uneven by {} from direction to direction: something \
                 lies on the sample or in the way (hair, dust, a scratch), the spot is uneven, or light is reflected",
                percent(*share)
            ),
            Self::Lopsided { share, at_mm } => write!(
                f,
                "rings are lopsided by {} at {at_mm:.2} mm, and no tilt makes them so: shading of the lens, flare, a \
                 reflection, uneven light; averaged over",
                percent(*share)
            ),
            Self::UnevenCard { share } => write!(
                f,
                "light on the grey card's picture is uneven: by the slopes over card and sample the albedo may be off \
                 by {}, which its error has in it; exchange the two and photograph again",
                percent(*share)
            ),
            Self::AlbedoContradicted { series, measured, fitted, error } => write!(
                f,
                "the albedo of {series}, {measured:.4}, contradicts the profiles, whose shapes fit {}: are card and \
                 sample (or with and without) exchanged, is their light even, and is the thickness right?",
                plus_minus(*fitted, *error)
            ),
            Self::AlbedoUnchecked { series, share } => write!(
                f,
                "nothing checks the albedo of {series}, {}: by themselves the profiles know it to {} only",
                if *series == "reflection" { "and scattering goes with it" } else { "nor its times" },
                percent(*share)
            ),
            Self::AlbedosAtOdds { with, without } => write!(
                f,
                "coefficients leave {with:.1e} rms of both profiles, and {without:.1e} where their albedos are free: \
                 one of the two albedos, or the thickness, is off by some percent; is the card's albedo right, its \
                 light even, are the times of card and screen right?"
            ),
            Self::PoorFit { residual } => write!(
                f,
                "coefficients leave {residual:.1e} rms, where a slab's photographs leave 1e-4 at most: a profile, an \
                 albedo, the thickness or the refractive index is not the slab's"
            ),
            Self::HotPixels { count, first } => {
                let list: Vec<String> = first.iter().take(SHOWN).map(|[x, y]| format!("({x}, {y})")).collect();
                let more = if *count > list.len() { ", …" } else { "" };
                write!(f, "{count} hot pixels masked: {}{more}", list.join(", "))
            }
            Self::Blemishes { count, pixels } => {
                write!(f, "{count} blemishes of {pixels} pixels in all masked")
            }
            Self::Tilt { degrees, error } => {
                write!(
                    f,
                    "rings are lopsided as a tilt of {} degrees makes them (shading of the lens or flare can look \
                     alike); averaged over",
                    plus_minus(*degrees, *error)
                )
            }
            Self::StrayLight { share, error } => {
                write!(f, "stray light, {}% of the light, subtracted", plus_minus(100.0 * share, 100.0 * error))
            }
            Self::Gradient { per_mm, significance } => {
                write!(
                    f,
                    "gradient across the field, {per_mm:.1e} of the peak per mm ({significance:.0} σ); cancels over \
                        rings"
                )
            }
            Self::Ellipticity { share, error } => {
                write!(
                    f,
                    "rings are ellipses: axes differ by {}% (a stretched picture, a strong tilt, or something across \
                     the spot); averaged over",
                    plus_minus(100.0 * share, 100.0 * error)
                )
            }
            Self::Extrapolated { from_mm, share } => {
                write!(f, "continued as a diffuse tail beyond {from_mm:.2} mm, {} of the light", percent(*share))
            }
            Self::EnergyExcess { excess } => {
                write!(f, "reflection + transmission exceeded 1 by {excess:.4}; both were scaled")
            }
            Self::Remark(text) => f.write_str(text),
        }
    }
}
