//! Where the texels of triangles lie: blocks, packed on the pages of new textures.

use std::sync::Arc;

use glam::Vec2;

use super::Detail;
use crate::mesh::{Projected, SurfaceMaterial, Texture};

/// Longest side of a texture: texel centres of a power of two are exact in single precision.
const MAX_PAGE: usize = 4096;
/// Texels around a block, on each side.
const GUTTER: usize = 1;

/// The texels of one triangle.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub(super) triangle: usize,
    /// Corners of the triangle: on the block's corner, along x, along y.
    pub(super) order: [usize; 3],
    pub(super) size: [usize; 2],
    pub(super) page: usize,
    /// First texel on the page.
    pub(super) corner: [usize; 2],
}

impl Block {
    /// Texels it takes, those around it included.
    pub(super) fn room(&self) -> usize {
        self.size.map(|side| side + 2 * GUTTER).iter().product()
    }

    /// Texture coordinates of the triangle's corners, on texel centres.
    pub(super) fn uvs(&self, page: &Page) -> [Vec2; 3] {
        let at = |x: usize, y: usize| {
            let texel = Vec2::new((self.corner[0] + x) as f32 + 0.5, (self.corner[1] + y) as f32 + 0.5);
            texel / Vec2::new(page.size[0] as f32, page.size[1] as f32)
        };
        let mut uvs = [at(0, 0); 3];
        uvs[self.order[1]] = at(self.size[0] - 1, 0);
        uvs[self.order[2]] = at(0, self.size[1] - 1);
        uvs
    }
}

/// Gives every block its place, on shelves of blocks alike in height; the sizes of the pages come back.
pub(super) fn pack(blocks: &mut [Block]) -> Vec<[usize; 2]> {
    blocks.sort_by_key(|block| (block.size[1], block.size[0], block.triangle));
    let room: usize = blocks.iter().map(Block::room).sum();
    let widest = blocks.iter().map(|block| block.size[0] + 2 * GUTTER).max().unwrap_or(1);
    let width = ((room as f64).sqrt().ceil() as usize).max(widest).next_power_of_two().min(MAX_PAGE);
    let mut pages = Vec::new();
    let ([mut x, mut y], mut shelf) = ([0, 0], 0);
    for block in blocks {
        let size = block.size.map(|side| side + 2 * GUTTER);
        if x + size[0] > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        if y + size[1] > MAX_PAGE {
            pages.push([width, y.next_power_of_two()]);
            (x, y, shelf) = (0, 0, 0);
        }
        block.page = pages.len();
        block.corner = [x + GUTTER, y + GUTTER];
        x += size[0];
        shelf = shelf.max(size[1]);
    }
    pages.push([width, (y + shelf).next_power_of_two()]);
    pages
}

/// A texture being baked.
pub(super) struct Page {
    pub(super) size: [usize; 2],
    pub(super) texels: Vec<[u8; 4]>,
    /// Coordinates before, where they are asked for.
    pub(super) from: Vec<Vec2>,
    /// Where projected images lie, likewise.
    pub(super) projected: Vec<Projected>,
}

impl Page {
    pub(super) fn new(size: [usize; 2], detail: Detail) -> Self {
        let texels = size[0] * size[1];
        let from = if let Detail::Coordinates(_) = detail { vec![Vec2::ZERO; texels] } else { Vec::new() };
        let projected = if let Detail::Projected(_) = detail { vec![Projected::default(); texels] } else { Vec::new() };
        Self { size, texels: vec![[0, 0, 0, 255]; texels], from, projected }
    }

    pub(super) fn finished(self) -> SurfaceMaterial {
        let [width, height] = self.size.map(|side| side as u32);
        SurfaceMaterial {
            base_color_texture: Some(Arc::new(Texture { width, height, texels: self.texels })),
            baked_from: if self.from.is_empty() { None } else { Some(self.from.into()) },
            projected: if self.projected.is_empty() { None } else { Some(self.projected.into()) },
            ..SurfaceMaterial::plain("baked colours", [1.0; 4])
        }
    }
}
