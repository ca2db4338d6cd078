//! What will not print well, drawn on the objects.

use glam::DVec3;

use super::Printable;
use crate::{
    colour::Rgb,
    job::{Prepared, RunError},
    preview::{PreviewFile, marked_sheet},
};

/// The picture's path in the output folder.
const CHECKS: &str = "preview/checks.png";

const THIN: Rgb = [0xd0, 0x3a, 0x2a];
const SHALLOW: Rgb = [0xe0, 0x96, 0x2e];
const SUPPORT: Rgb = [0x4f, 0x8f, 0xc8];
const LOOSE: Rgb = [0xb0, 0x3a, 0x9e];

impl Prepared {
    /// The objects from three sides, in colour where something is wrong; `None` where nothing is.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub(in crate::job) fn printable_picture(&self, found: &Printable) -> Result<Option<PreviewFile>, RunError> {
        if found.warnings().is_empty() {
            return Ok(None);
        }
        let fields = self.slicer().objects();
        let triangles: Vec<(usize, [DVec3; 3])> = (0..)
            .zip(fields)
            .flat_map(|(object, field)| field.surface().triangles().iter().map(move |corners| (object, *corners)))
            .collect();
        let slack = self.lattice.pitch;
        let mark = |object: usize, point: DVec3, normal: DVec3| -> Option<Rgb> {
            let within = |[low, high]: &[DVec3; 2]| point.cmpge(*low - slack).all() && point.cmple(*high + slack).all();
            if found.pieces.boxes.iter().any(within) {
                return Some(LOOSE);
            }
            let marks = found.walls.get(object)?.marks.as_ref()?;
            let [thin, shallow, support] = marks.points.interpolate(point, normal, &marks.values);
            let most = thin.max(shallow).max(support);
            match most > 0.4 {
                false => None,
                true if thin == most => Some(THIN),
                true if support == most => Some(SUPPORT),
                true => Some(SHALLOW),
            }
        };
        let legend = [
            (THIN, "wall or wire thinner than 3 voxels"),
            (LOOSE, "loose crumb"),
            (SUPPORT, "support bare or alone"),
            (SHALLOW, "thinner than its layers"),
        ];
        Ok(Some(marked_sheet(CHECKS.to_owned(), "Will it print?", &triangles, &legend, &mark)?))
    }
}
