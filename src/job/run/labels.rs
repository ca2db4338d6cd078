//! Which cluster lies where on the surface, as data: points spread evenly over all surfaces, each with its label.
//!
//! A texture has far more texels than a page can hold, so every point stands for the same area; a cluster that no such
//! point has met gets the first of many more that does.

use std::{collections::BTreeSet, fmt::Write as _};

use glam::DVec3;

use crate::job::{
    Prepared,
    look::{ByArea, SurfacePoint},
};

/// The file, in the output folder.
pub(super) const LABELS: &str = "preview/labels.csv";
/// Longest file of labels that is read back, bytes.
pub(super) const MAX_LABELS_BYTES: u64 = 4 << 20;
/// Points that stand for equal areas.
const POINTS: usize = 6_000;
/// Points that are looked at for clusters that none of those has met, of which one of 100 mm² is then found on an area
/// of 0.01 mm².
const LOOKED_AT: usize = 60_000;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SurfaceLabel {
    /// Index of the object.
    pub object: usize,
    /// Index of its cluster, and stacking.
    pub cluster: u16,
    /// Where, mm in the lattice's frame.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

impl Prepared {
    /// Points of all surfaces with the clusters there, ever the same ones; none where every object has one stacking.
    pub(super) fn surface_labels(&self) -> Vec<SurfaceLabel> {
        if self.objects.iter().all(|object| object.stackings.stackings.len() < 2) {
            return Vec::new();
        }
        let areas = ByArea::new(self);
        let (mut met, mut labels) = (BTreeSet::new(), Vec::new());
        for n in 0..LOOKED_AT {
            // Roberts' sequences in one and two dimensions: even however many points are taken.
            let even = |step: f64| (0.5 + n as f64 * step).fract();
            let uv = [even(0.754_877_666_246_692_7), even(0.569_840_290_998_053_2)];
            let found = areas.point(even(0.618_033_988_749_894_9) * areas.total, uv);
            let Some(SurfacePoint { object, triangle, point, normal }) = found else { break };
            let (cluster, _) = self.wanted_at(object, triangle, point);
            if met.insert((object, cluster)) || n < POINTS {
                labels.push(SurfaceLabel { object, cluster, point, normal });
            }
        }
        labels
    }
}

/// Columns of the file.
const HEADER: &str = "object,cluster,x_mm,y_mm,z_mm,normal_x,normal_y,normal_z";

/// As a table, a row for each point.
pub(super) fn table(labels: &[SurfaceLabel]) -> String {
    let mut text = format!("{HEADER}\n");
    for SurfaceLabel { object, cluster, point, normal } in labels {
        let (p, n) = (point, normal);
        let numbers = format!("{:.3},{:.3},{:.3},{:.3},{:.3},{:.3}", p.x, p.y, p.z, n.x, n.y, n.z);
        let _ = writeln!(text, "{},{cluster},{numbers}", object + 1);
    }
    text
}

/// Reads a table again; `None` if it is no such table.
pub(super) fn read(text: &str) -> Option<Vec<SurfaceLabel>> {
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) {
        return None;
    }
    let row = |line: &str| {
        let mut fields = line.split(',');
        let object = fields.next()?.parse::<usize>().ok()?.checked_sub(1)?;
        let cluster = fields.next()?.parse().ok()?;
        let numbers: Vec<f64> = fields.map(|field| field.parse().ok()).collect::<Option<_>>()?;
        let [x, y, z, nx, ny, nz] = *numbers.as_slice() else { return None };
        let finite = numbers.iter().all(|number| number.is_finite());
        let (point, normal) = (DVec3::new(x, y, z), DVec3::new(nx, ny, nz));
        finite.then_some(SurfaceLabel { object, cluster, point, normal })
    };
    lines.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let label = |object, cluster, at: f64| SurfaceLabel {
            object,
            cluster,
            point: DVec3::new(at, -at, 0.125),
            normal: DVec3::NEG_Y,
        };
        let labels = vec![label(0, 0, 1.5), label(1, 300, 0.25)];
        assert_eq!(read(&table(&labels)), Some(labels));
        assert_eq!(read("x,y\n1,2\n"), None);
        assert_eq!(read(&format!("{HEADER}\n0,0,1,2,3,4,5,6\n")), None, "objects count from 1");
        assert_eq!(read(&format!("{HEADER}\n1,0,1,2,3,4,5,NaN\n")), None);
    }
}
