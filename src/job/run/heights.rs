//! Layer maps as files: an image of depths per layer and, for a slab seen from above, the surfaces at which layers end.

use serde::Serialize;

use crate::{
    appearance::HeightFields,
    job::{RunError, plan::LayerMaps},
    output::{OutputFolder, pretty},
    picture::{Pixels, png},
};

/// One level of the images, mm: 16 bits reach 65 mm.
const LEVEL_MM: f64 = 0.001;
/// Folder of all of them.
const FOLDER: &str = "heights";

/// `heights.json`.
#[derive(Serialize)]
struct Record<'a> {
    version: u32,
    level_mm: f64,
    maps: Vec<MapRecord<'a>>,
}

#[derive(Serialize)]
struct MapRecord<'a> {
    object: usize,
    page: usize,
    width: usize,
    height: usize,
    pitch_mm: Option<[f64; 2]>,
    layers: Vec<LayerRecord<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    surfaces: Option<String>,
}

#[derive(Serialize)]
struct LayerRecord<'a> {
    resin: &'a str,
    bottom: String,
    thickest_mm: f64,
}

/// Writes the maps of all objects, in their order.
pub(super) fn write<'a>(
    output: &OutputFolder,
    objects: impl ExactSizeIterator<Item = &'a LayerMaps>,
) -> Result<(), RunError> {
    let count = objects.len();
    let mut maps = Vec::new();
    for (object, LayerMaps { pages, resins, pitch_mm }) in objects.enumerate() {
        for (page, fields) in pages.iter().enumerate() {
            let stem = match (count, pages.len()) {
                (1, 1) => String::new(),
                (_, 1) => format!("object_{object}_"),
                _ => format!("object_{object}_page_{page}_"),
            };
            let mut layers = Vec::new();
            for (layer, &resin) in fields.sequence.iter().enumerate() {
                let resin = resins[resin.0].as_str();
                let bottom = format!("{FOLDER}/{stem}layer_{layer:02}_{resin}.png");
                output.write(&bottom, &grey16(fields, layer))?;
                layers.push(LayerRecord { resin, bottom, thickest_mm: thickest(fields, layer) });
            }
            let surfaces = pitch_mm.map(|pitch| (format!("{FOLDER}/{stem}layers.obj"), fields.obj(pitch, resins)));
            if let Some((path, text)) = &surfaces {
                output.write(path, text.as_bytes())?;
            }
            let surfaces = surfaces.map(|(path, _)| path);
            let (width, height) = (fields.width, fields.height);
            maps.push(MapRecord { object, page, width, height, pitch_mm: *pitch_mm, layers, surfaces });
        }
    }
    let record = Record { version: 1, level_mm: LEVEL_MM, maps };
    output.write(&format!("{FOLDER}/heights.json"), &pretty(&record))?;
    Ok(())
}

/// Greatest thickness of a layer, mm.
fn thickest(fields: &HeightFields, layer: usize) -> f64 {
    let above = |i: usize| if layer == 0 { 0.0 } else { fields.layer(layer - 1)[i] };
    let thickness = fields.layer(layer).iter().enumerate().map(|(i, bottom)| bottom - above(i));
    f64::from(thickness.fold(0.0, f32::max))
}

fn grey16(fields: &HeightFields, layer: usize) -> Vec<u8> {
    let written = png(fields.width, Pixels::Grey16(&fields.levels(layer, LEVEL_MM)));
    // The size is right by construction.
    debug_assert!(written.is_ok());
    written.unwrap_or_default()
}
