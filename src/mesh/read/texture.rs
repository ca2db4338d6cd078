//! Images of textures: PNG and JPEG to 8-bit RGBA.

use std::io::Cursor;
use std::sync::Arc;

use image::ImageReader;

use crate::mesh::Texture;
use crate::words::{counted, one_line};

/// Longest side of a texture; an image header may claim any size, and 16k squared already takes 1 GiB.
const MAX_SIDE: u32 = 16_384;

/// Decodes an image, or says in a phrase why it cannot.
pub(super) fn decode(bytes: &[u8]) -> Result<Arc<Texture>, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(one_line)?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(4 * u64::from(MAX_SIDE) * u64::from(MAX_SIDE));
    reader.limits(limits);
    let image = reader.decode().map_err(one_line)?.into_rgba8();
    let (width, height) = image.dimensions();
    let texels = image.pixels().map(|p| p.0).collect();
    Ok(Arc::new(Texture { width, height, texels }))
}

/// The texture with what its own alpha cuts out, texels of alpha 0, in the colour of the nearest texel left: what
/// colour they have is no viewer's. Says so in a sentence about `name`; what is cut out whole stays as it is.
pub(super) fn without_holes(texture: Arc<Texture>, name: &str) -> (Arc<Texture>, Option<String>) {
    let cut: Vec<bool> = texture.texels.iter().map(|texel| texel[3] == 0).collect();
    let count = cut.iter().filter(|&&cut| cut).count();
    if count == 0 {
        return (texture, None);
    }
    if count == cut.len() {
        let told = format!("{name} is wholly transparent; its surface is printed in its colours all the same");
        return (texture, Some(told));
    }
    let (texels, verb) = (counted(count, "texel"), if count == 1 { "is" } else { "are" });
    let told = format!(
        "{texels} of {name} {verb} cut out (alpha 0): the surface stays, in the colour of the nearest texel left"
    );
    (Arc::new(filled(&texture, &cut)), Some(told))
}

/// The texture with each texel that is `cut` out replaced by the nearest one left.
pub(super) fn filled(texture: &Texture, cut: &[bool]) -> Texture {
    let mut texels = texture.texels.clone();
    fill_holes(&mut texels, [texture.width, texture.height], cut);
    Texture { width: texture.width, height: texture.height, texels }
}

/// Replaces each texel that is `cut` out by the nearest one left, in steps over edges; the texture repeats.
pub(crate) fn fill_holes<T: Copy>(texels: &mut [T], size: [u32; 2], cut: &[bool]) {
    let [width, height] = size.map(|side| side as usize);
    let mut known: Vec<bool> = cut.iter().map(|cut| !cut).collect();
    let mut front: Vec<usize> = (0..known.len()).filter(|&i| known[i]).collect();
    let mut next = Vec::new();
    while !front.is_empty() {
        for &texel in &front {
            let (x, y) = (texel % width, texel / width);
            let row = |y: usize| y % height * width;
            let beside = [row(y) + (x + width - 1) % width, row(y) + (x + 1) % width];
            for neighbour in beside.into_iter().chain([row(y + height - 1) + x, row(y + 1) + x]) {
                if !std::mem::replace(&mut known[neighbour], true) {
                    texels[neighbour] = texels[texel];
                    next.push(neighbour);
                }
            }
        }
        front.clear();
        std::mem::swap(&mut front, &mut next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_take_the_nearest_texel() {
        let texels = [1, 0, 0, 0, 2, 0].map(|v| [v; 4]).to_vec();
        let cut: Vec<bool> = texels.iter().map(|texel| texel[0] == 0).collect();
        let filled = filled(&Texture { width: 6, height: 1, texels }, &cut);
        assert_eq!(filled.texels.iter().map(|texel| texel[0]).collect::<Vec<_>>(), [1, 1, 1, 2, 2, 1]);
    }
}
