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
}

/// Build space of the J750 and of the Objet500 Connex by their data sheets, mm.
const TRAY_500_MM: DVec3 = DVec3::new(490.0, 390.0, 200.0);

/// J750: GrabCAD Voxel Print takes 600 × 300 dpi, layers of 14 µm (High Quality) or 27 µm (High Mix; in High Speed,
/// also 27 µm, only 3 colours), 6 colours besides the background and 30 slices at least.
/// Connex500: three materials. 600 × 600 dpi × 16 µm is its data sheet's word and not verified;
/// 600 × 300 dpi × 30 µm is the digital-material bitmap method.
const PRESETS: [Preset; 4] = [
    Preset { name: "j750-14um", dpi: [600.0, 300.0], layer_mm: 0.014, max_colors: 6, min_slices: Some(30) },
    Preset { name: "j750-27um", dpi: [600.0, 300.0], layer_mm: 0.027, max_colors: 6, min_slices: Some(30) },
    Preset { name: "connex500-16um", dpi: [600.0, 600.0], layer_mm: 0.016, max_colors: 3, min_slices: None },
    Preset { name: "connex500-30um", dpi: [600.0, 300.0], layer_mm: 0.030, max_colors: 3, min_slices: None },
];

impl From<&Preset> for Printer {
    fn from(preset: &Preset) -> Self {
        Self {
            name: preset.name.to_owned(),
            pitch_mm: DVec3::new(MM_PER_INCH / preset.dpi[0], MM_PER_INCH / preset.dpi[1], preset.layer_mm),
            tray_mm: Some(TRAY_500_MM),
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
            .ok_or_else(|| UnknownPrinter { found: name.to_owned(), hint: hint(name, Self::preset_names()) })
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
    fn a_slip_is_answered_with_the_nearest_name() {
        let error = Printer::by_name("j750-27").unwrap_err().to_string();
        assert_eq!(error, "unknown printer \"j750-27\"; did you mean `j750-27um`?");
        let error = Printer::by_name("prusa").unwrap_err().to_string();
        assert!(error.ends_with("expected one of j750-14um, j750-27um, connex500-16um, connex500-30um"), "{error}");
    }
}
