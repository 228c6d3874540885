//! Changes that a schema made from Rust needs to describe TOML.

use schemars::{
    Schema,
    transform::{Transform, transform_subschemas},
};
use serde_json::Value;

/// Removes null, which TOML lacks, details that a reader does not need (defaults of whole sections,
/// Rust's formats, breaks of lines), and the digits that an `f32` gains as an `f64`.
#[derive(Clone, Debug)]
pub struct ForToml;

impl Transform for ForToml {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        without_null(schema);
        schema.remove("required");
        let single = schema.remove("format") == Some("float".into());
        match schema.get_mut("default") {
            Some(Value::Object(_) | Value::Null) => drop(schema.remove("default")),
            Some(default) if single => *default = shortest(default),
            _ => {}
        }
        if let Some(Value::String(text)) = schema.get_mut("description") {
            *text = text.replace('\n', " ");
        }
    }
}

fn without_null(schema: &mut Schema) {
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|name| name != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            schema.insert("type".to_owned(), only);
        }
    }
    let Some(Value::Array(choices)) = schema.get_mut("anyOf") else {
        return;
    };
    choices.retain(|choice| choice["type"] != "null");
    if let [Value::Object(only)] = choices.as_slice() {
        let only = only.clone();
        schema.remove("anyOf");
        for (key, value) in only {
            schema.ensure_object().entry(key).or_insert(value);
        }
    }
}

fn shortest(number: &Value) -> Value {
    let text = number.as_f64().map(|number| (number as f32).to_string());
    let short = text.and_then(|text| text.parse::<f64>().ok());
    short.map_or(number.clone(), Value::from)
}
