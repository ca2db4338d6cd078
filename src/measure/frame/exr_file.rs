//! OpenEXR: floating point, linear by definition.

use std::path::Path;

use exr::prelude::{FlatSamples, MetaData, ReadChannels, ReadLayers, read};

use super::{ColourPlane, Header, Plane};
use crate::measure::MeasureError;

/// Names of a channel that holds grey values.
const GREY: &str = "Y";

fn damaged(path: &Path, error: &exr::error::Error) -> MeasureError {
    MeasureError::frame(path, format!("an EXR that cannot be read ({error})"), "a whole one")
}

/// What the file says.
pub(super) fn header(path: &Path) -> Result<Header, MeasureError> {
    let meta = MetaData::read_from_file(path, false).map_err(|error| damaged(path, &error))?;
    let Some(layer) = meta.headers.first() else { return Err(MeasureError::frame(path, "no layer", "one")) };
    let has = |name: &str| layer.channels.list.iter().any(|channel| channel.name == *name);
    let colour = has("R") && has("G") && has("B");
    if !colour && !has(GREY) {
        return Err(MeasureError::frame(path, "an EXR without them", "channels R, G, B or Y"));
    }
    let seconds = layer.own_attributes.exposure.map(f64::from).filter(|seconds| seconds.is_finite() && *seconds > 0.0);
    Ok(Header {
        width: layer.layer_size.width(),
        height: layer.layer_size.height(),
        colour,
        largest: f64::INFINITY,
        exposure_s: seconds,
        black_level: None,
        saturation_level: None,
        curve: None,
    })
}

/// The planes asked for.
pub(super) fn planes(path: &Path, wanted: &[ColourPlane]) -> Result<Vec<Plane>, MeasureError> {
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = exr::prelude::ReadImage::from_file(image, path).map_err(|error| damaged(path, &error))?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let plane = |wanted: &ColourPlane| {
        let letter = wanted.letter().to_string();
        let channels = &layer.channel_data.list;
        let named = |name: &str| channels.iter().find(|channel| channel.name == *name);
        let channel = named(&letter)
            .or_else(|| named(GREY))
            .ok_or_else(|| MeasureError::frame(path, format!("no channel {letter}"), "R, G, B or Y"))?;
        let values = match &channel.sample_data {
            FlatSamples::F16(values) => values.iter().map(|value| value.to_f32()).collect(),
            FlatSamples::F32(values) => values.clone(),
            FlatSamples::U32(values) => values.iter().map(|value| *value as f32).collect(),
        };
        Ok(Plane { width, height, values })
    };
    wanted.iter().map(plane).collect()
}
