//! What of every resin there is in a voxel, before masks decide for one.
//!
//! A voxel below a surface point lies in one layer, or where boundaries are dithered in several: with a share s(b) of it
//! above the boundary at depth b, the layer from a to b has s(b) − s(a) of it. A mixture's part is its resins' by their
//! shares, which between texels are means of amounts, as in [`super::blends`]. Nothing here is drawn by lot, so the
//! fractions are what the share of each resin among many voxels at that place would be.

use glam::Vec2;

use super::{
    blends::BlendTable,
    filling::{Blend, Filling},
    layers::{LayerField, LayerStack},
    slots::SlotTable,
    textured::{Footprint, TexturedLayers},
};
use crate::voxel::Weights;

impl LayerField {
    /// Adds the resins of a voxel below the surface point with texture coordinates `uv` on triangle `triangle`, whose
    /// shares sum to 1; `above` is the share of the voxel that lies above a depth in mm, which never falls with it.
    pub fn weigh(&self, triangle: u32, uv: Vec2, above: impl Fn(f64) -> f64, weights: &mut Weights) {
        match self {
            Self::Uniform(stack) => stack.weigh(above, weights),
            Self::Textured(layers) => layers.weigh(triangle, uv, above, weights),
        }
    }

    /// Adds the resins of a filling.
    pub fn weigh_filling(&self, filling: Filling, weights: &mut Weights) {
        match filling {
            Filling::Pure(id) => weights.add(id, 1.0),
            Filling::Mixed(blend) => self.blend(blend).weigh(1.0, weights),
        }
    }
}

impl Blend {
    /// Adds `share` of the resins.
    fn weigh(&self, share: f64, weights: &mut Weights) {
        self.shares().for_each(|(id, of_blend)| weights.add(id, share * of_blend));
    }
}

impl LayerStack {
    fn weigh(&self, above: impl Fn(f64) -> f64, weights: &mut Weights) {
        let mut covered = 0.0;
        for &(bottom, filling) in &self.layers {
            let share = above(bottom) - covered;
            match filling {
                Filling::Pure(id) => weights.add(id, share),
                Filling::Mixed(blend) => self.blends[usize::from(blend)].weigh(share, weights),
            }
            covered += share.max(0.0);
            if covered >= 1.0 {
                return;
            }
        }
        weights.add(self.core, 1.0 - covered);
    }
}

impl TexturedLayers {
    fn weigh(&self, triangle: u32, uv: Vec2, above: impl Fn(f64) -> f64, weights: &mut Weights) {
        let footprint = self.footprint(triangle, uv.x, uv.y);
        let mut scratch = [0.0; SlotTable::MAX_STRIDE];
        let bottoms = self.slots.row(&mut scratch, &footprint, 0.0);
        let mut covered = 0.0;
        for (slot, &bottom) in bottoms[..self.slots.slots()].iter().enumerate() {
            let share = above(f64::from(bottom)) - covered;
            if share <= 0.0 {
                continue;
            }
            match self.slots.place(slot) {
                None => weights.add(self.slots.ids()[slot], share),
                Some(place) => self.slots.mixed()[place].weigh(&footprint, share, weights),
            }
            covered += share;
            if covered >= 1.0 {
                return;
            }
        }
        weights.add(self.slots.core(), 1.0 - covered);
    }
}

impl BlendTable {
    /// Adds `share` of the resins where the texels of `footprint` meet.
    fn weigh(&self, footprint: &Footprint, share: f64, weights: &mut Weights) {
        let count = self.ids().len();
        let rows = footprint.labels.map(|label| &self.amounts[usize::from(label) * count..][..count]);
        let mean = |resin: usize| f64::from(footprint.mean(rows.map(|row| row[resin])));
        let thickness = mean(count - 1);
        let mut covered = 0.0;
        for (resin, &id) in self.ids().iter().enumerate() {
            // Of a slot that is only there by its limits a voxel gets the last resin, whatever its rank.
            let level = if resin + 1 == count { 1.0 } else { (mean(resin) / thickness).clamp(covered, 1.0) };
            if level > covered {
                weights.add(id, share * (level - covered));
                covered = level;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::MaterialId;

    const WHITE: MaterialId = MaterialId(1);
    const BLACK: MaterialId = MaterialId(2);
    const CORE: MaterialId = MaterialId(3);

    fn weighed(above: impl Fn(f64) -> f64) -> Vec<(MaterialId, u16)> {
        let grey = vec![(WHITE, 0.9), (BLACK, 0.1)];
        let layers = [(vec![(WHITE, 1.0)], 0.5), (grey, 0.3), (vec![(BLACK, 1.0)], 0.0)];
        let field = LayerField::Uniform(LayerStack::with_mixtures(layers, CORE));
        let (mut weights, mut parts) = (Weights::default(), Vec::new());
        field.weigh(0, Vec2::ZERO, above, &mut weights);
        weights.round(&mut parts);
        parts
    }

    #[test]
    fn a_voxel_in_one_layer_has_what_the_layer_has() {
        let at = |depth: f64| weighed(move |bottom| f64::from(u8::from(depth < bottom)));
        assert_eq!(at(0.4999), [(WHITE, 10_000)]);
        assert_eq!(at(0.5), [(WHITE, 9000), (BLACK, 1000)]);
        assert_eq!(at(0.8), [(CORE, 10_000)]);
    }

    #[test]
    fn a_voxel_across_boundaries_has_of_each_layer_what_lies_in_it() {
        // From 0.4 to 0.9 mm: a fifth white, three of the mixture, a fifth core; none of the layer of no thickness.
        let found = weighed(|bottom| ((bottom - 0.4) / 0.5).clamp(0.0, 1.0));
        assert_eq!(found, [(WHITE, 7400), (BLACK, 600), (CORE, 2000)]);
    }
}
