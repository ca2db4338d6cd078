//! Images of textures: PNG and JPEG to 8-bit RGBA.

use std::io::Cursor;
use std::sync::Arc;

use image::ImageReader;

use crate::mesh::Texture;
use crate::words::one_line;

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
