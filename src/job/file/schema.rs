//! The JSON schema of job files, for editors: taplo and others complete keys by it, and say what each is.
//!
//! Kinds and ranges are those that the reader of each key uses, what keys say of each other is in [`rules`]; words are those of docs/job.md. Tests hold the three
//! against each other: a key that is read and not here, or here and not documented, is none that anyone finds.

use serde_json::{Map, Value, json};

use super::{appearance, object, options, output, output::OutputFormat, ranges as range, rules, target};
use crate::appearance::MeasuredMedium;
use crate::mesh::Unit;
use crate::search::Norm;
use crate::toml_reader::{IntRange, Range};
use crate::voxel::Printer;

/// What a key holds.
#[derive(Debug, Clone)]
pub(super) enum Kind {
    Number(Range),
    Integer(IntRange),
    PowerOfTwo(IntRange),
    Truth,
    Text,
    Name,
    Path,
    Triple(Range),
    /// One number, or one each for red, green and blue light.
    OneOrThree(Range),
    Colour,
    Choice(Vec<String>),
    /// A preset or another word that is checked elsewhere, with those there are.
    Known(Vec<String>),
    /// A path, or an array of them.
    Paths,
    /// An array of paths, or of arrays of them.
    PathLists,
    Choices(Vec<String>),
    /// A table of its own.
    Table(&'static str),
    /// An array of such tables.
    Tables(&'static str),
}

impl Kind {
    /// A word that the type stands with in docs/job.md.
    #[cfg(test)]
    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Number(_) | Self::OneOrThree(_) => "number",
            Self::Integer(_) | Self::PowerOfTwo(_) => "integer",
            Self::Truth => "boolean",
            Self::Text => "text",
            Self::Name | Self::Known(_) => "name",
            Self::Path | Self::Paths => "path",
            Self::Triple(_) => "[x, y, z]",
            Self::Colour => "colour",
            Self::Choice(_) => "\"",
            Self::PathLists | Self::Choices(_) => "array",
            Self::Table(_) | Self::Tables(_) => "table",
        }
    }

    fn schema(&self) -> Value {
        let number = |range: &Range| json!({ "type": "number", "minimum": range.min, "maximum": range.max });
        let triple = |range: &Range| json!({ "type": "array", "items": number(range), "minItems": 3, "maxItems": 3 });
        let path = || json!({ "type": "string", "minLength": 1 });
        match self {
            Self::Number(range) => number(range),
            Self::Integer(range) => json!({ "type": "integer", "minimum": range.min, "maximum": range.max }),
            Self::PowerOfTwo(range) => {
                let powers: Vec<u64> =
                    (0..64).map(|n| 1 << n).filter(|n| (range.min..=range.max).contains(n)).collect();
                json!({ "enum": powers })
            }
            Self::Truth => json!({ "type": "boolean" }),
            Self::Text | Self::Name | Self::Path => path(),
            Self::Triple(range) => triple(range),
            Self::OneOrThree(range) => json!({ "anyOf": [number(range), triple(range)] }),
            Self::Colour => {
                let code = json!({ "type": "string", "pattern": "^\\s*#[0-9A-Fa-f]{6}\\s*$" });
                json!({ "anyOf": [code, triple(&range::ALBEDO)] })
            }
            Self::Choice(words) => json!({ "enum": words }),
            Self::Known(words) => json!({ "enum": words }),
            Self::Paths => json!({ "anyOf": [path(), { "type": "array", "items": path(), "minItems": 1 }] }),
            Self::PathLists => {
                let list = json!({ "type": "array", "items": path(), "minItems": 1 });
                json!({ "type": "array", "items": { "anyOf": [path(), list] }, "minItems": 1 })
            }
            Self::Choices(words) => {
                json!({ "type": "array", "items": { "enum": words }, "minItems": 1, "uniqueItems": true })
            }
            Self::Table(name) => json!({ "$ref": format!("#/definitions/{name}") }),
            Self::Tables(name) => {
                json!({ "type": "array", "items": { "$ref": format!("#/definitions/{name}") }, "minItems": 1 })
            }
        }
    }
}

/// A table of a job.
pub(super) struct TableSchema {
    pub(super) name: &'static str,
    /// The heading that its keys stand under in docs/job.md.
    pub(super) heading: &'static str,
    /// The keys that its reader takes.
    #[cfg(test)]
    pub(super) read: Vec<&'static str>,
    pub(super) keys: Vec<(&'static str, Kind)>,
    required: &'static [&'static str],
}

fn words<T>(choices: &[(&str, T)]) -> Vec<String> {
    choices.iter().map(|(word, _)| (*word).to_owned()).collect()
}

fn choice(words: &[&str]) -> Kind {
    Kind::Choice(words.iter().map(|word| (*word).to_owned()).collect())
}

/// Every table, the whole job first.
pub(super) fn tables() -> Vec<TableSchema> {
    use Kind::{Colour, Integer, Name, Number, OneOrThree, Path, Table, Tables, Text, Triple, Truth};
    let table = |name, heading, read: &[&'static str], keys, required| {
        #[cfg(not(test))]
        let _ = read;
        TableSchema {
            name,
            heading,
            #[cfg(test)]
            read: read.to_vec(),
            keys,
            required,
        }
    };
    let of_kinds: Vec<&str> = target::KINDS.iter().flat_map(|(_, keys)| *keys).copied().chain(["kind"]).collect();
    let presets = Printer::presets().into_iter().map(|printer| printer.name).collect();
    let formats = words(&OutputFormat::ALL);
    vec![
        table(
            "job",
            "# The job file",
            super::ROOT_KEYS,
            vec![
                ("object", Tables("object")),
                ("printer", Table("printer")),
                ("materials", Table("materials")),
                ("target", Table("target")),
                ("clusters", Table("clusters")),
                ("stacking", Table("stacking")),
                ("appearance", Table("appearance")),
                ("field", Table("field")),
                ("output", Table("output")),
                ("overlap", choice(&["refuse", "union"])),
                ("arrange", Truth),
                ("gap-mm", Number(range::GAP)),
            ],
            &["object", "printer", "materials"],
        ),
        table(
            "object",
            "## `[[object]]`",
            object::KEYS,
            vec![
                ("mesh", Path),
                ("unit", Kind::Choice(words(&Unit::ALL))),
                ("scale", Number(range::SCALE)),
                ("height-mm", Number(range::HEIGHT)),
                ("rotate-deg", Triple(range::ANGLE)),
                ("position-mm", Triple(range::POSITION)),
                ("count", Integer(range::COUNT)),
                ("depth-from", Kind::Choice(words(object::DEPTH_FROM))),
                ("target", Table("target")),
            ],
            &["mesh"],
        ),
        table(
            "printer",
            "## `[printer]`",
            options::PRINTER_KEYS,
            vec![
                ("preset", Kind::Known(presets)),
                ("name", Name),
                ("pitch-mm", Triple(range::PITCH)),
                ("tray-mm", Triple(range::TRAY)),
                ("max-colors", Integer(range::COLORS)),
                ("min-slices", Integer(range::SLICES)),
            ],
            &[],
        ),
        table("materials", "## `[materials]`", options::MATERIALS_KEYS, vec![("set", Name), ("file", Path)], &[]),
        table(
            "target",
            "## `[target]`",
            &of_kinds,
            vec![
                ("kind", Kind::Choice(words(target::KINDS))),
                ("gamut-map", Truth),
                ("stack", Text),
                ("profile", Kind::Paths),
                ("preset", Kind::Known(MeasuredMedium::names().map(str::to_owned).collect())),
                ("albedo", Path),
                ("albedo-value", Number(range::ALBEDO)),
                ("albedo-colour", Colour),
                ("mean-free-path", Path),
                ("mean-free-path-mm", OneOrThree(range::MEAN_FREE_PATH)),
                ("subsurface-colour", Colour),
                ("subsurface-radius-mm", OneOrThree(range::MEAN_FREE_PATH)),
                ("subsurface-scale", OneOrThree(range::SUBSURFACE_SCALE)),
                ("subsurface-anisotropy", Number(range::ANISOTROPY)),
                ("projection", choice(&["uv", "triplanar"])),
                ("tile-mm", Number(range::TILE)),
                ("max-albedo", Number(range::MAX_ALBEDO)),
                ("labels", Path),
                ("profiles", Kind::PathLists),
                ("map", Path),
            ],
            &[],
        ),
        table(
            "clusters",
            "## `[clusters]`",
            options::CLUSTERS_KEYS,
            vec![("k", Integer(range::CLUSTERS)), ("seed", Integer(range::SEED))],
            &[],
        ),
        table(
            "stacking",
            "## `[stacking]`",
            options::STACKING_KEYS,
            vec![
                ("max-thickness-mm", Number(range::MAX_THICKNESS)),
                ("units", Kind::PowerOfTwo(range::UNITS)),
                ("depth", Integer(range::DEPTH)),
                ("objective", Kind::Choice(words(&Norm::ALL))),
                ("dc-weight", Number(range::DC_WEIGHT)),
                ("model", choice(&["km", "transport"])),
                ("min-layer-mm", Number(range::PITCH)),
                ("layer-step-mm", Number(range::PITCH)),
                ("core", Name),
                ("limit", Tables("limit")),
                ("mixtures", Truth),
            ],
            &[],
        ),
        table(
            "limit",
            "### `[[stacking.limit]]`",
            options::LIMIT_KEYS,
            vec![
                ("resin", Name),
                ("min-depth-mm", Number(range::LIMIT_DEPTH)),
                ("min-mm", Number(range::LIMIT_MIN)),
                ("max-mm", Number(range::LIMIT_MAX)),
            ],
            &["resin"],
        ),
        table(
            "appearance",
            "## `[appearance]`",
            appearance::APPEARANCE_KEYS,
            vec![("rounds", Integer(range::ROUNDS)), ("thin-parts", Truth)],
            &[],
        ),
        table(
            "field",
            "## `[field]`",
            options::FIELD_KEYS,
            vec![
                ("distance", choice(&["exact", "grid", "lp"])),
                ("lp-exponent", Number(range::LP_EXPONENT)),
                ("dither", Truth),
            ],
            &[],
        ),
        table(
            "output",
            "## `[output]`",
            output::OUTPUT_KEYS,
            vec![
                ("formats", Kind::Choices(formats)),
                ("volumes", Kind::Choice(words(&output::VolumeValues::ALL))),
                ("mesh-pitch-mm", Number(range::PITCH)),
                ("mesh-error-mm", Number(range::MESH_ERROR)),
                ("background-as", Name),
            ],
            &[],
        ),
    ]
}

/// docs/job.md.
const PAGE: &str = include_str!("../../../docs/job.md");

/// The row of a key under a heading of docs/job.md: type and meaning.
pub(super) fn documented(heading: &str, key: &str) -> Option<[&'static str; 2]> {
    let start = PAGE.find(&format!("{heading}\n"))? + heading.len();
    let level = heading.bytes().take_while(|&byte| byte == b'#').count();
    let section = PAGE[start..].lines();
    let ends = |line: &str| {
        let marks = line.bytes().take_while(|&byte| byte == b'#').count();
        (1..=level).contains(&marks) && line.as_bytes().get(marks) == Some(&b' ')
    };
    let mut rows = section.take_while(|line| !ends(line)).filter(|line| line.starts_with(&format!("| `{key}` |")));
    let cells: Vec<_> = rows.next()?.trim_matches('|').split(" | ").map(str::trim).collect();
    Some([cells.get(1)?, cells.last()?])
}

/// The JSON schema of job files, draft 7.
pub fn schema() -> Value {
    let mut definitions = Map::new();
    for table in tables() {
        let mut properties = Map::new();
        for (key, kind) in &table.keys {
            let mut schema = kind.schema();
            if let (Some([_, meaning]), Some(schema)) = (documented(table.heading, key), schema.as_object_mut()) {
                schema.insert("description".to_owned(), meaning.into());
            }
            properties.insert((*key).to_owned(), schema);
        }
        let mut schema = json!({ "type": "object", "additionalProperties": false, "properties": properties });
        if !table.required.is_empty() {
            schema["required"] = json!(table.required);
        }
        let rules = rules::of(table.name);
        if !rules.is_empty() {
            schema["allOf"] = rules.into();
        }
        definitions.insert(table.name.to_owned(), schema);
    }
    let mut root = json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A lumislice job",
    });
    if let (Some(root), Some(Value::Object(job))) = (root.as_object_mut(), definitions.remove("job")) {
        root.extend(job);
        root.insert("definitions".to_owned(), definitions.into());
    }
    root
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_schema_has_the_keys_that_are_read() {
        for table in tables() {
            let known: BTreeSet<_> = table.keys.iter().map(|(key, _)| *key).collect();
            let read: BTreeSet<_> = table.read.iter().copied().collect();
            assert_eq!(known, read, "keys of {} in schema.rs, and those that are read", table.name);
            assert_eq!(known.len(), table.keys.len(), "{}: a key twice", table.name);
        }
    }

    /// Every key has a row below its table's heading, whose type is the one that is read.
    #[test]
    fn the_documentation_has_the_types_that_are_read() {
        for table in tables() {
            for (key, kind) in table.keys.iter().filter(|(_, kind)| !matches!(kind, Kind::Table(_) | Kind::Tables(_))) {
                let row = documented(table.heading, key);
                let [found, meaning] =
                    row.unwrap_or_else(|| panic!("{}: docs/job.md has no row for {key}", table.name));
                assert!(found.contains(kind.word()), "{}.{key}: {found} in docs/job.md, {kind:?} here", table.name);
                assert!(meaning.len() > 10, "{}.{key}: {meaning}", table.name);
                if let Kind::Choice(words) = kind {
                    assert!(words.iter().all(|word| found.contains(&format!("\"{word}\""))), "{key}: {found}");
                }
            }
        }
    }

    #[test]
    fn the_schema_refers_to_what_it_defines() {
        let schema = schema();
        let text = schema.to_string();
        let definitions = schema["definitions"].as_object().unwrap();
        for name in text.split("#/definitions/").skip(1).map(|rest| rest.split('"').next().unwrap()) {
            assert!(definitions.contains_key(name), "{name}");
        }
        assert_eq!(schema["properties"]["object"]["items"]["$ref"], "#/definitions/object");
        assert_eq!(schema["definitions"]["object"]["properties"]["height-mm"]["maximum"], 2000.0);
    }
}
