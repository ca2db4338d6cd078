//! Documents that the gltf crate refuses for what says nothing of a shape: application-specific attributes, which begin
//! with `_` (glTF 2.0, section 3.7.2.1), animations of targets that extensions bring, cameras, accessors whose bounds
//! are missing, targets and strides of 0 of buffer views, a version that is a number; and what the crate wants stated
//! that may be left out: the nodes of a scene that has none, the buffer view of an accessor whose values are 0 (section
//! 3.6.2.2).

use std::collections::HashSet;

use serde_json::{Map, Value, json};

/// Takes them out; says whether there were any.
pub(super) fn tidy(document: &mut Value) -> bool {
    let Some(root) = document.as_object_mut() else { return false };
    let mut changed = root.remove("animations").is_some() | root.remove("cameras").is_some();
    for node in items(root, "nodes") {
        changed |= node.remove("camera").is_some();
    }
    for scene in items(root, "scenes").filter(|scene| !scene.contains_key("nodes")) {
        scene.insert("nodes".to_owned(), json!([]));
        changed = true;
    }
    for view in items(root, "bufferViews") {
        let is_zero = |stride: &Value| stride.as_f64() == Some(0.0);
        changed |= view.remove("target").is_some();
        changed |= view.get("byteStride").is_some_and(is_zero) && view.remove("byteStride").is_some();
    }
    if let Some(version) = root.get_mut("asset").and_then(|asset| asset.get_mut("version")).filter(|v| v.is_number()) {
        *version = Value::from(version.to_string());
        changed = true;
    }
    let mut positions = HashSet::new();
    for primitive in items(root, "meshes").flat_map(|mesh| items(mesh, "primitives")) {
        let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) else { continue };
        let before = attributes.len();
        attributes.retain(|name, _| !name.starts_with('_'));
        changed |= attributes.len() < before;
        positions.extend(attributes.get("POSITION").and_then(Value::as_u64));
    }
    // Nothing here is measured by them.
    for (_, accessor) in (0..).zip(items(root, "accessors")).filter(|(i, _)| positions.contains(i)) {
        for bound in ["min", "max"] {
            if !accessor.contains_key(bound) {
                accessor.insert(bound.to_owned(), Value::from(vec![0.0; 3]));
                changed = true;
            }
        }
    }
    // The crate wants values; a sparse part of none leaves all of them 0.
    if items(root, "bufferViews").next().is_some() {
        for accessor in items(root, "accessors") {
            if !accessor.contains_key("bufferView") && !accessor.contains_key("sparse") {
                let nothing = json!({"count": 0, "indices": {"bufferView": 0, "componentType": 5121},
                    "values": {"bufferView": 0}});
                accessor.insert("sparse".to_owned(), nothing);
                changed = true;
            }
        }
    }
    changed
}

/// Objects of a list.
fn items<'a>(of: &'a mut Map<String, Value>, name: &str) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    of.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}
