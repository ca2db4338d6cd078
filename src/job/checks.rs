//! What the user should know of a job that is otherwise in order.

use super::{Job, JobError, PreparedObject};
use crate::voxel::Lattice;

/// Refuses objects that are shorter than a voxel along every axis, most likely for want of a unit: of such an object next to nothing
/// is printed. Those that are so along some axis only are told in `warnings`.
pub(super) fn tiny_objects(
    job: &Job,
    objects: &[PreparedObject],
    lattice: &Lattice,
    warnings: &mut Vec<String>,
) -> Result<(), JobError> {
    for (index, object) in objects.iter().enumerate() {
        let size = object.bounds[1] - object.bounds[0];
        let short: Vec<_> =
            (0..3).filter(|&axis| size[axis] < lattice.pitch[axis]).map(|axis| ["x", "y", "z"][axis]).collect();
        if short.len() == 3 {
            let found = format!("an object of {:.3e} × {:.3e} × {:.3e} mm", size.x, size.y, size.z);
            let expected = "one larger than a voxel; `unit`, `scale` or `height-mm` set its size";
            return Err(job.refuse(&format!("object[{index}].mesh"), found, expected));
        }
        if !short.is_empty() {
            warnings.push(format!("{}: thinner than a voxel along {}; it may be lost", object.mesh, short.join(", ")));
        }
    }
    Ok(())
}

/// Counts layers thinner than the coarsest voxel: on walls that face that axis such a layer comes out thicker than it should
/// be, or not at all. `None` if there are none.
pub(super) fn thin_layers(objects: &[PreparedObject], lattice: &Lattice) -> Option<String> {
    let pitch = lattice.pitch.max_element();
    // Named where it is one axis that is coarser than the others.
    let coarsest: Vec<_> =
        ['x', 'y', 'z'].into_iter().zip(lattice.pitch.to_array()).filter(|(_, along)| *along == pitch).collect();
    let place = match coarsest.as_slice() {
        [(axis, _)] => format!("along {axis} ({pitch:.4} mm), not resolved on walls that face {axis}"),
        _ => format!("({pitch:.4} mm), not resolved"),
    };
    let stackings = || objects.iter().flat_map(|object| &object.stackings.stackings);
    let layers = || stackings().flat_map(|stacking| &stacking.layers);
    let thin = layers().filter(|layer| layer.thickness_mm < pitch).count();
    let (layers, stackings) = (layers().count(), stackings().count());
    (thin > 0).then(|| {
        format!("layers thinner than a voxel {place}: {thin} of {layers}, counted over all stackings ({stackings})")
    })
}
