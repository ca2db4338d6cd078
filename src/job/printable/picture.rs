//! What will not print well, drawn on the objects.

use glam::DVec3;

use super::{LoosePiece, Printable};
use crate::{
    colour::Rgb,
    job::{Prepared, RunError},
    preview::{PreviewFile, marked_sheet, tray_sheet},
    slice::ObjectField,
    words::counted,
};

/// The picture's path in the output folder.
const CHECKS: &str = "preview/checks.png";

const THIN: Rgb = [0xd0, 0x3a, 0x2a];
const SHALLOW: Rgb = [0xe0, 0x96, 0x2e];
const SUPPORT: Rgb = [0x4f, 0x8f, 0xc8];
const LOOSE: Rgb = [0xb0, 0x3a, 0x9e];

/// That of the tray.
const TRAY: &str = "preview/tray.png";

impl Prepared {
    /// The tray from above, where the job has its objects arranged.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub(in crate::job) fn tray_picture(&self) -> Result<Option<PreviewFile>, RunError> {
        if self.job.arrange_gap_mm.is_none() {
            return Ok(None);
        }
        let extent = self.objects.iter().fold(DVec3::ZERO, |extent, object| extent.max(object.bounds[1]));
        let tray = self.job.printer.tray_mm.unwrap_or(extent);
        let triangles = self.all_triangles();
        let title = format!("{} on {:.0} × {:.0} mm", counted(self.objects.len(), "object"), tray.x, tray.y);
        Ok(Some(tray_sheet(TRAY.to_owned(), &title, &triangles, tray.max(extent))?))
    }

    fn all_triangles(&self) -> Vec<(usize, [DVec3; 3])> {
        let of = |(object, field): (usize, &ObjectField)| -> Vec<_> {
            field.surface().triangles().iter().map(|corners| (object, *corners)).collect()
        };
        self.slicer().objects().iter().enumerate().flat_map(of).collect()
    }

    /// The objects from three sides, in colour where something is wrong; `None` where nothing is.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub(in crate::job) fn printable_picture(&self, found: &Printable) -> Result<Option<PreviewFile>, RunError> {
        if found.warnings().is_empty() {
            return Ok(None);
        }
        let triangles = self.all_triangles();
        let slack = self.lattice.pitch;
        let washed = found.washed.iter().flat_map(|washed| &washed.loose);
        let loose: Vec<_> = found.pieces.loose.iter().chain(washed).map(LoosePiece::corners).collect();
        let mark = |object: usize, point: DVec3, normal: DVec3| -> Option<Rgb> {
            let within = |[low, high]: &[DVec3; 2]| point.cmpge(*low - slack).all() && point.cmple(*high + slack).all();
            let lost = found.lost_shells.get(object);
            let boxes = found.pieces.boxes.iter().chain(lost.iter().flat_map(|lost| &lost.boxes));
            if boxes.chain(&loose).any(within) {
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
            (LOOSE, "loose or lost"),
            (SUPPORT, "support bare or alone"),
            (SHALLOW, "thinner than its layers"),
        ];
        Ok(Some(marked_sheet(CHECKS.to_owned(), "Will it print?", &triangles, &legend, &mark)?))
    }
}
