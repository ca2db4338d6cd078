//! Materials that others measured, by name, as targets: Jensen, Marschner, Levoy and Hanrahan, *A Practical Model for
//! Subsurface Light Transport*, SIGGRAPH 2001, figure 5; and Narasimhan et al., *Acquiring Scattering Properties of
//! Participating Media by Dilution*, SIGGRAPH 2006.
//!
//! Both give a reduced scattering σs′ and an absorption σa per channel. With α′ = σs′/(σs′ + σa) the mean free path of
//! a target is 1/(σs′ + σa), and its albedo what the dipole returns of all light that falls on a half-space (Jensen et
//! al., section 2.3, the total diffuse reflectance in closed form):
//!
//! ```text
//!   A = α′/2 · (1 + e^(−4/3 B √(3(1 − α′)))) · e^(−√(3(1 − α′)))      B = (1 + F)/(1 − F)
//!   F = −1.440/η² + 0.710/η + 0.668 + 0.0636 η
//! ```
//!
//! which gives the diffuse reflectances that figure 5 has beside the coefficients.

use std::sync::LazyLock;

/// A material that was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredMedium {
    /// Its name in jobs.
    pub name: &'static str,
    /// Who measured it: `jensen-2001` or `narasimhan-2006`.
    pub source: &'static str,
    /// Its refractive index η, 1 or more.
    pub index: f64,
    /// Reduced scattering σs′ for red, green and blue light, 1/mm.
    pub scattering_per_mm: [f64; 3],
    /// Absorption σa for red, green and blue light, 1/mm.
    pub absorption_per_mm: [f64; 3],
}

/// What people call some of them.
const ALIASES: [(&str, &str); 3] = [("chicken", "chicken1"), ("milk", "wholemilk"), ("skin", "skin1")];

static MEDIA: LazyLock<Vec<MeasuredMedium>> = LazyLock::new(|| {
    let rows = include_str!("data/measured-media.csv").lines().filter(|line| !line.starts_with('#'));
    rows.skip(1).filter_map(row).collect()
});

/// A line of the table.
fn row(line: &'static str) -> Option<MeasuredMedium> {
    let mut cells = line.split(',');
    let (name, source) = (cells.next()?, cells.next()?);
    let numbers: Vec<f64> = cells.map(str::parse).collect::<Result<_, _>>().ok()?;
    let &[index, sr, sg, sb, ar, ag, ab] = &numbers[..] else { return None };
    Some(MeasuredMedium { name, source, index, scattering_per_mm: [sr, sg, sb], absorption_per_mm: [ar, ag, ab] })
}

impl MeasuredMedium {
    /// All there are, in the order of their sources.
    pub fn all() -> &'static [MeasuredMedium] {
        &MEDIA
    }

    /// Every name that finds one, the short ones last.
    pub fn names() -> impl Iterator<Item = &'static str> + Clone {
        MEDIA.iter().map(|medium| medium.name).chain(ALIASES.iter().map(|alias| alias.0))
    }

    /// The one of that name; `skin`, `milk` and `chicken` are short for `skin1`, `wholemilk` and `chicken1`.
    pub fn named(name: &str) -> Option<&'static MeasuredMedium> {
        let name = ALIASES.iter().find(|alias| alias.0 == name).map_or(name, |alias| alias.1);
        MEDIA.iter().find(|medium| medium.name == name)
    }

    /// Share of light from everywhere that a half-space returns, per channel, 0 to 1.
    pub fn albedo(&self) -> [f64; 3] {
        std::array::from_fn(|channel| {
            let (scattering, absorption) = (self.scattering_per_mm[channel], self.absorption_per_mm[channel]);
            diffuse_reflectance(self.index, scattering / (scattering + absorption))
        })
    }

    /// 1/(σs′ + σa) per channel, mm.
    pub fn mean_free_path_mm(&self) -> [f64; 3] {
        std::array::from_fn(|channel| 1.0 / (self.scattering_per_mm[channel] + self.absorption_per_mm[channel]))
    }
}

/// Share of light from everywhere that a half-space of refractive index η and reduced albedo α′ returns.
pub(crate) fn diffuse_reflectance(index: f64, alpha: f64) -> f64 {
    let within = -1.440 / (index * index) + 0.710 / index + 0.668 + 0.0636 * index;
    let boundary = (1.0 + within) / (1.0 - within);
    let decay = (3.0 * (1.0 - alpha)).sqrt();
    0.5 * alpha * (1.0 + libm::exp(-4.0 / 3.0 * boundary * decay)) * libm::exp(-decay)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_the_table_is_read() {
        let rows = include_str!("data/measured-media.csv").lines().filter(|line| !line.starts_with('#')).count();
        assert_eq!(MeasuredMedium::all().len(), rows - 1);
        assert!(MeasuredMedium::names().all(|name| MeasuredMedium::named(name).is_some()));
        assert_eq!(MeasuredMedium::named("skin").unwrap().name, "skin1");
        assert_eq!((MeasuredMedium::named("jade"), MeasuredMedium::named("wax")), (None, None));
    }

    /// The diffuse reflectances that Jensen et al. print beside their coefficients, two digits.
    #[test]
    fn albedos_are_the_published_reflectances() {
        for (name, published) in [
            ("apple", [0.85, 0.84, 0.53]),
            // Its 0.10 of blue is not what its coefficients come to, 0.126.
            ("chicken1", [0.31, 0.15, 0.13]),
            ("chicken2", [0.32, 0.16, 0.10]),
            ("cream", [0.98, 0.90, 0.73]),
            ("ketchup", [0.16, 0.01, 0.00]),
            ("marble", [0.83, 0.79, 0.75]),
            ("potato", [0.77, 0.62, 0.21]),
            ("skimmilk", [0.81, 0.81, 0.69]),
            ("skin1", [0.44, 0.22, 0.13]),
            ("skin2", [0.63, 0.44, 0.34]),
            ("spectralon", [1.00, 1.00, 1.00]),
            ("wholemilk", [0.91, 0.88, 0.76]),
        ] {
            let found = MeasuredMedium::named(name).unwrap().albedo();
            for (found, published) in found.into_iter().zip(published) {
                assert!((found - published).abs() < 0.0101, "{name}: {found} in place of {published}");
            }
        }
    }

    #[test]
    fn a_mean_free_path_is_one_over_both_coefficients() {
        let [r, g, b] = MeasuredMedium::named("marble").unwrap().mean_free_path_mm();
        // 1/2.1921, 1/2.6241, 1/3.0071
        assert!((r - 0.456_183_6).abs() < 1e-6 && (g - 0.381_083_0).abs() < 1e-6 && (b - 0.332_546_3).abs() < 1e-6);
    }
}
