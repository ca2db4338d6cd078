//! Objects side by side on the tray, where the job does not say where they stand.
//!
//! In rows along x, as shelves: deep objects first, so that a row wastes little behind flat ones. Every object stands
//! at a multiple of the voxels' pitch, and copies are alike to the voxel.

use std::path::PathBuf;

use glam::{DMat4, DVec3};

use super::object::bounds;
use crate::{job::Job, mesh::Solid};

/// Row length of a tray without an end, in edges of the square that all objects would fill.
const SQUARE: f64 = 1.3;

/// Moves objects to their places, `gap_mm` apart.
pub(super) fn arrange(job: &Job, gap_mm: f64, loaded: &mut [(Solid, DMat4, Vec<PathBuf>)]) {
    let corners: Vec<[DVec3; 2]> = loaded.iter().map(|(solid, ..)| bounds(solid)).collect();
    let sizes: Vec<DVec3> = corners.iter().map(|[low, high]| *high - *low).collect();
    for ((place, [low, _]), (solid, transform, _)) in places(job, gap_mm, &sizes).iter().zip(&corners).zip(loaded) {
        let by = *place - *low * DVec3::new(1.0, 1.0, 0.0);
        solid.translate(by);
        *transform = DMat4::from_translation(by) * *transform;
    }
}

/// Where the least corners of objects of these sizes come to stand, at height 0.
pub(super) fn places(job: &Job, gap_mm: f64, sizes: &[DVec3]) -> Vec<DVec3> {
    let pitch = job.printer.pitch_mm;
    let around = |size: DVec3| (size.x + gap_mm) * (size.y + gap_mm);
    let side = SQUARE * sizes.iter().map(|size| around(*size)).sum::<f64>().sqrt();
    let end = job.printer.tray_mm.map_or(side, |tray| tray.x);
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|&a, &b| sizes[b].y.total_cmp(&sizes[a].y).then(sizes[b].x.total_cmp(&sizes[a].x)).then(a.cmp(&b)));
    let whole = |at: f64, pitch: f64| (at / pitch - 1e-9).ceil() * pitch;
    let (mut x, mut y, mut depth) = (0.0, 0.0, 0.0_f64);
    let mut places = vec![DVec3::ZERO; sizes.len()];
    for index in order {
        let size = sizes[index];
        if x > 0.0 && x + size.x > end * (1.0 + 1e-9) {
            (x, y, depth) = (0.0, whole(y + depth + gap_mm, pitch.y), 0.0);
        }
        places[index] = DVec3::new(x, y, 0.0);
        x = whole(x + size.x + gap_mm, pitch.x);
        depth = depth.max(size.y);
    }
    places
}
