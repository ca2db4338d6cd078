//! What the manifest says of itself: numbers that must agree with each other before files are held against them.

use super::Finding;
use crate::{job::Manifest, voxel::Lattice};

/// Material ids are bytes.
pub(super) const MAX_MATERIALS: usize = 255;
/// Volumes are products of three pitches and a count; another order of multiplication changes the last digits.
const VOLUME_TOLERANCE: f64 = 1e-9;

pub(super) fn check(manifest: &Manifest) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut found = |key: &str, problem: String| findings.push(Finding::manifest(key, problem));
    let lattice = &manifest.lattice;
    if !lattice.pitch_mm.iter().all(|pitch| pitch.is_finite() && *pitch > 0.0) {
        found("lattice.pitch_mm", format!("found {:?}, expected positive lengths", lattice.pitch_mm));
    }
    if !lattice.dims.iter().all(|dim| (1..=Lattice::MAX_DIM).contains(dim)) {
        found("lattice.dims", format!("found {:?}, expected 1 to {} per axis", lattice.dims, Lattice::MAX_DIM));
    }
    let [first, end] = manifest.slices;
    if first >= end || end > lattice.dims[2] {
        found(
            "slices",
            format!("found {first}..{end}, expected a range within 0..{} that is not empty", lattice.dims[2]),
        );
    }
    if manifest.materials.len() > MAX_MATERIALS {
        found("materials", format!("found {} resins, expected at most {MAX_MATERIALS}", manifest.materials.len()));
        return findings;
    }
    let voxel_mm3: f64 = lattice.pitch_mm.iter().product();
    for (index, material) in manifest.materials.iter().enumerate() {
        let key = format!("materials[{index}]");
        if usize::from(material.id) != index + 1 {
            found(&format!("{key}.id"), format!("found {}, expected {}", material.id, index + 1));
        }
        let earlier = &manifest.materials[..index];
        if earlier.iter().any(|other| other.name == material.name) {
            found(&format!("{key}.name"), format!("found {} a second time, expected each resin once", material.name));
        }
        let alpha = material.rgba[3];
        if material.rgba != [0; 4] && alpha != 255 {
            found(&format!("{key}.rgba"), format!("found alpha {alpha}, expected 255, or all 0 for the background"));
        }
        if let Some(other) = earlier.iter().find(|other| alpha != 0 && other.rgba == material.rgba) {
            found(
                &format!("{key}.rgba"),
                format!("found {:?}, expected another colour than {}'s", material.rgba, other.name),
            );
        }
        let volume = material.voxels as f64 * voxel_mm3;
        // Not "greater": NaN is a finding too.
        if !((material.volume_mm3 - volume).abs() <= VOLUME_TOLERANCE * volume) {
            let expected = format!("expected {volume}, the volume of {} voxels", material.voxels);
            found(&format!("{key}.volume_mm3"), format!("found {}, {expected}", material.volume_mm3));
        }
    }
    findings
}
