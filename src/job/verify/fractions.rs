//! Volume fractions: they fill a voxel or leave it empty, and what they come to is what was printed.
//!
//! Printed voxels are drawn by lot, so that of a resin with the fractions f there are Σ f of them but for chance, whose
//! variance is at most Σ f (1 − f). A mask draws more evenly in space, but not in each plane of voxels along a flat
//! boundary, and there the same way over and over. So a resin may be off by
//!
//! ```text
//!   10 + 4 √v + v/4 + 0.0003 n,   v = Σ f (1 − f),   n voxels with 0 < f < 1, whose fractions are rounded
//! ```
//!
//! What is moved between two resins and back
//! elsewhere is not found, unless voxels are printed of what is no longer there.

use std::io;

use crate::{job::Manifest, voxel::WHOLE};

/// What the fractions of one resin come to.
#[derive(Debug, Clone, Default)]
struct Total {
    /// Their sum, in units of 1 / [`WHOLE`].
    units: u64,
    /// Σ f (1 − f), in units of 1 / [`WHOLE`]².
    lots: u128,
    /// Voxels that it has a part of.
    mixed: u64,
    /// Voxels that are printed of it where there is none.
    absent: u64,
}

/// What fractions come to, by the resin's place in the manifest.
#[derive(Debug, Clone)]
pub(super) struct Totals(Vec<Total>);

/// A fraction in units of 1 / [`WHOLE`].
fn units(number: [u8; 4]) -> io::Result<u16> {
    let units = f32::from_le_bytes(number) * f32::from(WHOLE);
    if (0.0..=f32::from(WHOLE)).contains(&units) {
        return Ok(units.round() as u16);
    }
    Err(io::Error::other(format!("found the fraction {}, expected one from 0 to 1", units / f32::from(WHOLE))))
}

/// What is said of a voxel that is filled otherwise.
pub(super) fn misfilled(filled: u32, expected: &str) -> io::Error {
    let found = f64::from(filled) / f64::from(WHOLE);
    io::Error::other(format!("found fractions of a voxel that sum to {found}, expected {expected}"))
}

impl Totals {
    /// Those of so many resins before anything is read.
    pub(super) fn new(resins: usize) -> Self {
        Self(vec![Total::default(); resins])
    }

    /// Adds the fraction of a resin in a voxel, which is printed of it or not, where that is known; returns it.
    pub(super) fn add(&mut self, resin: usize, number: [u8; 4], printed: bool) -> io::Result<u32> {
        let units = units(number)?;
        let total = &mut self.0[resin];
        total.units += u64::from(units);
        if units > 0 && units < WHOLE {
            total.lots += u128::from(units) * u128::from(WHOLE - units);
            total.mixed += 1;
        }
        total.absent += u64::from(printed && units == 0);
        Ok(units.into())
    }

    /// What differs from the manifest, support among it.
    pub(super) fn problems(&self, manifest: &Manifest) -> Vec<String> {
        let whole = f64::from(WHOLE);
        let filled: u64 = self.0.iter().map(|total| total.units).sum();
        let expected = manifest.materials.iter().fold(0_u64, |sum, material| sum.saturating_add(material.voxels));
        let all = (filled != expected.saturating_mul(WHOLE.into())).then(|| {
            format!("found fractions that fill {} voxels, the manifest has {expected}", filled as f64 / whole)
        });
        let of_resin = |(total, material): (&Total, &crate::job::manifest::MaterialRecord)| {
            let (name, voxels) = (&material.name, material.voxels);
            let (filled, tolerance) = (total.units as f64 / whole, total.tolerance());
            let off = ((filled - voxels as f64).abs() > tolerance).then(|| {
                format!("found fractions of {name} that fill {filled} voxels, expected {voxels} ± {tolerance:.0}")
            });
            let absent = total.absent;
            let strange = (absent > 10 + voxels / 10_000)
                .then(|| format!("found {absent} voxels of {name} where its fraction is 0"));
            off.into_iter().chain(strange)
        };
        all.into_iter().chain(self.0.iter().zip(&manifest.materials).flat_map(of_resin)).collect()
    }
}

impl Total {
    /// By how many voxels the printed ones may be more or fewer; see the [module](self).
    fn tolerance(&self) -> f64 {
        let lots = self.lots as f64 / f64::from(WHOLE).powi(2);
        10.0 + 4.0 * lots.sqrt() + lots / 4.0 + 3e-4 * self.mixed as f64
    }
}
