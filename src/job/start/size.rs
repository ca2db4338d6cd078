//! How large an object will be, and how it stands.

use glam::DVec3;

use super::{HEIGHT_MM, PRINTER, StartOptions};
use crate::{
    mesh::{TriangleMesh, Unit, bounds},
    voxel::Printer,
    words::dimensions,
};

/// Longest sides that make sense, mm.
const SENSIBLE_MM: std::ops::RangeInclusive<f64> = 10.0..=400.0;

/// How large an object will be, and how it stands.
pub(super) struct Sized {
    pub unit: Option<Unit>,
    pub height_mm: Option<f64>,
    pub why: String,
    pub y_up: bool,
    pub turned_by: String,
    /// As printed, mm.
    printed: DVec3,
}

impl Sized {
    pub fn guess(mesh: &TriangleMesh, extension: &str, options: &StartOptions, notes: &mut Vec<String>) -> Self {
        let (low, high) = bounds(&mesh.positions);
        let found = high - low;
        let stated = matches!(extension, "glb" | "gltf" | "3mf");
        let (y_up, turned_by) = match stated {
            true => (false, "the file says what is up; z is up here".to_owned()),
            false => what_is_up(mesh, low, high, extension),
        };
        let turned = if y_up { DVec3::new(found.x, found.z, found.y) } else { found };
        let longest = found.max_element();
        let unit = [Unit::Mm, Unit::Cm, Unit::M].into_iter().find(|unit| SENSIBLE_MM.contains(&(longest * unit.mm())));
        let unit = unit.filter(|unit| !stated && *unit != Unit::Mm);
        let size = turned * unit.map_or(1.0, Unit::mm);
        let printer = options.printer.as_deref().unwrap_or(PRINTER);
        let tray = Printer::by_name(printer).ok().and_then(|printer| printer.tray_mm);
        let in_words = |size: DVec3| format!("{:.4} × {:.4} × {:.4} mm", size.x, size.y, size.z);
        let fits = tray.is_none_or(|tray| size.cmple(tray).all());
        let sensible = fits && size.max_element() >= *SENSIBLE_MM.start();
        let (height_mm, unit, why) = match options.height_mm {
            Some(height) => (Some(height), None, format!("as asked for; the file has {}", in_words(turned))),
            None if sensible => (None, unit, format!("{} as the file has it", in_words(size))),
            None => (Some(HEIGHT_MM), None, format!("the file has {}, which is no size to print", in_words(turned))),
        };
        let printed = height_mm.map_or(size, |height| turned * (height / turned.z.max(f64::MIN_POSITIVE)));
        if let Some(unit) = unit {
            notes.push(format!("unit: guessed {}, by which the object is {}", unit.name(), in_words(size)));
        }
        notes.push(format!("size: {}; {why}", in_words(printed)));
        notes.push(format!("orientation: {turned_by}"));
        Self { unit, height_mm, why, y_up, turned_by, printed }
    }

    /// Whether it fits, in words.
    pub fn fits(&self, printer: &str) -> String {
        let Some(tray) = Printer::by_name(printer).ok().and_then(|printer| printer.tray_mm) else {
            return "`lumislice printers` lists them".to_owned();
        };
        let fits = if self.printed.cmple(tray).all() { "fits" } else { "does not fit" };
        format!("tray {} mm: {fits}; `lumislice printers` lists others", dimensions(tray.to_array()))
    }
}

/// How near to the lowest point a foot is, as a share of the extent.
const FOOT: f64 = 0.01;
/// Cosine of what is flat.
const FLAT: f64 = 0.985;

/// Whether +y is up rather than +z, and why.
fn what_is_up(mesh: &TriangleMesh, low: DVec3, high: DVec3, extension: &str) -> (bool, String) {
    let foot = |axis: usize| -> f64 {
        let reach = low[axis] + FOOT * (high - low)[axis];
        let areas = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
            let normal = (b - a).cross(c - a);
            let lies = [a, b, c].iter().all(|p| p[axis] <= reach);
            if lies && normal[axis].abs() >= FLAT * normal.length() { 0.5 * normal.length() } else { 0.0 }
        });
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        areas.sum::<f64>() / ((high - low)[u] * (high - low)[v]).max(f64::MIN_POSITIVE)
    };
    let (along_y, along_z) = (foot(1), foot(2));
    let words = |axis: &str, share: f64| {
        format!("guessed: it stands on a flat foot, {:.0}% of its outline, if {axis} is up", 100.0 * share)
    };
    if along_z > 0.02 && along_z > 2.0 * along_y {
        return (false, words("z", along_z));
    }
    if along_y > 0.02 && along_y > 2.0 * along_z {
        return (true, words("y", along_y));
    }
    match extension {
        "obj" => (true, "guessed: in most OBJ files y is up".to_owned()),
        _ => (false, "guessed: z is up".to_owned()),
    }
}
