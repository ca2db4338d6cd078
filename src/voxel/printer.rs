//! Printers: the pitch of their voxels, the size of their tray, and what they refuse.
//!
//! The presets' numbers come from public data sheets and guides (Stratasys J750, Objet500 Connex, GrabCAD Voxel
//! Print). None was checked on a machine; the table in this file says which are in doubt.

use glam::DVec3;

use crate::words::hint;

/// Millimetres in an inch, exactly.
pub const MM_PER_INCH: f64 = 25.4;

/// What a job must know of the machine it is printed on.
#[derive(Debug, Clone, PartialEq)]
pub struct Printer {
    /// The preset's name, or the one the job gives its own printer.
    pub name: String,
    /// Size of a voxel along x, y and z, mm, each above 0.
    pub pitch_mm: DVec3,
    /// Size of the build space along x, y and z, mm; `None` when unknown, and then nothing is too large.
    pub tray_mm: Option<DVec3>,
    /// Resins a job may use besides the background; `None` when there is no such limit.
    pub max_colors: Option<usize>,
    /// Fewest slices the printer's software accepts; `None` when there is no such limit.
    pub min_slices: Option<usize>,
}

/// A name that belongs to no preset.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown printer {found:?}; {hint}")]
pub struct UnknownPrinter {
    /// The name that was asked for.
    pub found: String,
    /// "did you mean `…`?", or the names there are.
    pub hint: String,
}

impl crate::blame::Blamed for UnknownPrinter {}

/// One row of the table of presets.
struct Preset {
    name: &'static str,
    dpi: [f64; 2],
    layer_mm: f64,
    max_colors: usize,
    min_slices: Option<usize>,
    tray_mm: [f64; 3],
    source: &'static str,
}

/// Build space of the J750, the J850 and the Objet500 Connex by their data sheets, mm.
const TRAY_500_MM: [f64; 3] = [490.0, 390.0, 200.0];
/// Build space of the J835 by its data sheet, mm.
const TRAY_J835_MM: [f64; 3] = [350.0, 350.0, 200.0];
/// Build space of the Objet350 Connex by its data sheet, mm.
const TRAY_350_MM: [f64; 3] = [342.0, 342.0, 200.0];

const J750: &str = "J750 data sheet; lattice, colours and slices by GrabCAD Voxel Print's guide";
const J850: &str = "J850 data sheet; the J750's lattice, in which voxel prints on a J850 were published";
const J835: &str = "J835 data sheet; lattice taken from the J850, of one family, not verified";
const CONNEX_DATA: &str = "Connex data sheet; its 600 × 600 dpi is not verified";
const CONNEX_BITMAPS: &str = "Connex data sheet; lattice by published uses of the bitmap method";

/// J750: GrabCAD Voxel Print takes 600 × 300 dpi, layers of 14 µm (High Quality) or 27 µm (High Mix; in High Speed,
/// also 27 µm, only 3 colours), 6 colours besides the background and 30 slices at least.
/// J850 and J835: as the J750. Connex350 and 500: three materials. 600 × 600 dpi × 16 µm is their data sheet's word and
/// not verified; 600 × 300 dpi × 30 µm is the digital-material bitmap method.
const PRESETS: [Preset; 12] = [
    polyjet("j750-14um", 0.014, 6, TRAY_500_MM, J750),
    polyjet("j750-27um", 0.027, 6, TRAY_500_MM, J750),
    polyjet("j750-hs-27um", 0.027, 3, TRAY_500_MM, J750),
    polyjet("j850-14um", 0.014, 6, TRAY_500_MM, J850),
    polyjet("j850-27um", 0.027, 6, TRAY_500_MM, J850),
    polyjet("j850-hs-27um", 0.027, 3, TRAY_500_MM, J850),
    polyjet("j835-14um", 0.014, 6, TRAY_J835_MM, J835),
    polyjet("j835-27um", 0.027, 6, TRAY_J835_MM, J835),
    connex("connex500-16um", 600.0, 0.016, TRAY_500_MM, CONNEX_DATA),
    connex("connex500-30um", 300.0, 0.030, TRAY_500_MM, CONNEX_BITMAPS),
    connex("connex350-16um", 600.0, 0.016, TRAY_350_MM, CONNEX_DATA),
    connex("connex350-30um", 300.0, 0.030, TRAY_350_MM, CONNEX_BITMAPS),
];

/// A printer of the J7 and J8 series.
const fn polyjet(
    name: &'static str,
    layer_mm: f64,
    max_colors: usize,
    tray_mm: [f64; 3],
    source: &'static str,
) -> Preset {
    Preset { name, dpi: [600.0, 300.0], layer_mm, max_colors, min_slices: Some(30), tray_mm, source }
}

/// A Connex.
const fn connex(name: &'static str, y_dpi: f64, layer_mm: f64, tray_mm: [f64; 3], source: &'static str) -> Preset {
    Preset { name, dpi: [600.0, y_dpi], layer_mm, max_colors: 3, min_slices: None, tray_mm, source }
}

/// Printers whose names are known and whose lattice is not published: they build on a tray that turns.
const UNPUBLISHED: [&str; 4] = ["j55", "j35", "j5", "j3"];

impl From<&Preset> for Printer {
    fn from(preset: &Preset) -> Self {
        Self {
            name: preset.name.to_owned(),
            pitch_mm: DVec3::new(MM_PER_INCH / preset.dpi[0], MM_PER_INCH / preset.dpi[1], preset.layer_mm),
            tray_mm: Some(DVec3::from_array(preset.tray_mm)),
            max_colors: Some(preset.max_colors),
            min_slices: preset.min_slices,
        }
    }
}

impl Printer {
    /// Every printer known by name.
    pub fn presets() -> Vec<Self> {
        PRESETS.iter().map(Self::from).collect()
    }

    /// The names of [`Printer::presets`], in the same order.
    pub fn preset_names() -> impl Iterator<Item = &'static str> + Clone {
        PRESETS.iter().map(|preset| preset.name)
    }

    /// The preset called `name`, exactly.
    ///
    /// # Errors
    /// [`UnknownPrinter`] when there is none of that name; it suggests the nearest.
    pub fn by_name(name: &str) -> Result<Self, UnknownPrinter> {
        PRESETS
            .iter()
            .find(|preset| preset.name == name)
            .map(Self::from)
            .ok_or_else(|| UnknownPrinter { found: name.to_owned(), hint: Self::hint(name) })
    }

    fn hint(name: &str) -> String {
        let series = name.split('-').next().unwrap_or(name).to_ascii_lowercase();
        if UNPUBLISHED.contains(&series.as_str()) {
            return format!(
                "the {} builds on a tray that turns, and the lattice of its voxels is not public: expected a pitch-mm \
                 in place of a preset, from someone who knows it",
                series.to_ascii_uppercase()
            );
        }
        hint(name, Self::preset_names())
    }

    /// Where a preset's numbers come from; `None` for other printers.
    pub fn source(&self) -> Option<&'static str> {
        PRESETS.iter().find(|preset| preset.name == self.name).map(|preset| preset.source)
    }

    /// Dots per inch along x and y.
    pub fn dpi(&self) -> (f64, f64) {
        (MM_PER_INCH / self.pitch_mm.x, MM_PER_INCH / self.pitch_mm.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_j750_samples_as_its_guide_says() {
        let printer = Printer::by_name("j750-27um").unwrap();
        assert!((printer.pitch_mm - DVec3::new(0.042_333, 0.084_667, 0.027)).abs().max_element() < 1e-6);
        let (x, y) = printer.dpi();
        assert!((x - 600.0).abs() < 1e-9 && (y - 300.0).abs() < 1e-9);
        assert_eq!((printer.max_colors, printer.min_slices), (Some(6), Some(30)));
        assert_eq!(printer.tray_mm, Some(DVec3::new(490.0, 390.0, 200.0)));
    }

    #[test]
    fn every_preset_is_found_by_its_name() {
        for printer in Printer::presets() {
            assert_eq!(Printer::by_name(&printer.name), Ok(printer.clone()));
            assert!(printer.pitch_mm.min_element() > 0.0);
        }
        assert_eq!(Printer::presets().len(), Printer::preset_names().count());
    }

    #[test]
    fn a_printer_whose_lattice_is_not_public_is_refused_with_the_reason() {
        for name in ["j55", "J55-19um", "j5-medijet"] {
            let error = Printer::by_name(name).unwrap_err().to_string();
            assert!(error.contains("builds on a tray that turns") && error.contains("pitch-mm"), "{error}");
        }
    }

    #[test]
    fn high_speed_takes_three_colours_and_smaller_trays_are_smaller() {
        let printer = |name| Printer::by_name(name).unwrap();
        assert_eq!(printer("j750-hs-27um").max_colors, Some(3));
        assert_eq!(printer("j850-14um").pitch_mm, printer("j750-14um").pitch_mm);
        assert_eq!(printer("j835-27um").tray_mm, Some(DVec3::new(350.0, 350.0, 200.0)));
        assert_eq!(printer("connex350-30um").tray_mm, Some(DVec3::new(342.0, 342.0, 200.0)));
        assert!(Printer::presets().iter().all(|printer| printer.source().is_some()));
    }

    #[test]
    fn a_slip_is_answered_with_the_nearest_name() {
        let error = Printer::by_name("j750-27").unwrap_err().to_string();
        assert_eq!(error, "unknown printer \"j750-27\"; did you mean `j750-27um`?");
        let error = Printer::by_name("prusa").unwrap_err().to_string();
        let names = Printer::preset_names().collect::<Vec<_>>().join(", ");
        assert!(error.ends_with(&format!("expected one of {names}")), "{error}");
    }
}
