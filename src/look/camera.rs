//! Where the picture is taken from.

use glam::DVec3;

/// A camera far away: parallel lines of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Unit vectors of the picture in the lattice's frame: to the right in it, upwards in it, and towards the camera.
    pub axes: [DVec3; 3],
    /// What is seen in the middle of the picture, mm.
    pub middle: DVec3,
    /// Edge of a pixel, mm.
    pub pixel_mm: f64,
    /// Columns and rows.
    pub size: [usize; 2],
}

/// Part of the picture that the object fills at most.
const FILLED: f64 = 0.94;

impl Camera {
    /// Looks at the box between two corners (mm) from an azimuth (counter-clockwise from +x) and an elevation, radians.
    pub fn new([low, high]: [DVec3; 2], azimuth: f64, elevation: f64, size: [usize; 2]) -> Self {
        let toward = DVec3::new(
            libm::cos(elevation) * libm::cos(azimuth),
            libm::cos(elevation) * libm::sin(azimuth),
            libm::sin(elevation),
        );
        let right = DVec3::new(-libm::sin(azimuth), libm::cos(azimuth), 0.0);
        let up = toward.cross(right);
        let half = (high - low) * 0.5;
        let reach = |axis: DVec3, pixels: usize| 2.0 * half.dot(axis.abs()) / (FILLED * pixels as f64);
        Self {
            axes: [right, up, toward],
            middle: (low + high) * 0.5,
            pixel_mm: reach(right, size[0]).max(reach(up, size[1])),
            size,
        }
    }

    /// A point on the line of sight through (x, y), pixels from the upper left corner, well on the camera's side of
    /// everything.
    pub fn from(&self, x: f64, y: f64) -> DVec3 {
        let [right, up, toward] = self.axes;
        let aside = (x - 0.5 * self.size[0] as f64) * self.pixel_mm;
        let above = (0.5 * self.size[1] as f64 - y) * self.pixel_mm;
        self.middle + right * aside + up * above + toward * self.distance()
    }

    fn distance(&self) -> f64 {
        4.0 * self.pixel_mm * self.size[0].max(self.size[1]) as f64
    }
}
