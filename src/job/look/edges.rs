//! What shows by a shadow's edge at a spot, asked and printed.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{EDGE_MM, EdgeRecord, Fit, SpotRecord, SurfaceSpot};
use crate::{job::Prepared, look::Radiosity, optics::EdgeResponse};

/// An object's label, and what its target's profile shows at [`EDGE_MM`] for an albedo of 1, by channel.
pub(super) type AskedEdges = HashMap<(usize, u16), Vec<Vec<f64>>>;

fn label_of(prepared: &Prepared, spot: &SurfaceSpot) -> (usize, u16) {
    let found = prepared.slicer().objects()[spot.object].surface().closest(spot.middle.point);
    (spot.object, prepared.wanted_at(spot.object, found.triangle, found.point).0)
}

/// The edges of the targets that spots have.
pub(super) fn asked(prepared: &Prepared, spots: &[SurfaceSpot]) -> AskedEdges {
    let mut labels: Vec<_> = spots.iter().map(|spot| label_of(prepared, spot)).collect();
    labels.sort_unstable();
    labels.dedup();
    let grid = &prepared.materials.grid;
    let edges = |label: (usize, u16)| {
        let target = prepared.objects[label.0].asked.targets.get(usize::from(label.1))?;
        let edge = |spectrum: &Vec<f64>| {
            let response = EdgeResponse::new(spectrum, grid);
            let total = spectrum.first().copied().unwrap_or(0.0);
            EDGE_MM.iter().map(|x| if total > 0.0 { response.at(*x) / total } else { 0.0 }).collect()
        };
        Some((label, target.channels.iter().map(edge).collect()))
    };
    labels.into_par_iter().filter_map(edges).collect()
}

/// The edge at one spot, where the albedo `albedo` is asked for.
pub(super) fn record(
    prepared: &Prepared,
    spot: &SurfaceSpot,
    asked: &AskedEdges,
    albedo: Option<&[f64]>,
    printed: &[Radiosity],
) -> EdgeRecord {
    let of_albedo = |(shape, albedo): (&Vec<f64>, &f64)| shape.iter().map(|share| share * albedo).collect();
    let shapes = asked.get(&label_of(prepared, spot));
    EdgeRecord {
        into_the_light: spot.spot.into_the_light().to_array(),
        asked: shapes.zip(albedo).map(|(shapes, albedo)| shapes.iter().zip(albedo).map(of_albedo).collect()),
        printed: printed.iter().map(|channel| channel.edge.iter().map(|at| at.mean).collect()).collect(),
        standard_error: printed
            .iter()
            .map(|channel| channel.edge.iter().map(|at| at.standard_error).collect())
            .collect(),
    }
}

/// Printed against asked over all spots and distances, in each channel; `None` if a spot has no asked edge.
pub(super) fn against_asked(spots: &[SpotRecord], channels: usize) -> Option<Vec<Fit>> {
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
