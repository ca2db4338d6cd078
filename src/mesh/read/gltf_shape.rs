//! What moves glTF's vertices before any animation: nodes, default morph weights, joints.

use glam::{DMat4, DQuat, DVec3};
use gltf::mesh::Primitive;
use gltf::scene::Transform;
use gltf::{Document, Node, Semantic, Skin};

use super::accessor;
use super::gltf::one_each;
use crate::mesh::error::{Fault, Parsed};

/// A node's own transform. A rotation that is no unit quaternion by more than rounding is made one; the length of it
/// would scale.
pub(super) fn local(node: &Node) -> DMat4 {
    if let (true, Transform::Decomposed { translation, rotation, scale }) = (is_off_unit(node), node.transform()) {
        let rotation = DQuat::from_array(rotation.map(f64::from)).normalize();
        // A rotation of no length turns nothing.
        let rotation = if rotation.is_finite() { rotation } else { DQuat::IDENTITY };
        let [scale, translation] = [scale, translation].map(|v| DVec3::from(v.map(f64::from)));
        return DMat4::from_scale_rotation_translation(scale, rotation, translation);
    }
    DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)))
}

/// Whether a node's rotation is no unit quaternion by more than rounding.
pub(super) fn is_off_unit(node: &Node) -> bool {
    match node.transform() {
        Transform::Matrix { .. } => false,
        Transform::Decomposed { rotation, .. } => {
            (DQuat::from_array(rotation.map(f64::from)).length_squared() - 1.0).abs() > 1e-3
        }
    }
}

/// Transforms of all nodes to the scene. Nodes that are their own ancestors, which no walk reaches, keep the identity.
pub(super) fn globals(document: &Document) -> Vec<DMat4> {
    let nodes: Vec<Node> = document.nodes().collect();
    let mut has_parent = vec![false; nodes.len()];
    nodes.iter().flat_map(Node::children).for_each(|child| has_parent[child.index()] = true);
    let mut globals = vec![DMat4::IDENTITY; nodes.len()];
    let mut seen = vec![false; nodes.len()];
    let mut open: Vec<(usize, DMat4)> =
        (0..nodes.len()).filter(|&n| !has_parent[n]).map(|n| (n, DMat4::IDENTITY)).collect();
    while let Some((n, parent)) = open.pop() {
        if !std::mem::replace(&mut seen[n], true) {
            globals[n] = parent * local(&nodes[n]);
            open.extend(nodes[n].children().map(|child| (child.index(), globals[n])));
        }
    }
    globals
}

/// Adds the morph targets' displacements, by their default weights (glTF 2.0, section 3.7.2.2).
pub(super) fn morph(
    primitive: &Primitive,
    weights: &[f32],
    buffers: &[Vec<u8>],
    points: &mut [[f64; 3]],
) -> Parsed<()> {
    for (target, &weight) in primitive.morph_targets().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        let Some(positions) = target.positions() else { continue };
        let displacements = accessor::vectors::<3>(&positions, buffers)?;
        one_each(&positions, displacements.len(), points.len(), "displacements")?;
        for (point, displacement) in points.iter_mut().zip(displacements) {
            *point = (DVec3::from(*point) + f64::from(weight) * DVec3::from(displacement)).to_array();
        }
    }
    Ok(())
}

/// The joints of a skin as they stand: what each does to a vertex bound to it.
pub(super) struct Pose {
    joints: Vec<DMat4>,
}

impl Pose {
    pub(super) fn new(skin: &Skin, globals: &[DMat4], buffers: &[Vec<u8>]) -> Parsed<Self> {
        let inverse_binds: Vec<[f64; 16]> = match skin.inverse_bind_matrices() {
            Some(accessor) => {
                let matrices = accessor::vectors::<16>(&accessor, buffers)?;
                one_each(&accessor, matrices.len(), skin.joints().count(), "inverse bind matrices")?;
                matrices
            }
            None => Vec::new(),
        };
        let joint = |(i, joint): (usize, Node)| {
            let unbind = inverse_binds.get(i).map_or(DMat4::IDENTITY, DMat4::from_cols_array);
            globals[joint.index()] * unbind
        };
        Ok(Self { joints: skin.joints().enumerate().map(joint).collect() })
    }

    /// What is done to every vertex of a primitive; nothing where it has no joints (glTF 2.0, section 3.7.3.3).
    pub(super) fn of(&self, primitive: &Primitive, vertices: usize, buffers: &[Vec<u8>]) -> Parsed<Option<Vec<DMat4>>> {
        let mut sums = vec![(DMat4::ZERO, 0.0); vertices];
        let mut is_bound = false;
        for set in 0.. {
            let pair = (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)));
            let (Some(joints), Some(weights)) = pair else { break };
            is_bound = true;
            let (joint_values, weight_values) =
                (accessor::vectors::<4>(&joints, buffers)?, accessor::vectors::<4>(&weights, buffers)?);
            one_each(&joints, joint_values.len(), vertices, "sets of joints")?;
            one_each(&weights, weight_values.len(), vertices, "sets of weights")?;
            for (v, sum) in sums.iter_mut().enumerate() {
                for (joint, weight) in joint_values[v].into_iter().zip(weight_values[v]).filter(|(_, w)| *w != 0.0) {
                    let Some(matrix) = self.joints.get(joint as usize) else {
                        let place = format!("accessor {}, vertex {v}", joints.index());
                        let expected = format!("an index below {}", self.joints.len());
                        return Err(Fault::new(place, format!("joint {joint}"), expected));
                    };
                    *sum = (sum.0 + *matrix * weight, sum.1 + weight);
                }
            }
        }
        // Weights should sum to 1; a vertex without any follows the first joint, as in three.js.
        let first = self.joints.first().copied().unwrap_or(DMat4::IDENTITY);
        let settled = |(matrix, weight): (DMat4, f64)| if weight > 0.0 { matrix * (1.0 / weight) } else { first };
        Ok(is_bound.then(|| sums.into_iter().map(settled).collect()))
    }
}
