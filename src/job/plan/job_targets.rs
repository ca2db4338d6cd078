//! What a job asks of light, without searching for it.

use super::{
    asked::wanted,
    context::TargetContext,
    image_checks,
    placed::{finish_materials, read_materials},
    solids::{complete_uvs, load_solids},
};
use crate::{
    job::{Job, RunError, file::DepthFrom},
    search::SearchTarget,
    watch::Watch,
};

/// A spectrum that a job asks for: a profile, or a cluster of a texture.
#[derive(Debug, Clone, PartialEq)]
pub struct JobTarget {
    /// `cluster 3`, or `object 2, cluster 3` where there are several.
    pub name: String,
    /// Share of the object's surface that wants it, 0 to 1.
    pub share: f64,
    /// Per channel, on the grid of the job's resins.
    pub target: SearchTarget,
}

/// The targets of all objects of `job`, in the order of its stackings; an object whose stacking is given has none.
///
/// # Errors
/// Any input that cannot be used; see [`RunError`].
pub fn targets(job: Job, watch: &dyn Watch) -> Result<Vec<JobTarget>, RunError> {
    let mut warnings = Vec::new();
    let materials = finish_materials(read_materials(&job)?, &job, watch)?;
    let mut targets = Vec::new();
    image_checks::images(&job, &mut warnings)?;
    let (loaded, _) = load_solids(&job, &mut warnings, watch)?;
    for (index, (object, (mut solid, ..))) in job.objects.iter().zip(loaded).enumerate() {
        if object.depth_from == DepthFrom::Top {
            solid.measure_from_top();
        }
        let has_uvs = complete_uvs(&mut solid, &object.target)?;
        let (job, materials, solid) = (&job, &materials, &solid);
        let context = TargetContext { job, materials, solid, body: None, has_uvs, object: index, watch };
        let found = wanted(&context, &object.target, &mut warnings)?;
        for (cluster, (target, share)) in found.targets.into_iter().zip(found.shares).enumerate() {
            let name = match job.objects.len() {
                1 => format!("cluster {cluster}"),
                _ => format!("object {}, cluster {cluster}", index + 1),
            };
            targets.push(JobTarget { name, share, target });
        }
    }
    Ok(targets)
}
