//! What shows by a shadow's edge at a spot, asked and printed.

use super::{EDGE_MM, EdgeRecord, Fit, SpotRecord, SurfaceSpot};
use crate::parallel;
use crate::{job::Prepared, look::Radiosity, optics::EdgeResponse};

/// What a target's profile shows at [`EDGE_MM`] for an albedo of 1, by channel.
pub(super) type EdgeShape = Vec<Vec<f64>>;

/// The edge of the target that each spot has; `None` where it has none.
pub(super) fn asked(prepared: &Prepared, spots: &[SurfaceSpot]) -> Vec<Option<EdgeShape>> {
    let label_of = |spot: &SurfaceSpot| {
        let found = prepared.slicer().objects()[spot.object].surface().closest(spot.middle.point);
        (spot.object, prepared.wanted_at(spot.object, found.triangle, found.point).0)
    };
    let labels: Vec<(usize, u16)> = spots.iter().map(label_of).collect();
    let mut distinct = labels.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let grid = &prepared.materials.grid;
    let edges = |&(object, label): &(usize, u16)| -> Option<EdgeShape> {
        let target = prepared.objects[object].asked.targets.get(usize::from(label))?;
        let edge = |spectrum: &Vec<f64>| {
            let response = EdgeResponse::new(spectrum, grid);
            let total = spectrum.first().copied().unwrap_or(0.0);
            EDGE_MM.iter().map(|x| if total > 0.0 { response.at(*x) / total } else { 0.0 }).collect()
        };
        Some(target.channels.iter().map(edge).collect())
    };
    let shapes: Vec<_> = parallel::map_all(&distinct, edges);
    labels.iter().map(|label| shapes[distinct.binary_search(label).ok()?].clone()).collect()
}

/// The edge at one spot, where the albedo `albedo` is asked for by a target of this `shape`.
pub(super) fn record(
    spot: &SurfaceSpot,
    shape: Option<&EdgeShape>,
    albedo: Option<&[f64]>,
    printed: &[Radiosity],
) -> EdgeRecord {
    let of_albedo = |(shape, albedo): (&Vec<f64>, &f64)| shape.iter().map(|share| share * albedo).collect();
    EdgeRecord {
        into_the_light: spot.spot.into_the_light().to_array(),
        asked: shape.zip(albedo).map(|(shape, albedo)| shape.iter().zip(albedo).map(of_albedo).collect()),
        printed: printed.iter().map(|channel| channel.edge.iter().map(|at| at.mean).collect()).collect(),
        standard_error: printed
            .iter()
            .map(|channel| channel.edge.iter().map(|at| at.standard_error).collect())
            .collect(),
    }
}

/// Printed against asked over all these spots and distances, in each channel; `None` if a spot has no asked edge.
pub(super) fn against_asked(spots: &[&SpotRecord], channels: usize) -> Option<Vec<Fit>> {
    let edges: Vec<_> = spots
        .iter()
        .map(|spot| Some((spot.edge.as_ref()?.asked.as_ref()?, spot.edge.as_ref()?)))
        .collect::<Option<_>>()?;
    let fit = |channel: usize| {
        let values = edges.iter().flat_map(|(asked, edge)| {
            let values = edge.printed[channel].iter().zip(&edge.standard_error[channel]).zip(&asked[channel]);
            values.map(|((printed, error), asked)| [*printed, *error, *asked])
        });
        Fit::of(values)
    };
    (!edges.is_empty()).then(|| (0..channels).map(fit).collect())
}
