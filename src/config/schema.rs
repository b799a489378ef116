//! The table of keys as a JSON Schema: for editors, and for whoever writes configurations by a program.
//!
//! A schema cannot compare two values: that `min_range_m` must not exceed `max_range_m` is said in words alone.

use super::Config;
use super::keys::{Key, keys};
use super::shape::Shape;
use serde_json::{Map, Value, json};

/// The schema (draft 2020-12).
#[must_use]
pub fn schema() -> Value {
    let mut schema = table(&keys(), Some(&Config::default().to_table()));
    let head = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "slamd",
        "description": "The configuration of slamd; every key may be left out.",
    });
    add(&mut schema, head);
    schema.into()
}

/// A table's schema; its keys' defaults are those of `defaults`.
fn table(keys: &[Key], defaults: Option<&toml::Table>) -> Map<String, Value> {
    let property = |key: &Key| (key.name.to_owned(), of(key, defaults.and_then(|defaults| defaults.get(key.name))));
    let properties: Map<String, Value> = keys.iter().map(property).collect();
    let mut schema = Map::new();
    add(&mut schema, json!({ "type": "object", "additionalProperties": false, "properties": properties }));
    let required: Vec<&str> = keys.iter().filter(|key| key.is_required).map(|key| key.name).collect();
    if !required.is_empty() {
        add(&mut schema, json!({ "required": required }));
    }
    for (key, other) in keys.iter().filter_map(|key| Some((key.name, key.instead_of?))) {
        // An empty list is none.
        let both = json!({ "required": [key, other], "properties": { key: { "minItems": 1 } } });
        add(&mut schema, json!({ "not": both }));
    }
    schema
}

fn of(key: &Key, default: Option<&toml::Value>) -> Value {
    let mut schema = match &key.shape {
        Shape::Text => json!({ "type": "string" }),
        Shape::Choice(names) => json!({ "type": "string", "enum": names }),
        Shape::Flag => json!({ "type": "boolean" }),
        Shape::Switch => json!({ "type": ["boolean", "integer"], "minimum": 0, "maximum": 1 }),
        Shape::Whole(least, most) => json!({ "type": "integer", "minimum": least, "maximum": most }),
        Shape::Number(least, most) => json!({ "type": "number", "minimum": least, "maximum": most }),
        Shape::Table(keys) => table(keys, default.and_then(toml::Value::as_table)).into(),
        Shape::List(keys, most) => json!({ "type": "array", "maxItems": most, "items": table(keys, None) }),
    };
    let about = key.at_most.map_or_else(|| key.about.into(), |other| format!("{} At most {other}.", key.about));
    if let Some(schema) = schema.as_object_mut() {
        add(schema, json!({ "description": about }));
        // A table's defaults stand at its keys.
        if let Some(default) = default.filter(|default| !default.is_table()) {
            add(schema, json!({ "default": default }));
        }
    }
    schema
}

fn add(schema: &mut Map<String, Value>, more: Value) {
    if let Value::Object(more) = more {
        schema.extend(more);
    }
}
