//! EXT_mesh_gpu_instancing: one mesh at many places.

use glam::{DMat4, DQuat, DVec3};
use gltf::{Accessor, Document, Node};
use serde_json::Value;

use super::{MAX_TRIANGLES, accessor};
use crate::mesh::error::{Fault, Parsed};

/// How many instances a node has, by the first attribute that tells; `None` for a node that is not instanced.
pub(super) fn count(node: &Node, document: &Document) -> Option<usize> {
    let attributes = node.extension_value("EXT_mesh_gpu_instancing")?.get("attributes")?.as_object()?;
    let accessor = |value: &Value| document.accessors().nth(value.as_u64()? as usize);
    attributes.iter().find_map(|(_, value)| accessor(value)).map(|accessor| accessor.count())
}

/// Transforms of the instances within their node; `None` for a node that is not instanced.
pub(super) fn read(node: &Node, document: &Document, buffers: &[Vec<u8>]) -> Parsed<Option<Vec<DMat4>>> {
    let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return Ok(None) };
    let place = || format!("node {}, EXT_mesh_gpu_instancing", node.index());
    let attribute = |name: &str| -> Parsed<Option<Accessor>> {
        let Some(value) = extension.get("attributes").and_then(|attributes| attributes.get(name)) else {
            return Ok(None);
        };
        match value.as_u64().and_then(|index| document.accessors().nth(index as usize)) {
            Some(accessor) => Ok(Some(accessor)),
            None => {
                let expected = format!("an accessor below {}", document.accessors().len());
                Err(Fault::new(place(), format!("{name} {value}"), expected))
            }
        }
    };
    let translations = attribute("TRANSLATION")?.map(|a| accessor::vectors::<3>(&a, buffers)).transpose()?;
    let rotations = attribute("ROTATION")?.map(|a| accessor::vectors::<4>(&a, buffers)).transpose()?;
    let scales = attribute("SCALE")?.map(|a| accessor::vectors::<3>(&a, buffers)).transpose()?;
    let counts = [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
    // Where nothing moves them, attributes of the application's own tell how many there are.
    let names = extension.get("attributes").and_then(|attributes| attributes.as_object());
    let own = names.into_iter().flatten().map(|(name, _)| name).find(|name| name.starts_with('_'));
    let own = match own.filter(|_| counts == [None; 3]) {
        Some(name) => attribute(name)?.map(|accessor| accessor.count()),
        None => None,
    };
    let mut given = counts.into_iter().chain([own]).flatten();
    let Some(count) = given.next() else {
        return Err(Fault::new(place(), "no TRANSLATION, ROTATION or SCALE", "one of them"));
    };
    if let Some(other) = given.find(|other| *other != count) {
        return Err(Fault::new(place(), format!("attributes of {count} and {other} instances"), "as many of each"));
    }
    if count > MAX_TRIANGLES {
        return Err(Fault::new(place(), format!("{count} instances"), format!("at most {MAX_TRIANGLES}")));
    }
    let instance = |i: usize| {
        let translation = translations.as_ref().map_or(DVec3::ZERO, |list| list[i].into());
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |list| DQuat::from_array(list[i]).normalize());
        let scale = scales.as_ref().map_or(DVec3::ONE, |list| list[i].into());
        // A rotation of no length turns nothing.
        let rotation = if rotation.is_finite() { rotation } else { DQuat::IDENTITY };
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok(Some((0..count).map(instance).collect()))
}
