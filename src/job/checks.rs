//! What the user should know of a job that is otherwise in order.

use super::PreparedObject;
use crate::voxel::Lattice;

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
        format!("layers thinner than a voxel {place}: {thin} of the {layers} layers in the stackings found ({stackings})")
    })
}
