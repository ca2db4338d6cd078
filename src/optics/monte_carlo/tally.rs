//! Sums over photons, from which means and standard errors follow.
//!
//! A photon leaves the stack once at most, so the contributions to one sum are independent between photons, and the
//! second moment gives the standard error without batches: var = (⟨w²⟩ − ⟨w⟩²)/(N − 1).

use super::photon::Moments;
use super::{MonteCarloResult, RingEdges};
use crate::optics::RadialProfile;

/// One face's exits: in total, and by ring.
#[derive(Debug, Clone)]
struct Face {
    total: Moments,
    rings: Vec<Moments>,
}

impl Face {
    fn new(rings: usize) -> Self {
        Self { total: Moments::default(), rings: vec![Moments::default(); rings] }
    }

    #[inline]
    fn score(&mut self, ring: usize, weight: f64) {
        self.total.score(weight);
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.score(weight);
        }
    }

    fn add(&mut self, other: &Self) {
        self.total.add(&other.total);
        self.rings.iter_mut().zip(&other.rings).for_each(|(mine, theirs)| mine.add(theirs));
    }

    fn profile(&self, photons: u64, edges: &RingEdges) -> RadialProfile {
        let (values, errors) = self
            .rings
            .iter()
            .zip(edges.as_slice().windows(2))
            .map(|(ring, edge)| {
                let area = std::f64::consts::PI * (edge[1] * edge[1] - edge[0] * edge[0]);
                let estimate = ring.estimate(photons);
                (estimate.mean / area, estimate.standard_error / area)
            })
            .unzip();
        RadialProfile::from_counted_rings(edges.as_slice().to_vec(), values, errors)
    }
}

/// The scores of a batch of photons.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    edges_squared: Vec<f64>,
    top: Face,
    bottom: Face,
    unscattered: Face,
    glint: Moments,
}

impl Tally {
    pub(super) fn new(edges: &RingEdges) -> Self {
        let rings = edges.as_slice().len() - 1;
        Self {
            edges_squared: edges.as_slice()[1..].iter().map(|edge| edge * edge).collect(),
            top: Face::new(rings),
            bottom: Face::new(rings),
            unscattered: Face::new(rings),
            glint: Moments::default(),
        }
    }

    fn ring(&self, r_squared: f64) -> usize {
        self.edges_squared.partition_point(|edge| *edge <= r_squared)
    }

    #[inline]
    pub(super) fn score_top(&mut self, r_squared: f64, weight: f64) {
        self.top.score(self.ring(r_squared), weight);
    }

    #[inline]
    pub(super) fn score_bottom(&mut self, r_squared: f64, weight: f64, scattered: bool) {
        let ring = self.ring(r_squared);
        self.bottom.score(ring, weight);
        if !scattered {
            self.unscattered.score(ring, weight);
        }
    }

    #[inline]
    pub(super) fn score_glint(&mut self, weight: f64) {
        self.glint.score(weight);
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.glint.add(&other.glint);
        self.top.add(&other.top);
        self.bottom.add(&other.bottom);
        self.unscattered.add(&other.unscattered);
    }

    pub(super) fn result(&self, photons: u64, edges: &RingEdges) -> MonteCarloResult {
        MonteCarloResult {
            photons,
            reflection: self.top.total.estimate(photons),
            glint: self.glint.estimate(photons),
            transmission: self.bottom.total.estimate(photons),
            unscattered_transmission: self.unscattered.total.estimate(photons),
            reflection_profile: self.top.profile(photons, edges),
            transmission_profile: self.bottom.profile(photons, edges),
            unscattered_profile: self.unscattered.profile(photons, edges),
        }
    }
}
