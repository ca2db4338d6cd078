//! `stackings.json`: its digest, and that it holds what the manifest repeats.

use serde::Deserialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::{Check, Finding, files::Sound, image::read_all};
use crate::{
    job::{StackingReport, manifest::STACKINGS},
    words::hex,
};

/// Longest file that is read, bytes: 65,535 stackings of a few hundred bytes for each of some objects.
const MAX_BYTES: u64 = 256 << 20;

#[derive(Deserialize)]
struct Stackings {
    sha256: String,
    objects: Vec<Value>,
}

pub(super) fn check(check: &Check<'_>, sound: &Sound<'_>) -> Option<Finding> {
    if !check.manifest.files.iter().any(|file| file.path == STACKINGS) {
        return Some(Finding::new(STACKINGS, "not listed, expected the stackings of the job"));
    }
    if !sound.contains(STACKINGS) {
        return None; // `files` has said why
    }
    compare(check).err().map(|problem| Finding::new(STACKINGS, problem))
}

fn compare(check: &Check<'_>) -> Result<(), String> {
    let bytes = read_all(check.open(STACKINGS)?, MAX_BYTES)?;
    let found: Stackings = serde_json::from_slice(&bytes).map_err(|error| format!("cannot be read: {error}"))?;
    let manifest = check.manifest;
    let content = json!({ "job": manifest.job, "inputs": manifest.inputs, "objects": found.objects });
    let digest = hex(&Sha256::digest(content.to_string().as_bytes()));
    if digest != found.sha256 {
        return Err(format!("found SHA-256 {digest} over job, inputs and stackings, expected {}", found.sha256));
    }
    let stackings: Vec<StackingReport> = serde_json::from_value(Value::Array(found.objects))
        .map_err(|error| format!("objects cannot be read: {error}"))?;
    if stackings != manifest.stackings {
        return Err("found stackings that differ from those of the manifest, expected the same".to_owned());
    }
    Ok(())
}
