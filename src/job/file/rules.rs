//! What the reader refuses of keys that are good by themselves, in the words of JSON schema draft 7.
//!
//! Left to the reader: that `min-mm` is below `max-mm`, that no resin has two limits, that a tray holds a voxel, and
//! whatever asks for a file.

use serde_json::{Value, json};

use super::{output::OutputFormat, target, texture};

/// What a table of that name has to keep, each a schema of its own.
pub(super) fn of(table: &str) -> Vec<Value> {
    match table {
        "job" => of_job(),
        "object" => vec![not_both("scale", "height-mm")],
        "printer" => vec![
            json!({ "anyOf": [has("preset"), has("pitch-mm")] }),
            not_both("preset", "pitch-mm"),
            not_both("preset", "name"),
        ],
        "materials" => vec![json!({ "oneOf": [has("set"), has("file")] })],
        "target" => of_target(),
        "stacking" => {
            let by_km = is("model", &json!("km"));
            let unused = ["min-layer-mm", "layer-step-mm"].map(|key| not_with(has(key), by_km.clone()));
            let mixtures = is("mixtures", &json!(true));
            let whole = [by_km, has("layer-step-mm")].map(|whole| not_with(mixtures.clone(), whole));
            unused.into_iter().chain(whole).collect()
        }
        "field" => vec![
            needs(has("lp-exponent"), is("distance", &json!("lp"))),
            not_with(
                is("dither", &json!(true)),
                json!({
                    "required": ["distance"],
                    "properties": { "distance": { "not": { "const": "exact" } } },
                }),
            ),
        ],
        "output" => {
            let volumes = formats_that(OutputFormat::is_volume);
            let written = json!({
                "required": ["formats"],
                "properties": { "formats": { "contains": { "enum": volumes } } },
            });
            vec![needs(has("volumes"), written)]
        }
        _ => Vec::new(),
    }
}

fn formats_that(is_such: impl Fn(OutputFormat) -> bool) -> Vec<&'static str> {
    OutputFormat::ALL.iter().filter(|(_, format)| is_such(*format)).map(|(name, _)| *name).collect()
}

/// What tables say of each other.
fn of_job() -> Vec<Value> {
    let arranged = is("arrange", &json!(true));
    let objects = |some: Value| json!({ "required": ["object"], "properties": { "object": { "contains": some } } });
    let several = json!({ "required": ["count"], "properties": { "count": { "minimum": 2 } } });
    let within = |table: &str, rule: Value| json!({ "required": [table], "properties": { table: rule } });
    let by_km = within("stacking", is("model", &json!("km")));
    let rounds = json!({ "required": ["rounds"], "properties": { "rounds": { "minimum": 1 } } });
    let no_voxels = formats_that(|format| !format.holds_voxels() && format != OutputFormat::Masks);
    let meshes = json!({
        "required": ["formats"],
        "properties": { "formats": { "contains": { "enum": no_voxels } } },
    });
    let own_target = json!({ "properties": { "object": { "items": has("target") } } });
    vec![
        json!({ "anyOf": [has("target"), own_target] }),
        needs(has("gap-mm"), arranged.clone()),
        needs(objects(several), arranged.clone()),
        not_with(objects(has("position-mm")), arranged),
        not_with(within("appearance", rounds), by_km.clone()),
        not_with(within("appearance", is("thin-parts", &json!(true))), by_km),
        not_with(within("output", meshes), within("stacking", is("mixtures", &json!(true)))),
    ]
}

/// A target has the keys of its kind only, and those that its kind cannot do without; a preset is a texture by itself.
fn of_target() -> Vec<Value> {
    let mut rules = vec![json!({ "anyOf": [has("kind"), has("preset")] })];
    for (kind, keys) in target::KINDS {
        let names: Vec<&str> = keys.iter().copied().chain(["kind"]).collect();
        let required = keys.iter().filter(|key| target::REQUIRED.contains(key)).collect::<Vec<_>>();
        rules
            .push(needs(is("kind", &json!(kind)), json!({ "propertyNames": { "enum": names }, "required": required })));
    }
    rules.push(json!({ "anyOf": [has("kind"), { "propertyNames": { "enum": texture::KEYS } }] }));
    for (n, one) in texture::ALBEDOS.iter().enumerate() {
        rules.extend(texture::ALBEDOS[n + 1..].iter().map(|other| not_both(one, other)));
    }
    rules.push(not_both("mean-free-path-mm", "subsurface-radius-mm"));
    let subsurface = ["subsurface-scale", "subsurface-anisotropy"];
    rules.extend(subsurface.map(|key| needs(has(key), has("subsurface-radius-mm"))));
    let of_one_colour = ["albedo-value", "albedo-colour", "subsurface-colour", "preset"].map(has);
    rules.push(needs(has("subsurface-anisotropy"), json!({ "anyOf": of_one_colour, "not": has("albedo") })));
    rules.push(needs(has("tile-mm"), is("projection", &json!("triplanar"))));
    rules
}

fn has(key: &str) -> Value {
    json!({ "required": [key] })
}

fn is(key: &str, value: &Value) -> Value {
    json!({ "required": [key], "properties": { key: { "const": value } } })
}

fn not_both(one: &str, other: &str) -> Value {
    json!({ "not": { "required": [one, other] } })
}

fn not_with(one: Value, other: Value) -> Value {
    json!({ "not": { "allOf": [one, other] } })
}

fn needs(one: Value, other: Value) -> Value {
    json!({ "if": one, "then": other })
}
