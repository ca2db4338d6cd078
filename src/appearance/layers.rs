//! The material at a surface point and a depth.
//!
//! A layer owns depth in [top, bottom); below the last one lies the core. A layer is of one resin, or of several that
//! share its voxels out by their ranks in a [mask](crate::voxel::ThresholdMask).

use glam::Vec2;

use super::{
    filling::{Blend, Filling},
    textured::TexturedLayers,
};
use crate::{
    sdf::{BrickSurface, DepthRange},
    voxel::{BRICK_VOXELS, MaterialId},
};

/// The layers of one object: what lies at every surface point and depth.
#[derive(Debug, Clone)]
pub enum LayerField {
    /// The same layers everywhere.
    Uniform(LayerStack),
    /// Layers that vary from texel to texel.
    Textured(Box<TexturedLayers>),
}

/// One of the texels around a surface point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceShare {
    /// Which texel, counted through the pages of the atlas; 0 where layers are the same everywhere.
    pub texel: usize,
    /// Label of its stacking.
    pub stacking: u16,
    /// Its share in the point, 0 to 1.
    pub share: f32,
}

/// What a brick asks its layer field about.
#[derive(Debug, Clone, Copy)]
pub struct BrickQuery<'a> {
    /// The nearest surface point of every voxel.
    pub surface: &'a BrickSurface,
    /// The triangles `surface.candidate` counts.
    pub candidates: &'a [u32],
    /// The voxels that want an answer: bit x of byte y + 8z.
    pub mask: &'a [u8; BRICK_VOXELS / 8],
    /// The voxels' ranks, which decide in mixtures.
    pub ranks: &'a [u16; BRICK_VOXELS],
}

impl LayerField {
    /// Depth from which on there is only core, mm.
    pub fn thickness(&self) -> f64 {
        match self {
            Self::Uniform(stack) => stack.thickness(),
            Self::Textured(layers) => layers.thickness(),
        }
    }

    /// What fills the inside below all layers.
    pub fn core(&self) -> MaterialId {
        match self {
            Self::Uniform(stack) => stack.core,
            Self::Textured(layers) => layers.core(),
        }
    }

    /// Who shares in the layers of the surface point with texture coordinates `uv` on triangle `triangle`; the shares
    /// sum to 1.
    pub fn shares(&self, triangle: u32, uv: Vec2) -> [SurfaceShare; 4] {
        match self {
            Self::Uniform(_) => {
                std::array::from_fn(|n| SurfaceShare { texel: 0, stacking: 0, share: if n == 0 { 1.0 } else { 0.0 } })
            }
            Self::Textured(layers) => {
                let (texels, weights) = layers.texels_around(triangle, uv.x, uv.y);
                std::array::from_fn(|n| SurfaceShare {
                    texel: texels[n],
                    stacking: layers.label(texels[n]),
                    share: weights[n],
                })
            }
        }
    }

    /// Whether materials depend on texture coordinates.
    pub fn needs_uv(&self) -> bool {
        matches!(self, Self::Textured(_))
    }

    /// Whether some layers are mixtures.
    pub fn is_mixed(&self) -> bool {
        match self {
            Self::Uniform(stack) => !stack.blends.is_empty(),
            Self::Textured(layers) => layers.is_mixed(),
        }
    }

    /// What [`Filling::Mixed`] of these layers stands for.
    pub fn blend(&self, blend: u16) -> &Blend {
        match self {
            Self::Uniform(stack) => &stack.blends[usize::from(blend)],
            Self::Textured(layers) => layers.blend(blend),
        }
    }

    /// The one filling of all depths in `range` under all of `triangles`, if there is one for certain.
    pub fn uniform_over(&self, triangles: &[u32], range: DepthRange) -> Option<Filling> {
        match self {
            Self::Uniform(stack) => stack.uniform_over(range),
            Self::Textured(layers) => layers.uniform_over(triangles, range),
        }
    }

    /// The material of every slot that [`Self::bottoms`] bounds, from the surface inwards, then the core's; of a
    /// mixture the resin there is most of.
    pub fn slot_ids(&self) -> Vec<MaterialId> {
        match self {
            Self::Uniform(stack) => {
                let mostly = |layer: &(f64, Filling)| stack.mostly(layer.1);
                stack.layers.iter().map(mostly).chain([stack.core]).collect()
            }
            Self::Textured(layers) => layers.slot_ids().to_vec(),
        }
    }

    /// Replaces `row` by the depths (mm, ascending) at which the slots end below the surface point with texture
    /// coordinates `uv` on triangle `triangle`. A slot that ends where the one above it does is not there.
    pub fn bottoms(&self, triangle: u32, uv: Vec2, row: &mut Vec<f32>) {
        match self {
            Self::Uniform(stack) => {
                row.clear();
                row.extend(stack.layers.iter().map(|layer| layer.0 as f32));
            }
            Self::Textured(layers) => layers.bottoms(triangle, uv, row),
        }
    }

    /// Writes the materials of the masked voxels of a brick, and of no others; `exact` gives a voxel's depth in double
    /// precision, `uv` the texture coordinates of its nearest point on a candidate.
    pub fn fill_brick(
        &self,
        query: BrickQuery<'_>,
        exact: impl Fn(usize) -> f64,
        uv: impl FnMut(u32, usize) -> Vec2,
        out: &mut [u8; BRICK_VOXELS],
    ) {
        match self {
            Self::Uniform(stack) => stack.fill_brick(query, exact, out),
            Self::Textured(layers) => layers.fill_brick(query, uv, out),
        }
    }
}

/// Layers from the surface inwards, the same everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerStack {
    /// Depth at which each layer ends, mm, ascending, with its filling.
    pub(super) layers: Vec<(f64, Filling)>,
    pub(super) core: MaterialId,
    pub(super) blends: Vec<Blend>,
}

impl LayerStack {
    /// Layers given by material and thickness (mm) over `core`.
    pub fn new(layers: impl IntoIterator<Item = (MaterialId, f64)>, core: MaterialId) -> Self {
        Self::with_mixtures(layers.into_iter().map(|(id, thickness)| (vec![(id, 1.0)], thickness)), core)
    }

    /// Layers given by materials with their shares of the volume and thickness (mm) over `core`.
    pub fn with_mixtures(layers: impl IntoIterator<Item = (Vec<(MaterialId, f64)>, f64)>, core: MaterialId) -> Self {
        let (mut bottom, mut blends) = (0.0, Vec::new());
        let layers = layers.into_iter().map(|(parts, thickness)| {
            bottom += thickness;
            let filling = if let [(id, _)] = parts[..] {
                Filling::Pure(id)
            } else {
                blends.push(Blend::new(parts));
                Filling::Mixed((blends.len() - 1) as u16)
            };
            (bottom, filling)
        });
        Self { layers: layers.collect(), core, blends }
    }

    /// What there is at `depth` mm ≥ 0.
    pub fn filling(&self, depth: f64) -> Filling {
        let layer = self.layers.iter().find(|(bottom, _)| depth < *bottom);
        layer.map_or(Filling::Pure(self.core), |(_, filling)| *filling)
    }

    /// The material at `depth` mm ≥ 0, in a mixture of a voxel of rank `rank` of its
    /// [mask](crate::voxel::ThresholdMask).
    pub fn material(&self, depth: f64, rank: u16) -> MaterialId {
        match self.filling(depth) {
            Filling::Pure(id) => id,
            Filling::Mixed(blend) => self.blends[usize::from(blend)].at(rank),
        }
    }

    /// Depth from which on there is only core, mm.
    pub fn thickness(&self) -> f64 {
        self.layers.last().map_or(0.0, |(bottom, _)| *bottom)
    }

    fn mostly(&self, filling: Filling) -> MaterialId {
        match filling {
            Filling::Pure(id) => id,
            Filling::Mixed(blend) => self.blends[usize::from(blend)].mostly(),
        }
    }

    fn uniform_over(&self, range: DepthRange) -> Option<Filling> {
        let split = self.layers.iter().any(|(bottom, _)| range.min < *bottom && *bottom <= range.max);
        (!split).then(|| self.filling(range.min))
    }

    fn fill_brick(&self, query: BrickQuery<'_>, exact: impl Fn(usize) -> f64, out: &mut [u8; BRICK_VOXELS]) {
        let error = f64::from(query.surface.error);
        let mut ids = [self.core.0; BRICK_VOXELS];
        let mut layer = [0; BRICK_VOXELS];
        let mut unsure = [false; BRICK_VOXELS];
        for &(bottom, filling) in self.layers.iter().rev() {
            let (sure, maybe) = ((bottom - error) as f32, (bottom + error) as f32);
            let depths = &query.surface.distance;
            match filling {
                Filling::Pure(id) => {
                    for voxel in 0..BRICK_VOXELS {
                        ids[voxel] = if depths[voxel] < sure { id.0 } else { ids[voxel] };
                        unsure[voxel] |= depths[voxel] >= sure && depths[voxel] <= maybe;
                    }
                }
                Filling::Mixed(blend) => {
                    self.blends[usize::from(blend)].lay(query.ranks, &mut layer);
                    for voxel in 0..BRICK_VOXELS {
                        ids[voxel] = if depths[voxel] < sure { layer[voxel] } else { ids[voxel] };
                        unsure[voxel] |= depths[voxel] >= sure && depths[voxel] <= maybe;
                    }
                }
            }
        }
        for voxel in 0..BRICK_VOXELS {
            if query.mask[voxel / 8] >> (voxel % 8) & 1 != 0 {
                let decided = || self.material(exact(voxel), query.ranks[voxel]).0;
                out[voxel] = if unsure[voxel] { decided() } else { ids[voxel] };
            }
        }
    }
}
