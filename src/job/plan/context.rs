//! What every step of an object's plan needs at hand.

use crate::{
    job::{Job, RunError},
    mesh::Solid,
    optics::{MaterialSet, ResinId},
    sdf::Surface,
    search::{MatchOptions, ResinLimit, SearchError, SearchOptions},
    voxel::MaterialId,
    watch::Watch,
};

/// What a target is turned into layers with.
pub(super) struct TargetContext<'a> {
    pub job: &'a Job,
    pub materials: &'a MaterialSet,
    /// Texture coordinates are there, if only as zeros.
    pub solid: &'a Solid,
    /// All faces of the body that the object is part of, where it touches others.
    pub body: Option<&'a Surface>,
    /// Whether the mesh file has texture coordinates.
    pub has_uvs: bool,
    pub object: usize,
    pub watch: &'a dyn Watch,
}

impl TargetContext<'_> {
    /// The resin of the core.
    pub(super) fn core(&self) -> Result<ResinId, RunError> {
        let found = self.materials.resin(self.job.stacking.core_name());
        found.map(|(id, _)| id).ok_or_else(|| self.job.refuse_core().into())
    }

    pub(super) fn refuse(&self, key: &str, found: impl ToString, expected: &str) -> RunError {
        self.job.refuse(key, found.to_string(), expected).into()
    }

    pub(super) fn limits(&self) -> Vec<ResinLimit> {
        let names: Vec<_> = self.materials.resins.iter().map(|resin| resin.name.as_str()).collect();
        let mut limits = self.job.stacking.resin_limits(&names);
        if self.job.dithers(self.object) {
            // A dithered boundary reaches half a voxel up: no voxel of the resin is to come nearer than the limit.
            let reach = self.job.printer.pitch_mm.length() / 2.0;
            let deep = limits.iter_mut().filter(|limit| limit.min_depth_mm > 0.0);
            deep.for_each(|limit| limit.min_depth_mm += reach);
        }
        limits
    }

    /// Whether the layers of the object may be mixtures.
    pub(super) fn may_mix(&self) -> bool {
        self.job.allows_mixtures()
    }

    /// Resins that are printed as themselves.
    pub(super) fn printed_resins(&self) -> Vec<ResinId> {
        self.materials.ids().filter(|resin| !self.materials[*resin].print_as_background).collect()
    }

    /// The id a resin has in voxels: its own, or that of the resin the job prints in place of the background.
    pub(super) fn id(&self, resin: ResinId) -> MaterialId {
        let mapped = self.job.output.map_background.as_deref().and_then(|name| self.materials.resin(name));
        match mapped {
            Some((mapped, _)) if self.materials[resin].print_as_background => MaterialId::from_resin(mapped.0),
            _ => MaterialId::from_resin(resin.0),
        }
    }

    /// What is asked of a search: the job's settings, over `core`.
    pub(super) fn match_options(&self, core: ResinId) -> MatchOptions {
        let stacking = &self.job.stacking;
        MatchOptions {
            search: SearchOptions {
                max_thickness_mm: stacking.max_thickness_mm,
                units: stacking.units,
                depth: stacking.depth,
                objective: stacking.objective,
                limits: self.limits(),
                core: Some(core),
                ..SearchOptions::default()
            },
            judge: stacking.judge(),
            layers: self.job.layer_options(self.object),
            mixtures: self.job.allows_mixtures(),
        }
    }

    pub(super) fn search_fault(&self, source: SearchError) -> RunError {
        match source {
            SearchError::Stopped(stopped) => stopped.into(),
            SearchError::NoCoefficients { resin } => self.lacks_coefficients(&resin),
            source => RunError::Search { object: self.job.objects[self.object].mesh.shown(), source },
        }
    }

    pub(super) fn lacks_coefficients(&self, resin: &str) -> RunError {
        let found = format!("\"transport\" with resin {resin}, which is given by profiles");
        self.refuse("stacking.model", found, "resins given by coefficients, or \"km\"")
    }
}
