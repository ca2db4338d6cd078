//! JSON schema, draft 7, as far as ours use it. A keyword that is not here is a panic, not a pass.

use serde_json::{Map, Value};

/// Where and how `value` is not what `schema` has; empty where it is. `root` is the document that references are in.
pub fn breaches(root: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    let Some(rules) = schema.as_object() else { panic!("a schema that is no object: {schema}") };
    for (keyword, rule) in rules {
        if !holds(root, keyword, rule, rules, value) {
            found.push(format!("{keyword} {rule}: {value}"));
        }
    }
    found
}

fn holds(root: &Value, keyword: &str, rule: &Value, rules: &Map<String, Value>, value: &Value) -> bool {
    let is = |schema: &Value, value: &Value| breaches(root, schema, value).is_empty();
    let all = || rule.as_array().unwrap().iter();
    let number =
        |compare: fn(f64, f64) -> bool| value.as_f64().is_none_or(|value| compare(value, rule.as_f64().unwrap()));
    let count = |compare: fn(usize, usize) -> bool| {
        let length = value.as_array().map(Vec::len).or(value.as_str().map(|text| text.chars().count()));
        length.is_none_or(|length| compare(length, rule.as_u64().unwrap() as usize))
    };
    match keyword {
        "$schema" | "$id" | "title" | "description" | "definitions" | "then" | "additionalProperties" => true,
        "$ref" => {
            let place = rule.as_str().unwrap().strip_prefix('#').unwrap();
            is(root.pointer(place).unwrap_or_else(|| panic!("{place}")), value)
        }
        "type" => match rule {
            Value::Array(types) => types.iter().any(|one| is_of(one.as_str().unwrap(), value)),
            one => is_of(one.as_str().unwrap(), value),
        },
        "const" => rule == value,
        "enum" => all().any(|one| one == value),
        "anyOf" => all().any(|one| is(one, value)),
        "allOf" => all().all(|one| is(one, value)),
        "oneOf" => all().filter(|one| is(one, value)).count() == 1,
        "not" => !is(rule, value),
        "if" => !is(rule, value) || is(&rules["then"], value),
        "minimum" => number(|value, least| value >= least),
        "maximum" => number(|value, most| value <= most),
        "minLength" | "minItems" => count(|length, least| length >= least),
        "maxItems" => count(|length, most| length <= most),
        "items" => value.as_array().is_none_or(|items| items.iter().all(|item| is(rule, item))),
        "contains" => value.as_array().is_none_or(|items| items.iter().any(|item| is(rule, item))),
        "uniqueItems" => {
            value.as_array().is_none_or(|items| items.iter().enumerate().all(|(n, item)| !items[..n].contains(item)))
        }
        "required" => value.as_object().is_none_or(|table| all().all(|key| table.contains_key(key.as_str().unwrap()))),
        "propertyNames" => value.as_object().is_none_or(|table| table.keys().all(|key| is(rule, &key.as_str().into()))),
        "properties" => value.as_object().is_none_or(|table| {
            let known = rule.as_object().unwrap();
            let closed = rules.get("additionalProperties") == Some(&Value::Bool(false));
            let fits = |(key, value): (&String, &Value)| known.get(key).map_or(!closed, |schema| is(schema, value));
            table.iter().all(fits)
        }),
        // Of colours alone, which no test of rules spoils.
        "pattern" => true,
        _ => panic!("{keyword} is no keyword that is known here"),
    }
}

fn is_of(kind: &str, value: &Value) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
        _ => panic!("{kind} is no type"),
    }
}
