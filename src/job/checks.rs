//! What the user should know of a job that is otherwise in order.

use super::PreparedObject;
use crate::voxel::Lattice;

/// Counts layers thinner than the coarsest voxel: on walls that face that axis such a layer comes out thicker than it should
/// be, or not at all. `None` if there are none.
pub(super) fn thin_layers(objects: &[PreparedObject], lattice: &Lattice) -> Option<String> {
    let (axis, pitch) = ['x', 'y', 'z'].into_iter().zip(lattice.pitch.to_array()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let stackings = || objects.iter().flat_map(|object| &object.stackings.stackings);
    let layers = || stackings().flat_map(|stacking| &stacking.layers);
    let thin = layers().filter(|layer| layer.thickness_mm < pitch).count();
    let (layers, stackings) = (layers().count(), stackings().count());
    (thin > 0).then(|| {
        format!(
            "{thin} of {layers} layers in {stackings} stackings are thinner than a voxel along {axis} ({pitch:.4} mm) and are \
             not resolved on walls that face {axis}"
        )
    })
}
