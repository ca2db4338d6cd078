//! Textures from files, in linear light.

use std::path::Path;

use image::{DynamicImage, ImageReader};

use crate::appearance::ClusterId;
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
    /// Red, green, blue per texel.
    pub rgb: Vec<[f32; 3]>,
}

/// Reads an image; transparency is ignored.
pub fn read_picture(path: &Path) -> Result<Picture, RunError> {
    let image = open(path)?;
    let (width, height) = (image.width(), image.height());
    let rgb = match image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => image.to_rgb8().pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect(),
        _ => image.to_rgb16().pixels().map(|p| p.0.map(|v| f32::from(v) / 65535.0)).collect(),
    };
    Ok(Picture { width, height, rgb })
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
    /// The texel that texture coordinates (u, v) in [0, 1) fall into.
    pub fn nearest(&self, u: f32, v: f32) -> [f32; 3] {
        let texel = |at: f32, size: u32| ((at * size as f32) as u32).min(size - 1) as usize;
        self.rgb[texel(u, self.width) + self.width as usize * texel(v, self.height)]
    }
}
