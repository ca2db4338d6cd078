//! What the pictures need of a job, gathered while its slabs pass.

use std::ops::Range;

use glam::DVec3;

use super::{
    PreviewError, PreviewFile, PreviewMaterial, Voxels, cutaway, cuts, film, legend::Legend, middles, section::Section,
    sheet, style::Palette, volume::Volume,
};
use crate::{
    look, parallel,
    voxel::{Lattice, Slab},
};

/// Slices on the contact sheet.
const SHEET: usize = 12;
/// Pixels along the longer side of a slice on the sheet: twice what a sheet of 1920 pixels has room for, for smooth
/// edges.
const SHEET_PIXELS: usize = 900;
/// Which of the sheet's slices are also drawn large.
const SINGLES: [usize; 3] = [2, 6, 9];
/// Pixels along the longer side of a cut or a large slice.
const CUT_PIXELS: usize = 2000;

/// Gathers the slabs of a job, then draws.
///
/// Slabs may come in any order and slices may be missing: what was not observed is background.
#[derive(Debug)]
pub struct PreviewBuilder {
    lattice: Lattice,
    materials: Vec<PreviewMaterial>,
    pub(super) volume: Volume,
    sheet: Vec<Section>,
    singles: Vec<Section>,
    cuts: [Section; 3],
    counts: Option<Box<[u64; 256]>>,
}

impl PreviewBuilder {
    /// A builder for a job on `lattice` with cuts through its middle.
    pub fn new(lattice: &Lattice, materials: &[PreviewMaterial]) -> Self {
        Self::planned(lattice, materials, None, |k| k)
    }

    /// Like [`Self::new`], with the cuts through `focus`, mm in the lattice's frame: with several objects on a tray the
    /// middle may lie between them.
    pub fn focused(lattice: &Lattice, materials: &[PreviewMaterial], focus: DVec3) -> Self {
        Self::planned(lattice, materials, Some(focus), |k| k)
    }

    /// `snap` maps a slice to the one to be read in its place, where many are read, and must not decrease.
    pub(super) fn planned(
        lattice: &Lattice,
        materials: &[PreviewMaterial],
        focus: Option<DVec3>,
        snap: impl Fn(u32) -> u32 + Copy,
    ) -> Self {
        let focus = focus.unwrap_or(DVec3::NAN);
        let cut = |axis: usize| {
            let dim = f64::from(lattice.dims[axis]);
            let position = (focus[axis] - lattice.origin[axis]) / lattice.pitch[axis];
            let position = if position.is_finite() { position } else { 0.5 * dim };
            let index = position.clamp(0.0, (dim - 1.0).max(0.0)) as u32;
            Section::new(lattice, axis, index, CUT_PIXELS, snap)
        };
        let slice = |k, pixels| Section::new(lattice, 2, k, pixels, snap);
        let mut heights: Vec<u32> = middles(SHEET, lattice.dims[2]).collect();
        heights.dedup();
        let single = |n: usize| heights[n * heights.len() / SHEET];
        let mut large = SINGLES.map(single).to_vec();
        large.dedup();
        Self {
            lattice: *lattice,
            materials: materials.to_vec(),
            volume: Volume::new(lattice, snap),
            sheet: heights.iter().map(|&k| slice(k, SHEET_PIXELS)).collect(),
            singles: large.iter().map(|&k| slice(k, CUT_PIXELS)).collect(),
            cuts: [0, 1, 2].map(cut),
            counts: None,
        }
    }

    /// Takes in what the pictures need of a slab.
    pub fn observe(&mut self, slab: &Slab) {
        self.observe_slices(slab, slab.slices());
    }

    pub(super) fn observe_slices(&mut self, source: &impl Voxels, slices: Range<u32>) {
        let width = self.lattice.dims[0] as usize;
        self.volume.observe(source, &slices, width);
        for section in self.sections_mut() {
            section.observe(source, &slices, width);
        }
    }

    /// States how many voxels there are of every id, for the legend; without it volumes are estimated and marked `~`.
    pub fn set_counts(&mut self, counts: &[u64; 256]) {
        self.counts = Some(Box::new(*counts));
    }

    pub(super) fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub(super) fn sections_mut(&mut self) -> impl Iterator<Item = &mut Section> {
        self.cuts.iter_mut().chain(&mut self.sheet).chain(&mut self.singles)
    }

    /// The slices anything will be read from, ascending.
    pub(super) fn slices_needed(&self) -> Vec<u32> {
        let sections = self.cuts.iter().chain(&self.sheet).chain(&self.singles);
        let mut slices: Vec<u32> = sections.flat_map(|section| section.slices().iter().copied()).collect();
        slices.extend(self.volume.slices());
        slices.sort_unstable();
        slices.dedup();
        slices
    }

    /// Draws the pictures; with the `voxels` of the whole job, the cut-away shows the outermost ones.
    pub fn finish(self, voxels: Option<&look::Volume>) -> Result<Vec<PreviewFile>, PreviewError> {
        let palette = Palette::new(&self.materials);
        let legend = self.legend();
        let lattice = &self.lattice;
        let mut pictures = vec![
            ("preview/slices.png".to_owned(), sheet::contact_sheet(lattice, &self.sheet, &palette, &legend)),
            ("preview/cuts.png".to_owned(), cuts::cuts(lattice, &self.cuts, &palette, &legend)),
            (
                "preview/cutaway.png".to_owned(),
                cutaway::cutaway(lattice, &self.volume, voxels, &self.cuts, &palette, &legend),
            ),
        ];
        for section in &self.singles {
            let picture = sheet::single_slice(lattice, section, &palette, &legend);
            pictures.push((format!("preview/slice_{}.png", section.index), picture));
        }
        pictures.push((film::FILM_STRIP.to_owned(), film::film(&self.volume, &palette)));
        parallel::map_all(&pictures, |(path, canvas)| canvas.file(path.clone())).into_iter().collect()
    }

    fn legend(&self) -> Legend {
        let estimates = self.volume.volumes();
        let mut seen = [false; 256];
        for section in self.cuts.iter().chain(&self.sheet).chain(&self.singles) {
            for run in section.ids.chunk_by(|a, b| a == b) {
                seen[usize::from(run[0])] = true;
            }
        }
        let each = self.lattice.voxel_volume();
        let volume = |id: usize| match &self.counts {
            Some(counts) => counts[id] as f64 * each,
            None => estimates[id],
        };
        let shown: Vec<u8> =
            (1..=u8::MAX).filter(|&id| volume(usize::from(id)) > 0.0 || seen[usize::from(id)]).collect();
        Legend::new(&self.materials, shown.iter().map(|&id| (id, volume(usize::from(id)))), self.counts.is_some())
    }
}
