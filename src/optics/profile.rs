//! Radial profiles: how much light leaves at a distance from where it entered.

use super::OpticsError;
use super::quadrature::{Density, Nodes};

/// Fewest samples a profile may have: below, neither its centre nor its tail can be told.
pub(crate) const MIN_SAMPLES: usize = 8;
/// Largest radius accepted, mm; ten metres is a slip of units.
const MAX_RADIUS_MM: f64 = 1e4;
/// Values this far below 0, relative to the largest, pass for noise; a dark-frame subtraction leaves such values. They
/// are kept as they are, since cutting them off would add light.
const NEGATIVE_TOLERANCE: f64 = 1e-3;
/// The centre inside the first sample is extrapolated; a profile that has more than this share of its energy there is
/// refused.
const MAX_CENTRE_SHARE: f64 = 0.5;

/// R(r) or T(r): radius in mm, value per mm² for unit incident flux, so that 2π∫ f r dr is the albedo.
///
/// Samples are either **points** f(rᵢ), or **means over rings** between edges, which is what pixel averages and Monte
/// Carlo counts are. Near the centre, where f grows like 1/r, the difference is percents of the energy.
#[derive(Debug, Clone, PartialEq)]
pub struct RadialProfile {
    r_mm: Vec<f64>,
    value_per_mm2: Vec<f64>,
    standard_error: Option<Vec<f64>>,
    ring_edges: Option<Vec<f64>>,
}

/// A sample that is not acceptable, by index.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("sample {index}: found {found}, expected {expected}")]
pub struct ProfileError {
    /// Index of the sample, from 0.
    pub index: usize,
    /// What it is.
    pub found: String,
    /// What it should be.
    pub expected: String,
}

impl crate::blame::Blamed for ProfileError {}

impl From<ProfileError> for OpticsError {
    fn from(error: ProfileError) -> Self {
        Self::Parameter {
            name: format!("profile sample {}", error.index),
            found: error.found,
            expected: error.expected,
        }
    }
}

impl RadialProfile {
    /// A profile of point samples at radii > 0. If the first radius is 0 the samples are taken for means over rings
    /// with edges halfway between the radii: no one can sample the 1/r at the centre, but a camera's central pixel
    /// averages it.
    ///
    /// # Errors
    /// The first sample that is not finite, not ascending, below 0 by more than a thousandth of the largest (and five
    /// of its standard errors); fewer than 8 samples, or all zero; more than half of the energy inside the first.
    pub fn from_points(
        r_mm: Vec<f64>,
        value_per_mm2: Vec<f64>,
        standard_error: Option<Vec<f64>>,
    ) -> Result<Self, ProfileError> {
        check_radii(&r_mm)?;
        if r_mm[0] == 0.0 {
            let last = r_mm.len() - 1;
            let halfway = r_mm.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
            let end = r_mm[last] + 0.5 * (r_mm[last] - r_mm[last - 1]);
            let edges = std::iter::once(0.0).chain(halfway).chain([end]).collect();
            check_values(&value_per_mm2, standard_error.as_deref(), r_mm.len())?;
            return Ok(Self { r_mm, value_per_mm2, standard_error, ring_edges: Some(edges) });
        }
        check_values(&value_per_mm2, standard_error.as_deref(), r_mm.len())?;
        let profile = Self { r_mm, value_per_mm2, standard_error, ring_edges: None };
        let share = profile.centre_share();
        if share > MAX_CENTRE_SHARE {
            return Err(ProfileError {
                index: 0,
                found: format!("radius {} mm, with {:.0}% of the light inside it", profile.r_mm[0], 100.0 * share),
                expected: "samples that start nearer to the centre".into(),
            });
        }
        Ok(profile)
    }

    /// A profile of means over the rings between consecutive edges, the first edge 0; one edge more than values.
    ///
    /// # Errors
    /// As [`RadialProfile::from_points`].
    pub fn from_rings(
        edges_mm: Vec<f64>,
        value_per_mm2: Vec<f64>,
        standard_error: Option<Vec<f64>>,
    ) -> Result<Self, ProfileError> {
        check_radii(&edges_mm)?;
        if edges_mm[0] != 0.0 {
            return Err(ProfileError {
                index: 0,
                found: format!("a ring starting at {} mm", edges_mm[0]),
                expected: "the first ring to start at 0".into(),
            });
        }
        check_values(&value_per_mm2, standard_error.as_deref(), edges_mm.len() - 1)?;
        Ok(Self { r_mm: ring_means(&edges_mm), value_per_mm2, standard_error, ring_edges: Some(edges_mm) })
    }

    /// Rings counted by this room, valid by construction; unlike a measured profile one may be all zero.
    pub(crate) fn from_counted_rings(edges_mm: Vec<f64>, value_per_mm2: Vec<f64>, standard_error: Vec<f64>) -> Self {
        let r_mm = ring_means(&edges_mm);
        Self { r_mm, value_per_mm2, standard_error: Some(standard_error), ring_edges: Some(edges_mm) }
    }

    /// Radii in mm, ascending; for rings their mean radius weighted by area.
    pub fn r_mm(&self) -> &[f64] {
        &self.r_mm
    }

    /// Values per mm².
    pub fn value_per_mm2(&self) -> &[f64] {
        &self.value_per_mm2
    }

    /// One standard deviation of each value, if known.
    pub fn standard_error(&self) -> Option<&[f64]> {
        self.standard_error.as_deref()
    }

    /// Edges in mm if the samples are ring means, one more than samples.
    pub fn ring_edges(&self) -> Option<&[f64]> {
        self.ring_edges.as_deref()
    }

    /// Largest radius the samples speak for, mm.
    pub fn reach_mm(&self) -> f64 {
        let radii = self.ring_edges.as_ref().unwrap_or(&self.r_mm);
        radii.last().copied().unwrap_or(0.0)
    }

    /// 2π∫ f r dr over the sampled range: for rings, exactly the sum of value times area. The tail beyond is left out;
    /// [`RadialProfile::hankel`] includes it.
    pub fn energy(&self) -> f64 {
        match &self.ring_edges {
            Some(edges) => ring_areas(edges).zip(&self.value_per_mm2).map(|(area, value)| area * value).sum(),
            None => Nodes::new(&self.density(), f64::INFINITY).energy(),
        }
    }

    /// Radius in mm inside which the given share of the sampled energy leaves; 0.5 gives the half-energy radius. `None`
    /// if the share is outside [0, 1] or the profile holds no energy.
    pub fn radius_of_energy(&self, share: f64) -> Option<f64> {
        self.density().radius_of_energy(share)
    }

    /// The same profile with all values (and errors) multiplied, as when rescaled to a separately measured albedo.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let times = |values: &Vec<f64>| values.iter().map(|value| value * factor).collect();
        Self {
            r_mm: self.r_mm.clone(),
            value_per_mm2: times(&self.value_per_mm2),
            standard_error: self.standard_error.as_ref().map(times),
            ring_edges: self.ring_edges.clone(),
        }
    }

    /// The first `samples` samples.
    #[must_use]
    pub(super) fn truncated(&self, samples: usize) -> Self {
        let samples = samples.min(self.r_mm.len());
        Self {
            r_mm: self.r_mm[..samples].to_vec(),
            value_per_mm2: self.value_per_mm2[..samples].to_vec(),
            standard_error: self.standard_error.as_ref().map(|errors| errors[..samples].to_vec()),
            ring_edges: self.ring_edges.as_ref().map(|edges| edges[..=samples].to_vec()),
        }
    }

    /// Share of the energy inside the first point sample, where nothing was measured; 0 for rings.
    pub fn centre_share(&self) -> f64 {
        if self.ring_edges.is_some() {
            return 0.0;
        }
        let density = self.density();
        let energy = Nodes::new(&density, f64::INFINITY).energy();
        if energy > 0.0 { density.energy_within(self.r_mm[0]) / energy } else { 0.0 }
    }

    /// Area each sample stands for, mm²: its ring, or for points the ring between the midpoints to its neighbours.
    pub(super) fn sample_areas(&self) -> Vec<f64> {
        match &self.ring_edges {
            Some(edges) => ring_areas(edges).collect(),
            None => {
                let inner = self.r_mm.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
                let edges: Vec<f64> = std::iter::once(0.0).chain(inner).chain([self.reach_mm()]).collect();
                ring_areas(&edges).collect()
            }
        }
    }

    pub(super) fn density(&self) -> Density {
        match &self.ring_edges {
            Some(edges) => Density::from_rings(edges, &self.value_per_mm2),
            None => Density::from_points(&self.r_mm, &self.value_per_mm2),
        }
    }
}

/// Areas of the rings between consecutive edges, mm².
pub(super) fn ring_areas(edges: &[f64]) -> impl Iterator<Item = f64> + '_ {
    edges.windows(2).map(|edge| std::f64::consts::PI * (edge[1] * edge[1] - edge[0] * edge[0]))
}

/// Mean radius of each ring, weighted by area.
fn ring_means(edges: &[f64]) -> Vec<f64> {
    let mean = |a: f64, b: f64| 2.0 / 3.0 * (a * a + a * b + b * b) / (a + b);
    edges.windows(2).map(|edge| mean(edge[0], edge[1])).collect()
}

fn check_radii(r_mm: &[f64]) -> Result<(), ProfileError> {
    if r_mm.len() < MIN_SAMPLES {
        let found = format!("{} samples in all", r_mm.len());
        return Err(ProfileError { index: r_mm.len(), found, expected: format!("at least {MIN_SAMPLES}") });
    }
    for (index, &r) in r_mm.iter().enumerate() {
        if !(0.0..=MAX_RADIUS_MM).contains(&r) {
            let expected = format!("a radius of 0 to {MAX_RADIUS_MM} mm");
            return Err(ProfileError { index, found: format!("radius {r}"), expected });
        }
        if index > 0 && r <= r_mm[index - 1] {
            let expected = format!("a radius above the previous {}", r_mm[index - 1]);
            return Err(ProfileError { index, found: format!("radius {r}"), expected });
        }
    }
    Ok(())
}

fn check_values(values: &[f64], errors: Option<&[f64]>, samples: usize) -> Result<(), ProfileError> {
    let lengths = [Some(values.len()), errors.map(<[f64]>::len)];
    if let Some(length) = lengths.into_iter().flatten().find(|length| *length != samples) {
        let expected = format!("as many as radii or rings, {samples}");
        return Err(ProfileError { index: length.min(samples), found: format!("{length} values"), expected });
    }
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f64::max);
    for (index, &value) in values.iter().enumerate() {
        let error = errors.map_or(0.0, |errors| errors[index]);
        if !(error.is_finite() && error >= 0.0) {
            let expected = "a finite standard error of 0 or more".into();
            return Err(ProfileError { index, found: format!("standard error {error}"), expected });
        }
        let lowest = -(NEGATIVE_TOLERANCE * largest).max(5.0 * error);
        if !(value.is_finite() && value >= lowest) {
            let expected = format!("a finite value of {lowest:.3e} per mm² or more");
            return Err(ProfileError { index, found: format!("{value}"), expected });
        }
    }
    if largest == 0.0 {
        return Err(ProfileError { index: 0, found: "nothing but zeros".into(), expected: "some light".into() });
    }
    Ok(())
}
