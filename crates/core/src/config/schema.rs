//! The table of keys as a JSON Schema, for editors and for programs that write configurations.
//!
//! A schema cannot compare two values: only a description says that `min_range_m` must not exceed `max_range_m`.

use super::Config;
use super::keys::{Key, keys};
use super::shape::Shape;
use toml::{Table, Value};

/// The schema (draft 2020-12).
#[must_use]
pub fn schema() -> Table {
    let mut schema = table(&keys(), Some(&Config::default().to_table()));
    schema.extend(object([
        ("$schema", "https://json-schema.org/draft/2020-12/schema".into()),
        ("title", "slamd".into()),
        ("description", "The configuration of slamd; every key may be left out.".into()),
    ]));
    schema
}

/// A table's schema; its keys' defaults are those of `defaults`.
fn table(keys: &[Key], defaults: Option<&toml::Table>) -> Table {
    let property = |key: &Key| (key.name.to_owned(), of(key, defaults.and_then(|defaults| defaults.get(key.name))));
    let properties: Table = keys.iter().map(property).collect();
    let mut schema =
        object([("type", "object".into()), ("additionalProperties", false.into()), ("properties", properties.into())]);
    let required: Vec<&str> = keys.iter().filter(|key| key.is_required).map(|key| key.name).collect();
    if !required.is_empty() {
        schema.extend(object([("required", required.into())]));
    }
    for (key, other) in keys.iter().filter_map(|key| Some((key.name, key.instead_of?))) {
        // An empty list counts as absent.
        let filled = object([(key, object([("minItems", 1.into())]).into())]);
        let both = object([("required", vec![key, other].into()), ("properties", filled.into())]);
        schema.extend(object([("not", both.into())]));
    }
    schema
}

fn of(key: &Key, default: Option<&Value>) -> Value {
    let of_type = |name: &str| ("type", Value::from(name));
    let mut schema = match &key.shape {
        Shape::Text => object([of_type("string")]),
        Shape::Choice(names) => object([of_type("string"), ("enum", names.to_vec().into())]),
        Shape::Flag => object([of_type("boolean")]),
        Shape::Switch => {
            object([("type", vec!["boolean", "integer"].into()), ("minimum", 0.into()), ("maximum", 1.into())])
        }
        Shape::Whole(min, max) => object([of_type("integer"), ("minimum", (*min).into()), ("maximum", (*max).into())]),
        Shape::Number(min, max) => object([of_type("number"), ("minimum", (*min).into()), ("maximum", (*max).into())]),
        Shape::Table(keys) => table(keys, default.and_then(Value::as_table)),
        Shape::List(keys, max) => {
            object([of_type("array"), ("maxItems", (*max).into()), ("items", table(keys, None).into())])
        }
    };
    let about = key.at_most.map_or_else(|| key.about.into(), |other| format!("{} At most {other}.", key.about));
    schema.extend(object([("description", about.into())]));
    // A table's defaults are at its keys.
    if let Some(default) = default.filter(|default| !default.is_table()) {
        schema.extend(object([("default", default.clone())]));
    }
    schema.into()
}

fn object<const N: usize>(pairs: [(&str, Value); N]) -> Table {
    pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
