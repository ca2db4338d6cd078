//! glTF's JSON: its version, its extensions, and what of it has to be right.

use std::collections::BTreeSet;

use gltf::json::validation::Checked;
use gltf::{Document, Semantic};
use serde_json::Value;

use super::gltf_container::{self, CONVERTED};
use super::gltf_tidy;
use super::raw::RawMesh;
use super::support::{self, Fate};
use crate::mesh::error::{Fault, Parsed, quote};
use crate::words::one_line;

/// The document, of whose JSON only what concerns a shape has to be right.
pub(super) fn document(json: &[u8], raw: &mut RawMesh) -> Parsed<Document> {
    let mut checked = |read: Result<gltf::json::Root, String>| -> Parsed<Document> {
        let mut root = read.map_err(|error| Fault::new("the JSON part", one_line(error), "a glTF 2.0 document"))?;
        check_version_of(&root.asset.version)?;
        let warnings = check_extensions(&mut root)?;
        check_position_accessors(&root)?;
        let document = Document::from_json(root)
            .map_err(|error| Fault::new("the JSON part", one_line(error), "a valid glTF 2.0 document"))?;
        raw.warnings.extend(warnings);
        Ok(document)
    };
    let document = checked(root(json));
    let Some(mut untidy) = document.is_err().then(|| serde_json::from_slice(json).ok()).flatten() else {
        return document;
    };
    check_version(&untidy)?;
    match gltf_tidy::tidy(&mut untidy) {
        true => {
            // Places in what was tidied are none of the file's.
            let placeless = |error: String| error.rsplit_once(" at line ").map_or(error.clone(), |at| at.0.to_owned());
            checked(root(untidy.to_string().as_bytes()).map_err(placeless))
        }
        false => document,
    }
}

/// The document as it is written, read by what the crate has compiled: its types read themselves by generic code, of
/// which there is as much as of all else that is read from JSON here.
fn root(json: &[u8]) -> Result<gltf::json::Root, String> {
    // What begins like a GLB is none within one.
    if json.starts_with(gltf_container::MAGIC) {
        return Err("expected value at line 1 column 1".into());
    }
    let read = gltf::Gltf::from_slice_without_validation(json).map_err(|error| error.to_string())?;
    Ok(read.document.into_json())
}

/// Says that colours and coordinates of the morph targets in `shown` are lost: the crate passes them over.
pub(super) fn note_unread_morphs(json: &[u8], shown: &BTreeSet<ShownTarget>, raw: &mut RawMesh) {
    if shown.is_empty() {
        return;
    }
    let Ok(value) = serde_json::from_slice::<Value>(json) else { return };
    for (m, mesh) in list(&value, "meshes").enumerate() {
        for primitive in list(mesh, "primitives") {
            let targets = list(primitive, "targets").enumerate();
            let moving = targets.filter(|&(target, _)| shown.contains(&ShownTarget { mesh: m, target }));
            let mut names = moving.filter_map(|(_, target)| target.as_object()).flat_map(|target| target.keys());
            let unread = names.find(|name| ["COLOR_", "TEXCOORD_"].iter().any(|start| name.starts_with(start)));
            if let Some(name) = unread {
                raw.lose_color(format!("the {name} of morph targets is not read, and default weights show it"));
                return;
            }
        }
    }
}

/// A morph target, of every primitive of a mesh, that has a weight somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ShownTarget {
    /// Index of the mesh.
    pub(super) mesh: usize,
    /// Index of the target in its primitives.
    pub(super) target: usize,
}

/// What stands in a list of this name.
fn list<'a>(of: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> + use<'a> {
    of.get(name).and_then(Value::as_array).into_iter().flatten()
}

/// Refuses what is required and not read, by its exact name, and names what is in use, changes shape or colour and is
/// not read.
fn check_extensions(root: &mut gltf::json::Root) -> Parsed<Vec<String>> {
    let fate = |name: &str| support::fate("glTF", name).unwrap_or(Fate::Warned);
    let refused = root.extensions_required.iter().find(|name| matches!(fate(name), Fate::Warned | Fate::Refused));
    if let Some(name) = refused {
        let found = format!("required extension {}", quote(name.as_bytes()));
        return Err(Fault::new(
            "extensionsRequired",
            found,
            "only extensions that formats.md lists as read or ignored",
        ));
    }
    // All that is left is ours to answer for.
    root.extensions_required.clear();
    let too_new = |version: &str| match version.split_once('.') {
        Some((major, minor)) => !matches!((major, minor), ("0" | "1", _) | ("2", "0")),
        None => !matches!(version, "0" | "1" | "2"),
    };
    if let Some(version) = root.asset.min_version.as_deref().filter(|version| too_new(version)) {
        let found = format!("minVersion {}", quote(version.as_bytes()));
        return Err(Fault::new("asset", found, "at most 2.0, which is what is read: export it as glTF 2.0"));
    }
    let unread = root.extensions_used.iter().filter(|name| fate(name) == Fate::Warned);
    let said = |name: &String| {
        let name = quote(name.as_bytes());
        format!("extension {name} is in use and not read: what it says of shape or colour is missing")
    };
    Ok(unread.map(said).collect())
}

/// Refuses a document that is not glTF 2.0.
fn check_version(document: &Value) -> Parsed<()> {
    let stated = document.get("asset").and_then(|asset| asset.get("version"));
    // Later versions number their parts.
    let names_parts =
        ["meshes", "nodes", "accessors"].iter().any(|part| document.get(part).is_some_and(Value::is_object));
    match stated {
        Some(Value::String(version)) => check_version_of(version),
        Some(number) => check_version_of(&number.to_string()),
        None if names_parts => {
            let found = "no version, and parts with names, as glTF 0.8 and 1.0 have them";
            Err(Fault::new("asset", found, CONVERTED))
        }
        None => Err(Fault::new("asset", "no version", "`\"version\": \"2.0\"`, as every glTF 2.0 document has it")),
    }
}

/// Refuses any version but 2.0 and those that go on from it.
fn check_version_of(version: &str) -> Parsed<()> {
    let expected = match version.split('.').next() {
        Some("2") => return Ok(()),
        Some("0" | "1") => CONVERTED,
        _ => "version 2.0: export it as glTF 2.0",
    };
    Err(Fault::new("asset", format!("glTF version {}", quote(version.as_bytes())), expected))
}

/// gltf-json 1.4.1 validates everything but looks positions up before it has checked their index, and panics.
fn check_position_accessors(root: &gltf::json::Root) -> Parsed<()> {
    let count = root.accessors.len();
    for (m, mesh) in root.meshes.iter().enumerate() {
        for attributes in mesh.primitives.iter().map(|primitive| &primitive.attributes) {
            if let Some(index) = attributes.get(&Checked::Valid(Semantic::Positions)).filter(|i| i.value() >= count) {
                let found = format!("POSITION accessor {}", index.value());
                return Err(Fault::new(format!("mesh {m}"), found, format!("an index below {count}")));
            }
        }
    }
    Ok(())
}
