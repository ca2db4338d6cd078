//! Keys that contradict each other: the reader and the JSON schema refuse the same, and take the same.

use lumislice::job::{Job, file::schema};
use serde_json::Value;

use super::inputs;
use crate::json_schema::breaches;

const CASES: &str = include_str!("contradictions.toml");

/// A job of the usual parts, but for those that `others` has.
fn job(parts: &toml::Table, others: &toml::Value) -> String {
    let part = |name: &str| others.get(name).or(parts.get(name)).and_then(toml::Value::as_str).unwrap_or_default();
    let tables = parts.keys().filter(|name| !["root", "object"].contains(&name.as_str()));
    let tables: String = tables.map(|name| format!("[{name}]\n{}\n", part(name))).collect();
    format!("{}\n[[object]]\n{}\n{tables}", part("root"), part("object"))
}

#[test]
fn what_the_reader_refuses_the_schema_does() {
    let cases: toml::Table = CASES.parse().unwrap();
    let parts = cases["parts"].as_table().unwrap();
    let (schema, folder) = (schema(), inputs());
    let mut wrong = String::new();
    for pair in cases["pair"].as_array().unwrap() {
        for (which, taken) in [("taken", true), ("refused", false)] {
            let text = job(parts, &pair[which]);
            let read = Job::from_toml(&text, "job.toml", folder.path());
            let document: Value = toml::from_str(&text).unwrap();
            let broken = breaches(&schema, &schema, &document);
            if read.is_ok() != taken || broken.is_empty() != taken {
                let read = read.map_or_else(|error| error.to_string(), |_| "read".to_owned());
                wrong += &format!("{}, {which}: {read}; schema: {broken:?}\n", pair["about"]);
            }
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

/// Good jobs are good by the schema.
#[test]
fn the_samples_keep_the_schema() {
    let schema = schema();
    for entry in std::fs::read_dir("samples").unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        if path.extension().is_some_and(|extension| extension == "toml") && text.contains("[[object]]") {
            let document: Value = toml::from_str(&text).unwrap();
            let broken = breaches(&schema, &schema, &document);
            assert!(broken.is_empty(), "{}: {broken:?}", path.display());
        }
    }
}
