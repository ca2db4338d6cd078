//! Textures from files, in linear light.

use std::path::Path;

use image::{DynamicImage, ImageReader};

use crate::appearance::ClusterId;
use crate::colour::{byte_to_linear, srgb_to_linear};
use crate::job::RunError;
use crate::words::one_line;

/// Most texels of a texture: 16k × 16k.
const MAX_TEXELS: u64 = 1 << 28;

/// An image in memory, values 0 to 1 as stored in the file.
#[derive(Debug)]
pub struct Picture {
    /// Texels per row.
    pub width: u32,
    /// Rows, the first on top.
    pub height: u32,
    /// As the file has them: a texture of 16k × 16k texels is large enough.
    texels: Texels,
}

/// Red, green, blue per texel.
#[derive(Debug)]
enum Texels {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
}

/// Reads an image; transparency is ignored.
pub fn read_picture(path: &Path) -> Result<Picture, RunError> {
    let image = open(path)?;
    let (width, height) = (image.width(), image.height());
    let texels = match image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => Texels::Bytes(image.into_rgb8().into_raw()),
        _ => Texels::Words(image.into_rgb16().into_raw()),
    };
    Ok(Picture { width, height, texels })
}

/// Reads an image of labels: width, height, clusters row by row. Grey of 8 or 16 bits.
pub fn read_labels(path: &Path) -> Result<(u32, u32, Vec<ClusterId>), RunError> {
    let image = open(path)?;
    let (width, height) = (image.width(), image.height());
    let labels: Vec<u16> = match image {
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(u16::from).collect(),
        DynamicImage::ImageLuma16(grey) => grey.into_raw(),
        other => {
            let found = format!("an image of {:?} texels", other.color());
            return Err(RunError::Texture {
                path: path.to_path_buf(),
                found,
                expected: "an 8 or 16-bit grey image of label numbers",
            });
        }
    };
    Ok((width, height, labels.into_iter().map(ClusterId).collect()))
}

/// Texels per row, and rows, of an image that is not too large.
pub fn picture_size(path: &Path) -> Result<(u32, u32), RunError> {
    let size = reader(path)?.into_dimensions();
    let (width, height) = size.map_err(|error| fault(path, one_line(error)))?;
    if u64::from(width) * u64::from(height) > MAX_TEXELS {
        return Err(fault(path, format!("{width} × {height} texels, over the limit of {MAX_TEXELS}")));
    }
    Ok((width, height))
}

fn fault(path: &Path, found: String) -> RunError {
    RunError::Texture { path: path.to_path_buf(), found, expected: "a PNG or JPEG image" }
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>, RunError> {
    let opened = ImageReader::open(path).and_then(|reader| reader.with_guessed_format());
    opened.map_err(|error| fault(path, one_line(error)))
}

fn open(path: &Path) -> Result<DynamicImage, RunError> {
    picture_size(path)?;
    let mut reader = reader(path)?;
    reader.no_limits(); // bounded above
    reader.decode().map_err(|error| fault(path, one_line(error)))
}

impl Picture {
    /// The texel that texture coordinates (u, v) in [0, 1) fall into, as stored.
    pub fn nearest(&self, u: f32, v: f32) -> [f32; 3] {
        let texel = self.texel(u, v);
        match &self.texels {
            Texels::Bytes(bytes) => std::array::from_fn(|c| f32::from(bytes[texel + c]) / 255.0),
            Texels::Words(words) => std::array::from_fn(|c| f32::from(words[texel + c]) / 65535.0),
        }
    }

    /// The same of an sRGB image, as linear light.
    pub fn light(&self, u: f32, v: f32) -> [f32; 3] {
        match &self.texels {
            Texels::Bytes(bytes) => {
                let texel = self.texel(u, v);
                std::array::from_fn(|c| byte_to_linear(bytes[texel + c]))
            }
            Texels::Words(_) => self.nearest(u, v).map(srgb_to_linear),
        }
    }

    fn texel(&self, u: f32, v: f32) -> usize {
        let texel = |at: f32, size: u32| ((at * size as f32) as u32).min(size - 1) as usize;
        3 * (texel(u, self.width) + self.width as usize * texel(v, self.height))
    }

    /// Whether its channels are alike everywhere.
    pub fn is_grey(&self) -> bool {
        fn alike<T: PartialEq>(texels: &[T]) -> bool {
            texels.chunks_exact(3).all(|rgb| rgb[0] == rgb[1] && rgb[1] == rgb[2])
        }
        match &self.texels {
            Texels::Bytes(bytes) => alike(bytes),
            Texels::Words(words) => alike(words),
        }
    }
}
