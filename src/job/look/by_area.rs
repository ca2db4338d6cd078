//! Points of all surfaces of a job, evenly over their area.

use glam::DVec3;

use super::normal_and_area;
use crate::job::Prepared;

/// The triangles of all surfaces, in their order, by area.
pub(in crate::job) struct ByArea<'a> {
    prepared: &'a Prepared,
    /// Area of all triangles up to one and its own, mm², its object and its number; those without area are left out.
    running: Vec<(f64, usize, u32)>,
    /// Area of all, mm².
    pub total: f64,
}

/// A point of a surface.
pub(in crate::job) struct SurfacePoint {
    pub object: usize,
    pub triangle: u32,
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

impl<'a> ByArea<'a> {
    pub fn new(prepared: &'a Prepared) -> Self {
        let (mut running, mut total) = (Vec::new(), 0.0);
        for (object, field) in prepared.slicer().objects().iter().enumerate() {
            for (triangle, corners) in (0..).zip(field.surface().triangles()) {
                let Some((_, area)) = normal_and_area(corners) else { continue };
                total += area;
                running.push((total, object, triangle));
            }
        }
        Self { prepared, running, total }
    }

    /// A point of the triangle that so much `area` lies before, 0 to the total; `u` and `v`, 0 to 1, say where in it.
    /// `None` of no area.
    pub fn point(&self, area: f64, [u, v]: [f64; 2]) -> Option<SurfacePoint> {
        let last = self.running.len().checked_sub(1)?;
        let at = self.running.partition_point(|(sum, ..)| *sum <= area).min(last);
        let (_, object, triangle) = self.running[at];
        let corners = &self.prepared.slicer().objects()[object].surface().triangles()[triangle as usize];
        let (normal, _) = normal_and_area(corners)?;
        let [a, b, c] = *corners;
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        Some(SurfacePoint { object, triangle, point: a + (b - a) * u + (c - a) * v, normal })
    }
}
