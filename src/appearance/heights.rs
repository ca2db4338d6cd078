//! Thickness maps as height fields: the depth at which every layer ends, over the texels of a map.
//!
//! The maps of a flat patch are the layered height fields of Hašan et al. 2010, section 8.3; over the texture
//! coordinates of a mesh they are its layer map. A sample lies in the middle of a texel, or of a part of one: between
//! texels depths are interpolated bilinearly, and the resins' limits are imposed again, as in the voxels.

use std::fmt::Write as _;

use super::{ClusterId, align::AlignedStackings, limits::SlotLimits};
use crate::{optics::ResinId, search::ResinLimit};

/// Depths of all layers over a map.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightFields {
    /// Samples per row.
    pub width: usize,
    /// Rows, the first on top.
    pub height: usize,
    /// Resin of each layer of the sequence, top first.
    pub sequence: Vec<ResinId>,
    /// Depth at which each layer ends, mm, `[layer][row][column]`; a layer that ends where the one above it does is not
    /// there.
    pub bottoms_mm: Vec<f32>,
}

impl HeightFields {
    /// The layers of `stackings` over a map of `labels` (row 0 on top, `columns` a row), `parts` × `parts` samples per
    /// texel.
    pub fn new(
        stackings: &AlignedStackings,
        limits: &[ResinLimit],
        labels: &[ClusterId],
        columns: usize,
        parts: usize,
    ) -> Self {
        let (layers, rows) = (stackings.sequence.len(), labels.len() / columns.max(1));
        let (width, height) = (columns * parts, rows * parts);
        let table = stackings.bottoms();
        let limits = SlotLimits::new(&stackings.sequence, limits);
        let mut bottoms_mm = vec![0.0; layers * width * height];
        let mut row = vec![0.0_f32; layers];
        for y in 0..height {
            for x in 0..width {
                let (across, down) = (between(x, parts, columns), between(y, parts, rows));
                row.fill(0.0);
                for (texel_y, share_y) in down {
                    for (texel_x, share_x) in across {
                        let label = labels[texel_y * columns + texel_x].index();
                        let bottoms = &table[label * layers..(label + 1) * layers];
                        let share = share_x * share_y;
                        row.iter_mut().zip(bottoms).for_each(|(sum, bottom)| *sum += share * *bottom as f32);
                    }
                }
                limits.enforce(&mut row);
                for (layer, &bottom) in row.iter().enumerate() {
                    bottoms_mm[(layer * height + y) * width + x] = bottom;
                }
            }
        }
        Self { width, height, sequence: stackings.sequence.clone(), bottoms_mm }
    }

    /// Depths at which one layer ends, mm, row by row.
    pub fn layer(&self, layer: usize) -> &[f32] {
        &self.bottoms_mm[layer * self.width * self.height..(layer + 1) * self.width * self.height]
    }

    /// Depth at which everything has ended, mm.
    pub fn thickness_mm(&self) -> f32 {
        self.bottoms_mm.iter().copied().fold(0.0, f32::max)
    }

    /// One layer's depths in whole steps of `step_mm`, for 16-bit images.
    pub fn levels(&self, layer: usize, step_mm: f64) -> Vec<u16> {
        self.layer(layer).iter().map(|depth| (f64::from(*depth) / step_mm).round() as u16).collect() // `as` saturates
    }

    /// The surfaces at which layers end as a Wavefront OBJ, one object a layer named after its resin, z = −depth,
    /// `pitch_mm` apart along x and y, the bottom left sample at the origin.
    pub fn obj(&self, pitch_mm: [f64; 2], resins: &[String]) -> String {
        let mut text = String::from("# lower ends of layers, mm; z is minus depth\n");
        for (layer, resin) in self.sequence.iter().enumerate() {
            let name = resins.get(resin.0).map_or("resin", String::as_str);
            let _ = writeln!(text, "o {layer:02}_{name}"); // writing to a String cannot fail
            for (index, depth) in self.layer(layer).iter().enumerate() {
                let (x, y) = (index % self.width, self.height - 1 - index / self.width);
                let _ = writeln!(text, "v {:.5} {:.5} {:.5}", x as f64 * pitch_mm[0], y as f64 * pitch_mm[1], -depth);
            }
            let first = 1 + layer * self.width * self.height;
            for y in 0..self.height.saturating_sub(1) {
                for x in 0..self.width.saturating_sub(1) {
                    // Rows run downwards: this order faces up.
                    let (a, b) = (first + y * self.width + x, first + (y + 1) * self.width + x);
                    let _ = writeln!(text, "f {b} {} {} {a}", b + 1, a + 1);
                }
            }
        }
        text
    }
}

/// The two texels a sample lies between, and their shares; at the border twice the last one.
fn between(sample: usize, parts: usize, texels: usize) -> [(usize, f32); 2] {
    let at = (sample as f32 + 0.5) / parts as f32 - 0.5;
    let low = at.floor();
    let share = at - low;
    let texel = |index: f32| (index.max(0.0) as usize).min(texels - 1);
    [(texel(low), 1.0 - share), (texel(low + 1.0), share)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{appearance::align, optics::Stack};

    fn aligned() -> AlignedStackings {
        let stack = |layers: &[(usize, f64)]| Stack::new(layers.iter().map(|&(resin, mm)| (ResinId(resin), mm)));
        align(&[stack(&[(0, 0.2), (1, 2.0)]), stack(&[(2, 1.0)]), stack(&[(0, 1.0), (2, 0.5)])])
    }

    #[test]
    fn texels_keep_their_stackings() {
        let stackings = aligned();
        let labels = [0, 1, 2, 2, 1, 0].map(ClusterId);
        let fields = HeightFields::new(&stackings, &[], &labels, 3, 1);
        assert_eq!((fields.width, fields.height), (3, 2));
        let layers = fields.sequence.len();
        for (texel, label) in labels.iter().enumerate() {
            let truth = &stackings.bottoms()[label.index() * layers..][..layers];
            for (layer, truth) in truth.iter().enumerate() {
                assert!((f64::from(fields.layer(layer)[texel]) - truth).abs() < 1e-6);
            }
        }
        assert_eq!(fields.thickness_mm(), 2.2);
    }

    /// Between two texels depths go from one to the other evenly, and no layer ends above the one before it.
    #[test]
    fn between_texels_depths_are_interpolated() {
        let fields = HeightFields::new(&aligned(), &[], &[0, 1].map(ClusterId), 2, 8);
        for layer in 0..fields.sequence.len() {
            let row = &fields.layer(layer)[..16];
            let steps: Vec<f32> = row[4..12].windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(steps.iter().all(|step| (step - steps[0]).abs() < 1e-5), "{row:?}");
            assert!(
                row[..4].iter().all(|depth| (depth - row[0]).abs() < 1e-6),
                "beyond the outer centres nothing changes"
            );
            assert!(layer == 0 || fields.layer(layer - 1).iter().zip(fields.layer(layer)).all(|(a, b)| a <= b));
        }
    }

    #[test]
    fn limits_hold_between_texels() {
        let limit = ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE };
        let limits = [ResinLimit::NONE, limit, ResinLimit::NONE];
        let fields = HeightFields::new(&aligned(), &limits, &[0, 1].map(ClusterId), 2, 16);
        for sample in 0..fields.width {
            let mut top = 0.0;
            for (layer, resin) in fields.sequence.iter().enumerate() {
                let bottom = fields.layer(layer)[sample];
                assert!(
                    *resin != ResinId(1) || bottom <= top || top >= 0.2 - 1e-3,
                    "sample {sample}: support starts at {top}"
                );
                top = bottom;
            }
        }
    }

    #[test]
    fn surfaces_have_a_vertex_per_sample_and_face_up() {
        let fields = HeightFields::new(&aligned(), &[], &[0, 1, 2, 1].map(ClusterId), 2, 1);
        let names = ["white", "support", "black"].map(String::from);
        let text = fields.obj([0.5, 0.5], &names);
        let (vertices, faces): (Vec<_>, Vec<_>) =
            text.lines().filter(|line| line.starts_with(['v', 'f'])).partition(|line| line.starts_with('v'));
        let layers = fields.sequence.len();
        assert_eq!((vertices.len(), faces.len()), (4 * layers, layers));
        let point = |index: &str| -> Vec<f64> {
            let line = vertices[index.parse::<usize>().unwrap() - 1];
            line.split(' ').skip(1).map(|value| value.parse().unwrap()).collect()
        };
        let corners: Vec<Vec<f64>> = faces[0].split(' ').skip(1).map(point).collect();
        let (a, b) = ([0, 1].map(|i| corners[1][i] - corners[0][i]), [0, 1].map(|i| corners[2][i] - corners[0][i]));
        assert!(a[0] * b[1] - a[1] * b[0] > 0.0);
        assert_eq!(fields.levels(0, 1e-3)[0], 200);
    }
}
