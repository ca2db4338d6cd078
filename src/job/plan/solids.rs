//! The meshes of a job as solids on the tray: what is surface of their union, which of them are one body, and texture
//! coordinates for those that have none.

use std::path::PathBuf;

use glam::{DMat4, DVec3};

use super::{arrange::arrange, images::picture_size, object::bounds};
use crate::{
    job::{
        Job, RunError,
        file::{AlbedoSource, DepthFrom, InputPath, ObjectJob, Overlap, Projection, Scaling, TargetSpec},
    },
    mesh::{self, InCommon, LoadOptions, Placement, Size, Solid},
    watch::Watch,
    words::{counted, short},
};

/// Objects of a body that are named.
const NAMED: usize = 2;

/// Objects read and placed: the solid, file coordinates to the lattice's, files read beside the mesh.
type Loaded = Vec<(Solid, DMat4, Vec<PathBuf>)>;

/// Reads all objects and leaves of them what is surface of their union; and which of them touch or share space, by
/// their numbers.
pub(super) fn load_solids(
    job: &Job,
    warnings: &mut Vec<String>,
    watch: &dyn Watch,
) -> Result<(Loaded, Vec<Vec<usize>>), RunError> {
    let mut loaded = Vec::new();
    for (index, object) in job.objects.iter().enumerate() {
        loaded.push(load_solid(job, index, object, warnings)?);
        watch.advance(1);
        watch.go_on()?;
    }
    if let Some(gap_mm) = job.arrange_gap_mm {
        arrange(job, gap_mm, &mut loaded);
    }
    let mut solids: Vec<&mut Solid> = loaded.iter_mut().map(|(solid, ..)| solid).collect();
    let InCommon { space: shared, bodies: touching } = mesh::unite(&mut solids);
    let name = |index: usize| format!("object {} ({})", index + 1, job.objects[index].mesh.shown());
    if let (Some(&[first, second]), Overlap::Refuse) = (shared.first(), job.overlap) {
        let found = format!("{} and {} at the same place", name(first), name(second));
        let expected = "objects that share no space, or overlap = \"union\"";
        return Err(job.refuse(&format!("object[{second}].position-mm"), found, expected).into());
    }
    for &[first, second] in &shared {
        warnings.push(format!(
            "{} and {} share space: they are one body, and a voxel is laid by the one whose face is nearest",
            name(first),
            name(second)
        ));
    }
    for body in bodies(job, &touching) {
        let said = |object: &usize| shared.iter().flatten().any(|other| other == object);
        if !body.iter().all(said) {
            let more = body.len().saturating_sub(NAMED);
            let names: Vec<_> = body.iter().take(NAMED).map(|&object| name(object)).collect();
            let names = if more == 0 { names.join(" and ") } else { names.join(", ") };
            let more = if more == 0 { String::new() } else { format!(" and {}", counted(more, "other")) };
            warnings.push(format!(
                "{names}{more} touch: they are one body, and a voxel is laid by the one whose face is nearest"
            ));
        }
    }
    if let Some(buried) = solids.iter().position(|solid| solid.mesh.triangles.is_empty()) {
        let found = format!("{}, which lies wholly within others", name(buried));
        let expected = "an object some of which can be seen";
        return Err(job.refuse(&format!("object[{buried}].mesh"), found, expected).into());
    }
    Ok((loaded, touching))
}

/// Of objects that touch those that depth is measured from together. Depth from the top is of an object by itself.
pub(super) fn bodies(job: &Job, touching: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let from_surface = |&object: &usize| job.objects[object].depth_from == DepthFrom::Surface;
    let bodies = touching.iter().map(|body| body.iter().copied().filter(from_surface).collect::<Vec<_>>());
    bodies.filter(|body| body.len() > 1).collect()
}

fn load_solid(
    job: &Job,
    index: usize,
    object: &ObjectJob,
    warnings: &mut Vec<String>,
) -> Result<(Solid, DMat4, Vec<PathBuf>), RunError> {
    let loaded = mesh::load(object.mesh.as_ref(), &LoadOptions { unit: object.unit })?;
    let own_color =
        matches!(&object.target, TargetSpec::Texture(texture) if texture.albedo == AlbedoSource::MeshBaseColor);
    if let Some(lost) = loaded.lost_color.filter(|_| own_color) {
        let found = format!("{}: {lost}", object.mesh.shown());
        return Err(job
            .refuse("target", found, "the mesh's own base colour, or an albedo or albedo-value in its place")
            .into());
    }
    let mut warn = |warning: String| warnings.push(format!("{}: {warning}", object.mesh.shown()));
    // Texture files that the mesh names do not matter where the job brings its own.
    loaded.warnings.into_iter().for_each(&mut warn);
    let placement = Placement {
        size: match object.scaling {
            Scaling::Scale(scale) => Size::Scale(scale),
            Scaling::HeightMm(height) => Size::HeightMm(height),
        },
        rotate_deg: DVec3::from(object.rotate_deg),
        position_mm: DVec3::from(object.position_mm),
    };
    let in_file = |source| RunError::Shape { file: object.mesh.as_ref().to_owned(), source };
    let (placed, to_lattice) = mesh::place(loaded.mesh, &placement).map_err(in_file)?;
    let low = placed.positions.iter().fold(DVec3::MAX, |low, p| low.min(*p));
    if low.min_element() < 0.0 {
        let key = format!("object[{index}].position-mm");
        let found = format!("an object from ({}) mm", low.to_array().map(short).join(", "));
        return Err(job.refuse(&key, found, "a position on the tray, 0 or more in x, y and z").into());
    }
    let mut solid = mesh::close(placed).map_err(in_file)?;
    let settled = solid.settle(&placement);
    solid.health.warnings().into_iter().for_each(&mut warn);
    Ok((solid, settled * to_lattice * loaded.file_to_mesh, loaded.companions))
}

/// Gives a mesh without texture coordinates some, for nothing varies within a page then and any will do; whether it had
/// its own. Where the target is made of the mesh's colour, what is not a repeating texture becomes one.
pub(super) fn complete_uvs(solid: &mut Solid, target: &TargetSpec) -> Result<bool, RunError> {
    let had = !solid.mesh.uvs.is_empty();
    solid.mesh.uvs.resize(solid.mesh.triangles.len(), Default::default());
    let TargetSpec::Texture(texture) = target else { return Ok(had) };
    let size = |path: &InputPath| picture_size(path.as_ref());
    let detail = texture.mean_free_path.as_ref().map(size).transpose()?;
    if let Projection::Triplanar { tile_mm } = texture.projection {
        let albedo = if let AlbedoSource::Texture(path) = &texture.albedo { Some(size(path)?) } else { None };
        let widest = detail.into_iter().chain(albedo).map(|(width, _)| width).max();
        let has_albedo = texture.albedo != AlbedoSource::MeshBaseColor || !solid.mesh.materials.is_empty();
        if let Some(widest) = widest.filter(|_| has_albedo) {
            let [low, high] = bounds(solid);
            let tile_mm = tile_mm.unwrap_or((high - low).max_element());
            solid.mesh.bake_projection(tile_mm, f64::from(widest) / tile_mm);
            return Ok(had);
        }
    }
    if texture.albedo == AlbedoSource::MeshBaseColor {
        solid.mesh.bake_base_color(detail);
    }
    Ok(had)
}
