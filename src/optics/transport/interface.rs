//! A boundary between media, over directions.
//!
//! Refraction keeps a node and its azimuth, so that a boundary is one reflectance per unknown, the same from both
//! sides.

use super::directions::{AIR, Directions};
use crate::optics::fresnel::refraction;

/// Share of the flux in every unknown that a boundary between media of indices `above` and `below` reflects; `None`
/// where they are one.
pub(super) fn reflectances(directions: &Directions, above: f64, below: f64) -> Option<Vec<f64>> {
    if above == below {
        return None;
    }
    let (upper, lower) = (directions.within(above), directions.within(below));
    let node = |node: usize| {
        if upper.travels(node) && lower.travels(node) {
            refraction(upper.mu[node], above, below).map_or(1.0, |found| found.reflectance)
        } else {
            1.0
        }
    };
    let nodes: Vec<f64> = (0..directions.nodes()).map(node).collect();
    let vertical = refraction(1.0, above, below).map_or(1.0, |found| found.reflectance);
    let orders = (0..directions.orders).flat_map(|_| nodes.iter().copied());
    Some(orders.chain([vertical]).collect())
}

/// What the top surface of a stack whose first layer has refractive index `first` reflects of unit light with these
/// fluxes.
pub(super) fn glint(directions: &Directions, first: f64, source: impl Iterator<Item = f64>) -> f64 {
    let reflected = |reflectances: Vec<f64>| reflectances.iter().zip(source).map(|(share, flux)| share * flux).sum();
    reflectances(directions, AIR, first).map_or(0.0, reflected)
}
