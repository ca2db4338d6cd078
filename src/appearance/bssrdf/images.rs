//! Responses as a folder of images, one per lit texel: `X_Y.png` or `X_Y.exr` shows the whole patch while the texel in
//! column X, row Y alone is lit. A window of the header's `window` is cut out around it; what lies beyond the image,
//! and texels without an image, are missing. Values are linear: a PNG's white is `full-scale-per-mm2`, an EXR's values
//! count as they are.

use std::{collections::BTreeMap, fs, path::Path};

use image::{DynamicImage, ImageReader};

use super::{
    BssrdfError,
    exr_rows::exr_fault,
    npy::{Element, NpyHeader},
    npz::Scratch,
    responses::Responses,
};
use crate::words::one_line;

/// Cuts the windows out of all images in a folder.
pub(super) fn unpack(
    folder: &Path,
    window: Option<[usize; 2]>,
    full_scale: Option<f64>,
) -> Result<(Responses, NpyHeader), BssrdfError> {
    let fault = |place: String, found: String, expected: &str| BssrdfError::Entry {
        file: folder.to_path_buf(),
        place,
        found,
        expected: expected.into(),
    };
    let Some([width, height]) = window else {
        return Err(fault("window".into(), "none".into(), "window = [columns, rows] in the header"));
    };
    if width % 2 == 0 || height % 2 == 0 {
        return Err(fault("window".into(), format!("[{width}, {height}]"), "odd numbers"));
    }
    let read = |source| BssrdfError::Read { file: folder.to_path_buf(), source };
    let mut images = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let Some(extension) = path.extension().and_then(|extension| extension.to_str()) else { continue };
        if !["png", "exr"].contains(&extension.to_lowercase().as_str()) {
            continue;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let texel = name.split_once('_').and_then(|(x, y)| Some((x.parse::<usize>().ok()?, y.parse::<usize>().ok()?)));
        let Some((x, y)) = texel else {
            return Err(fault("images".into(), format!("{name}.{extension}"), "names X_Y.png or X_Y.exr"));
        };
        images.insert((y, x), path);
    }
    let Some(first) = images.values().next() else {
        return Err(fault("images".into(), "none".into(), "X_Y.png or X_Y.exr, one per lit texel"));
    };
    let shape @ [columns, rows, channels] = Picture::read(first, full_scale)?.shape();
    if let Some((y, x)) = images.keys().find(|(y, x)| *y >= rows || *x >= columns) {
        let expected = format!("texels of the {columns} × {rows} the images show");
        return Err(fault("images".into(), format!("{x}_{y}"), &expected));
    }
    let mut scratch = Scratch::new()?;
    let pixels = width * height;
    let mut values = vec![f32::NAN; channels * pixels];
    for y in 0..rows {
        for x in 0..columns {
            values.fill(f32::NAN);
            if let Some(path) = images.get(&(y, x)) {
                let picture = Picture::read(path, full_scale)?;
                if picture.shape() != shape {
                    let [columns, rows, channels] = picture.shape();
                    let found = format!("{columns} × {rows} pixels of {channels} channels");
                    return Err(fault(format!("{x}_{y}"), found, "the size and channels of the first image"));
                }
                picture.cut([x, y], [width, height], &mut values);
            }
            scratch.write_values(&values)?;
        }
    }
    let header = NpyHeader {
        element: Element::F32,
        big_endian: false,
        shape: vec![rows, columns, channels, height, width],
        start: 0,
    };
    Ok((scratch.responses(header.clone())?, header))
}

/// An image of linear values, `[channel][row][column]`.
struct Picture {
    columns: usize,
    rows: usize,
    planes: Vec<Vec<f32>>,
}

impl Picture {
    fn read(path: &Path, full_scale: Option<f64>) -> Result<Self, BssrdfError> {
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
            return Self::read_exr(path);
        }
        let fault = |found: String, expected: &str| BssrdfError::Entry {
            file: path.to_path_buf(),
            place: "image".into(),
            found,
            expected: expected.into(),
        };
        let Some(scale) = full_scale.filter(|scale| *scale > 0.0 && scale.is_finite()) else {
            return Err(fault("a PNG".into(), "full-scale-per-mm2 in the header, what white stands for"));
        };
        let image = ImageReader::open(path)
            .and_then(|reader| reader.with_guessed_format())
            .map_err(|source| BssrdfError::Read { file: path.to_path_buf(), source })?
            .decode()
            .map_err(|error| fault(one_line(error), "a PNG"))?;
        let (columns, rows) = (image.width() as usize, image.height() as usize);
        let scale = scale as f32;
        let planes = match image {
            DynamicImage::ImageLuma8(_) | DynamicImage::ImageLuma16(_) => {
                vec![image.to_luma16().iter().map(|v| f32::from(*v) / 65535.0 * scale).collect()]
            }
            _ => {
                let rgb = image.to_rgb16();
                (0..3).map(|c| rgb.pixels().map(|p| f32::from(p.0[c]) / 65535.0 * scale).collect()).collect()
            }
        };
        Ok(Self { columns, rows, planes })
    }

    fn read_exr(path: &Path) -> Result<Self, BssrdfError> {
        use exr::prelude::{ReadChannels, ReadLayers, read};
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .map_err(|error| exr_fault(path, error))?;
        let layer = image.layer_data;
        let mut named: Vec<(String, Vec<f32>)> = layer
            .channel_data
            .list
            .iter()
            .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
            .collect();
        if named.iter().map(|(name, _)| name.as_str()).eq(["B", "G", "R"]) {
            named.reverse();
        }
        let planes = named.into_iter().map(|(_, values)| values).collect();
        Ok(Self { columns: layer.size.0, rows: layer.size.1, planes })
    }

    fn shape(&self) -> [usize; 3] {
        [self.columns, self.rows, self.planes.len()]
    }

    /// Copies the window around a texel into `values`, `[channel][row][column]`; what lies beyond the image is left
    /// alone.
    fn cut(&self, [x, y]: [usize; 2], [width, height]: [usize; 2], values: &mut [f32]) {
        for (plane, window) in self.planes.iter().zip(values.chunks_mut(width * height)) {
            for (row, line) in window.chunks_mut(width).enumerate() {
                let Some(from) = (y + row).checked_sub(height / 2).filter(|row| *row < self.rows) else { continue };
                for (column, value) in line.iter_mut().enumerate() {
                    if let Some(from_x) = (x + column).checked_sub(width / 2).filter(|x| *x < self.columns) {
                        *value = plane[from * self.columns + from_x];
                    }
                }
            }
        }
    }
}
