//! The reference of the configuration, made from its schema.

use std::collections::BTreeMap;
use std::fmt::Write;

use schemars::Schema;
use serde_json::{Map, Value};

const INTRODUCTION: &str = "\
# Configuration

You want to know what a key means, or which keys there are.

```sh
gyre config                                    # lists the configurations of the program
gyre config oxford > mine.toml                 # prints one to edit
gyre run mine.toml DRIVE --set run.window=2    # overrides a key
```

A run is configured by one TOML file; every key has a default, so a file is a few lines. A value of `--set` that is not TOML is taken as text.
Unknown keys are rejected. The resolved configuration is written beside the results as `config.toml`.

A relative path is that of a file beside the configuration, or of [one of the program](quickstart.md#configurations-and-networks-of-the-program).

Units are in the names: `_m`, `_s`, `_ms`, `_deg`, `_rad`, `_mps` (m/s), `_mps2` (m/s²), `_degps2` (degrees/s²).

Editors that know [Taplo](https://taplo.tamasfe.dev) complete and check keys with the schema beside this page, if the configuration begins with
`#:schema PATH/docs/gyre.schema.json`.

This page is made by `gyre schema --markdown` from the structures in the code.";

/// The keys that users set, with which the page begins. All others are advanced.
const USUAL: &str = "\
run.mode run.rate run.window run.ground_truth
source.kind source.address source.topic source.first source.scans
dataset.format dataset.range_resolution_m dataset.range_offset_m dataset.doppler_s
simulation.scans simulation.seed simulation.realism
raster.n raster.cell_m
points.min_range_m points.max_range_m
masking.kind masking.threshold masking.model masking.backend
gyro.kind gyro.file gyro.up gyro.delay_s gyro.scale
wheels.kind wheels.file wheels.delay_s wheels.scale
doppler.kind
slam.kind slam.map
gnss.kind gnss.file gnss.lever_m
objects.kind
record.topics
stages.NAME.command stages.NAME.python";

fn usual() -> impl Iterator<Item = &'static str> {
    USUAL.split_whitespace()
}

const HEADER: &str = "\n\n| key | type | default | meaning |\n|---|---|---|---|";

/// The sections, and the rows of usual keys, which stand before the sections.
#[derive(Default)]
struct Page {
    sections: String,
    usual: BTreeMap<String, String>,
}

pub fn reference(schema: &Schema) -> String {
    let mut page = Page::default();
    for (name, section) in properties(schema.as_value()) {
        write_section(&mut page, name, section);
    }
    let usual = usual().filter_map(|key| page.usual.get(key));
    let usual: String = usual.map(String::as_str).collect();
    format!(
        "{INTRODUCTION}\n\n## Usual keys{HEADER}{usual}\n\nAll keys below are advanced.{}",
        page.sections
    )
}

fn write_section(page: &mut Page, name: &str, schema: &Value) {
    if name == "stages.NAME.scheduling" {
        let described = text(&schema["description"]);
        let same = "The keys are those of `[run.scheduling]`.";
        page.sections += &format!("\n\n## `[{name}]`\n\n{described} {same}");
        return;
    }
    match schema.get("additionalProperties") {
        Some(named @ Value::Object(_)) => {
            // A section of its own kind beside those with names.
            let own = match properties(schema).next() {
                Some(_) => format!("[{name}]` and `"),
                None => String::new(),
            };
            let name = format!("{name}.NAME");
            write_object(page, &format!("{own}[{name}]"), &name, schema, named);
        }
        _ => write_object(page, &format!("[{name}]"), name, schema, schema),
    }
}

fn write_object(page: &mut Page, title: &str, name: &str, described: &Value, object: &Value) {
    let _ = write!(
        page.sections,
        "\n\n## `{title}`\n\n{}",
        text(&described["description"])
    );
    let (sections, keys): (Vec<_>, Vec<_>) =
        properties(object).partition(|(_, key)| is_section(key));
    let mut rows = String::new();
    for (key, schema) in keys {
        let path = format!("{name}.{key}");
        if usual().any(|usual| usual == path) {
            let row = row(&path, schema);
            page.usual.insert(path, row);
        } else {
            rows += &row(key, schema);
        }
    }
    if !rows.is_empty() {
        page.sections.extend([HEADER, &rows]);
    }
    for (key, schema) in sections {
        write_section(page, &format!("{name}.{key}"), schema);
    }
}

fn row(key: &str, schema: &Value) -> String {
    let default = schema.get("default").map_or(String::new(), toml_code);
    let meaning = text(&schema["description"]).replace('|', "\\|");
    format!("\n| `{key}` | {} | {default} | {meaning} |", kind(schema))
}

fn is_section(schema: &Value) -> bool {
    let object = |schema: &Value| schema.get("properties").is_some();
    object(schema) || object(&schema["items"]) || object(&schema["additionalProperties"])
}

fn properties(schema: &Value) -> impl Iterator<Item = (&String, &Value)> {
    schema["properties"]
        .as_object()
        .into_iter()
        .flat_map(Map::iter)
}

/// A key's type in words, or its possible values.
fn kind(schema: &Value) -> String {
    let choices = ["oneOf", "anyOf"]
        .iter()
        .find_map(|key| schema[*key].as_array());
    if let Some(choices) = choices {
        return choices.iter().map(kind).collect::<Vec<_>>().join(", ");
    }
    if let Some(values) = schema["enum"].as_array() {
        return values.iter().map(toml_code).collect::<Vec<_>>().join(", ");
    }
    if let Some(value) = schema.get("const") {
        return toml_code(value);
    }
    if let Some((key, value)) = properties(schema).next() {
        return match value.get("properties") {
            Some(_) => format!("`{{ {key} = {{ {} }} }}`", inner(value)),
            None => format!("`{{ {key} = ... }}`"),
        };
    }
    match &schema["type"] {
        Value::Array(types) => types.iter().map(text).collect::<Vec<_>>().join(" or "),
        Value::String(name) if name == "array" => format!("list of {}", kind(&schema["items"])),
        name => text(name).to_owned(),
    }
}

fn inner(object: &Value) -> String {
    let keys = properties(object).map(|(key, schema)| format!("{key} = {}", kind(schema)));
    keys.collect::<Vec<_>>().join(", ")
}

fn toml_code(value: &Value) -> String {
    format!("`{value}`")
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_usual_key_is_a_key() {
        let page = super::super::reference();
        let unknown = usual().filter(|key| !page.contains(&format!("\n| `{key}` |")));
        assert_eq!(unknown.count(), 0);
    }
}
