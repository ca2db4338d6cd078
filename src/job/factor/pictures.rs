//! Pictures of a factored dataset: clusters and their palette, albedo, residual by place.

use super::{ClusterRecord, texels::Texels};
use crate::{
    appearance::{
        ClusterId,
        bssrdf::{Dataset, Misses},
    },
    colour::{Rgb, linear_to_byte},
    picture::{Pixels, png},
    plot::{Axis, ColourBar, Figure, Format, Panel, PlotError, Raster, Scale, Series, viridis},
};

/// Label of every texel as 16-bit grey.
pub(super) fn labels(labels: &[ClusterId], dataset: &Dataset) -> Vec<u8> {
    let labels: Vec<u16> = labels.iter().map(|label| label.0).collect();
    encode(dataset, Pixels::Grey16(&labels))
}

/// Albedo as it would look, in sRGB; the first channel for grey, three for colour.
pub(super) fn albedo(texels: &Texels, dataset: &Dataset) -> Vec<u8> {
    let colour = dataset.channels.len() == 3;
    let shown = if colour { 3 } else { 1 };
    let bytes: Vec<u8> =
        (0..dataset.texels()).flat_map(|texel| texels.albedo(texel).take(shown).map(linear_to_byte)).collect();
    encode(dataset, if colour { Pixels::Rgb8(bytes.as_chunks().0) } else { Pixels::Grey8(&bytes) })
}

fn encode(dataset: &Dataset, pixels: Pixels<'_>) -> Vec<u8> {
    let written = png(dataset.width, pixels);
    // The size is right by construction.
    debug_assert!(written.is_ok());
    written.unwrap_or_default()
}

/// A map over the patch, mm.
fn map(title: &str, dataset: &Dataset, raster: impl FnOnce([f64; 2], [f64; 2]) -> Raster) -> Panel {
    let side = |texels: usize| [0.0, texels as f64 * dataset.pitch_mm];
    let (x, y) = (side(dataset.width), side(dataset.height));
    let axis = |label: &str, [low, high]: [f64; 2]| Axis::linear(label).range(low, high);
    Panel::new(axis("x [mm]", x), axis("y [mm]", y)).title(title).raster(raster(x, y))
}

/// A figure of maps, as wide as the patch is.
fn figure(title: &str, dataset: &Dataset) -> Figure {
    let aspect = (dataset.height as f64 / dataset.width as f64).clamp(0.25, 4.0);
    let width = 420.0 / aspect.sqrt();
    Figure::new(title).panel_size(width, width * aspect).columns(2)
}

/// The least and greatest of some positive values, a little apart.
fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values
        .filter(|value| *value > 0.0 && value.is_finite())
        .fold([f64::INFINITY, 0.0], |[low, high], value| [f64::min(low, value), f64::max(high, value)]);
    if low < high { [low, high] } else { [0.5, 1.5].map(|factor| factor * if high > 0.0 { high } else { 1.0 }) }
}

/// What every cluster reflects and how far light travels in it, over the patch.
pub(super) fn clusters(
    records: &[ClusterRecord],
    labels: &[ClusterId],
    dataset: &Dataset,
) -> Result<Vec<u8>, PlotError> {
    let over = |label: &str, scale: Scale, of: &dyn Fn(&ClusterRecord) -> f64| {
        let values: Vec<f64> = labels.iter().map(|label| of(&records[label.index()])).collect();
        let range = span(values.iter().copied());
        let bar = ColourBar { label: label.into(), range, scale };
        map("", dataset, |x, y| Raster::heat_map(dataset.width, &values, x, y, bar))
    };
    let albedo = over("albedo", Scale::Linear, &|record| record.albedo[0]);
    let radius =
        over("half-energy radius [mm]", Scale::Log10, &|record| record.half_energy_radius_mm[0].unwrap_or(f64::NAN));
    figure(&format!("{} clusters", records.len()), dataset).with(albedo).with(radius).encode(Format::Png)
}

/// Profiles are shown down to this share of the brightest value.
const DARKEST: f64 = 1e-9;

/// The clusters' profiles, coloured by albedo, and where they lie in albedo and translucency.
pub(super) fn palette(records: &[ClusterRecord], means: &[Vec<f64>], edges_mm: &[f64]) -> Result<Vec<u8>, PlotError> {
    let range = span(records.iter().map(|record| record.albedo[0]));
    let colour = |record: &ClusterRecord| -> Rgb { viridis((record.albedo[0] - range[0]) / (range[1] - range[0])) };
    let mut profiles =
        Panel::new(Axis::log("r [mm]"), Axis::log("R(r) [mm⁻²]")).title("Profiles, brighter for more albedo");
    let mut places = Panel::new(Axis::linear("albedo"), Axis::log("half-energy radius [mm]"))
        .title("Clusters, larger for more texels");
    let mut brightest = 0.0_f64;
    for (record, energies) in records.iter().zip(means) {
        let ring = |(energy, edge): (&f64, &[f64])| {
            let area = std::f64::consts::PI * (edge[1] * edge[1] - edge[0] * edge[0]);
            [0.5 * (edge[0] + edge[1]), energy / area]
        };
        let line: Vec<_> = energies.iter().zip(edges_mm.windows(2)).map(ring).collect();
        brightest = line.iter().fold(brightest, |most, point| most.max(point[1]));
        profiles = profiles.with(Series::line("", line).size(1.2).colour(colour(record)).opacity(0.8));
        if let Some(radius) = record.half_energy_radius_mm[0] {
            let size = 4.0 + 60.0 * record.share.sqrt() / 2.0;
            let point = Series::points("", [[record.albedo[0], radius]]).size(size).colour(colour(record));
            places = places.with(point.opacity(0.8));
        }
    }
    // A tail goes on for ever; what is left of it there is no light.
    let line_top = if brightest > 0.0 { brightest } else { 1.0 };
    profiles.y = profiles.y.range(line_top * DARKEST, 2.0 * line_top);
    let title = format!("Palette of {} clusters", records.len());
    Figure::new(title).columns(2).panel_size(480.0, 380.0).with(profiles).with(places).encode(Format::Png)
}

/// √(Σ(D − R̂)² / ΣD²) of every lit texel, over the patch.
pub(super) fn residual(misses: &Misses, dataset: &Dataset) -> Result<Vec<u8>, PlotError> {
    let values: Vec<f64> =
        misses.places.iter().map(|[error, data]| if *data > 0.0 { (error / data).sqrt() } else { f64::NAN }).collect();
    let range = span(values.iter().copied());
    let bar = ColourBar { label: "relative error".into(), range, scale: Scale::Log10 };
    let title = "What equation 7 misses, by lit texel";
    let panel = map("", dataset, |x, y| Raster::heat_map(dataset.width, &values, x, y, bar));
    figure(title, dataset).columns(1).with(panel).encode(Format::Png)
}
