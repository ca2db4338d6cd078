//! Textures from files, in linear light: by what a PNG says of its numbers, and else as sRGB.

use std::{fs::File, io::BufReader, path::Path};

use image::{DynamicImage, ImageReader};

use crate::appearance::ClusterId;
use crate::colour::{byte_to_linear, srgb_to_linear};
use crate::job::RunError;
use crate::mesh::fill_holes;
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
    coding: Coding,
    /// Texels that are wholly transparent: they have the values of the nearest texel that is not, unless none is.
    pub unseen: usize,
}

/// What a file says of the numbers in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coding {
    /// Nothing.
    Unsaid,
    /// They are sRGB.
    Srgb,
    /// They are powers of light by this exponent.
    Gamma(f32),
    /// A colour profile says it that is not sRGB's, and that is not read.
    Profile,
}

/// The exponent that stands for sRGB's curve, and how far others may be from it, or from 1, to be the same.
const SRGB_GAMMA: f32 = 1.0 / 2.2;
const SAME_GAMMA: f32 = 0.02;
/// Exponents below this, and above what it is the inverse of, are of no camera, screen or program.
const LEAST_GAMMA: f32 = 0.2;

impl Coding {
    /// What a PNG says, of its profile, its mark and its exponent by the first there is; other files say nothing.
    pub fn of(path: &Path) -> Self {
        let Ok(file) = File::open(path) else { return Self::Unsaid };
        let Ok(reader) = png::Decoder::new(BufReader::new(file)).read_info() else { return Self::Unsaid };
        let info = reader.info();
        if let Some(profile) = &info.icc_profile {
            let wide: Vec<u8> = "sRGB".bytes().flat_map(|letter| [0, letter]).collect();
            let names = |name: &[u8]| profile.windows(name.len()).any(|bytes| bytes == name);
            return if names(b"sRGB") || names(&wide) { Self::Srgb } else { Self::Profile };
        }
        match (info.srgb, info.gama_chunk) {
            (Some(_), _) => Self::Srgb,
            (None, Some(gamma)) => Self::of_gamma(gamma.into_value()),
            (None, None) => Self::Unsaid,
        }
    }

    fn of_gamma(gamma: f32) -> Self {
        match gamma {
            _ if (gamma - SRGB_GAMMA).abs() < SAME_GAMMA => Self::Srgb,
            // No curve that anyone means.
            _ if !(LEAST_GAMMA..=1.0 / LEAST_GAMMA).contains(&gamma) => Self::Unsaid,
            _ => Self::Gamma(gamma),
        }
    }

    /// Whether they are light itself, or nothing says that they are not.
    pub fn may_be_linear(self) -> bool {
        match self {
            Self::Unsaid => true,
            Self::Gamma(gamma) => (gamma - 1.0).abs() < SAME_GAMMA,
            Self::Srgb | Self::Profile => false,
        }
    }

    /// What a file says, in words.
    pub fn words(self) -> String {
        match self {
            Self::Unsaid => "numbers of which nothing is said".to_owned(),
            Self::Srgb => "numbers that are marked as sRGB".to_owned(),
            Self::Gamma(gamma) => format!("numbers that are marked as light to the power of {gamma}"),
            Self::Profile => "a colour profile other than sRGB".to_owned(),
        }
    }
}

/// Red, green, blue per texel.
#[derive(Debug)]
enum Texels {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
}

/// Reads an image. What colour wholly transparent texels have is no viewer's: they take that of the nearest others;
/// half of transparency is ignored.
pub fn read_picture(path: &Path) -> Result<Picture, RunError> {
    let image = open(path)?;
    let (width, height) = (image.width(), image.height());
    let unseen: Vec<bool> = match &image {
        DynamicImage::ImageLumaA8(image) => image.pixels().map(|texel| texel.0[1] == 0).collect(),
        DynamicImage::ImageRgba8(image) => image.pixels().map(|texel| texel.0[3] == 0).collect(),
        DynamicImage::ImageLumaA16(image) => image.pixels().map(|texel| texel.0[1] == 0).collect(),
        DynamicImage::ImageRgba16(image) => image.pixels().map(|texel| texel.0[3] == 0).collect(),
        _ => Vec::new(),
    };
    let mut texels = match image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => Texels::Bytes(image.into_rgb8().into_raw()),
        _ => Texels::Words(image.into_rgb16().into_raw()),
    };
    let count = unseen.iter().filter(|&&unseen| unseen).count();
    if count > 0 && count < unseen.len() {
        match &mut texels {
            Texels::Bytes(bytes) => fill_holes(bytes.as_chunks_mut::<3>().0, [width, height], &unseen),
            Texels::Words(words) => fill_holes(words.as_chunks_mut::<3>().0, [width, height], &unseen),
        }
    }
    Ok(Picture { width, height, texels, coding: Coding::of(path), unseen: count })
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
    let reader = reader(path)?;
    if reader.format().is_none() {
        return Err(fault(path, "something else".to_owned()));
    }
    let size = reader.into_dimensions();
    let (width, height) = size.map_err(|error| fault(path, one_line(error)))?;
    if u64::from(width) * u64::from(height) > MAX_TEXELS {
        return Err(fault(path, format!("{width} × {height} texels, over the limit of {MAX_TEXELS}")));
    }
    Ok((width, height))
}

fn fault(path: &Path, found: String) -> RunError {
    RunError::Texture { path: path.to_path_buf(), found, expected: "a PNG or JPEG image" }
}

/// A reader of what the file holds, whatever its name says.
fn reader(path: &Path) -> Result<ImageReader<BufReader<File>>, RunError> {
    let opened = File::open(path).and_then(|file| ImageReader::new(BufReader::new(file)).with_guessed_format());
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

    /// The same as linear light: by the exponent that the file says, else as sRGB.
    pub fn light(&self, u: f32, v: f32) -> [f32; 3] {
        match (&self.texels, self.coding) {
            (_, Coding::Gamma(gamma)) => self.nearest(u, v).map(|value| libm::powf(value, 1.0 / gamma)),
            (Texels::Bytes(bytes), _) => {
                let texel = self.texel(u, v);
                std::array::from_fn(|c| byte_to_linear(bytes[texel + c]))
            }
            (Texels::Words(_), _) => self.nearest(u, v).map(srgb_to_linear),
        }
    }

    /// Texels of which a channel is 0.
    pub fn zeros(&self) -> usize {
        fn zeros<T: PartialEq + Default>(texels: &[T]) -> usize {
            texels.chunks_exact(3).filter(|rgb| rgb.contains(&T::default())).count()
        }
        match &self.texels {
            Texels::Bytes(bytes) => zeros(bytes),
            Texels::Words(words) => zeros(words),
        }
    }

    /// Whether all channels are 0 everywhere.
    pub fn is_black(&self) -> bool {
        match &self.texels {
            Texels::Bytes(bytes) => bytes.iter().all(|value| *value == 0),
            Texels::Words(words) => words.iter().all(|value| *value == 0),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, color: png::ColorType, gamma: Option<u32>, texels: &[u8]) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("lumislice-images-{}-{name}", std::process::id()));
        let mut encoder = png::Encoder::new(File::create(&path).unwrap(), 2, 1);
        encoder.set_color(color);
        if let Some(gamma) = gamma {
            encoder.set_source_gamma(png::ScaledFloat::from_scaled(gamma));
        }
        encoder.write_header().unwrap().write_image_data(texels).unwrap();
        path
    }

    #[test]
    fn light_goes_by_what_the_file_says() {
        let light = |name: &str, gamma: Option<u32>| {
            let path = written(name, png::ColorType::Grayscale, gamma, &[128, 255]);
            let found = (read_picture(&path).unwrap().light(0.1, 0.5)[0], Coding::of(&path));
            std::fs::remove_file(path).unwrap();
            found
        };
        let srgb = byte_to_linear(128);
        assert_eq!(light("unsaid.png", None), (srgb, Coding::Unsaid));
        assert_eq!(light("curve.png", Some(45_455)), (srgb, Coding::Srgb));
        assert_eq!(light("linear.png", Some(100_000)), (128.0 / 255.0, Coding::Gamma(1.0)));
        let (square, coding) = light("square.png", Some(50_000));
        assert!((square - (128.0_f32 / 255.0).powi(2)).abs() < 1e-6 && coding == Coding::Gamma(0.5), "{square}");
        assert!(Coding::Gamma(1.0).may_be_linear() && Coding::Unsaid.may_be_linear());
        assert!(!Coding::Srgb.may_be_linear() && !Coding::Profile.may_be_linear());
    }

    #[test]
    fn what_no_one_sees_takes_the_nearest_values() {
        let path = written("alpha.png", png::ColorType::Rgba, None, &[200, 100, 50, 255, 1, 2, 3, 0]);
        let picture = read_picture(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        assert_eq!((picture.unseen, picture.light(0.9, 0.5)), (1, picture.light(0.1, 0.5)));
        assert_eq!(picture.light(0.9, 0.5)[0], byte_to_linear(200));
    }
}
