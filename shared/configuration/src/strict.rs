//! Strict reading of TOML: unknown keys are rejected, with the nearest known one.

use std::{collections::BTreeMap, fmt::Display, path::Path};

use gyre_datasets::{clipped, in_plain_words};
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::ConfigurationError;

/// Names less similar than this (Jaro-Winkler) are not suggested.
const ALIKE: f64 = 0.75;

/// Reads a file.
/// An error names the place of the mistake and quotes nothing of the file, which may hold anything.
pub fn read_table(path: &Path) -> Result<Table, ConfigurationError> {
    if path.is_dir() {
        return Err(folder(path));
    }
    let text = gyre_storage::read_text(path, gyre_storage::SETTINGS).map_err(|error| {
        let path = path.display();
        ConfigurationError(format!("cannot read the configuration {path}: {error}"))
    })?;
    parse(path, &text)
}

/// Parses a text; `path` is its name in errors.
pub fn parse(path: &Path, text: &str) -> Result<Table, ConfigurationError> {
    let parsed: Result<Table, _> = text.parse();
    parsed.map_err(|error| {
        let reason = syntax(text, &error);
        ConfigurationError(format!("{}: {reason}", path.display()))
    })
}

/// Returns the error for a folder that is named in place of a configuration: the results of a run,
/// or a recording.
fn folder(path: &Path) -> ConfigurationError {
    let own = path.join("config.toml");
    let remedy = match own.is_file() {
        true => format!("name the configuration in it, {}", own.display()),
        false => "name a TOML file".to_owned(),
    };
    let path = path.display();
    ConfigurationError(format!("the configuration {path} is a folder: {remedy}"))
}

/// Names the place of a mistake in a text, without the line itself.
fn syntax(text: &str, error: &toml::de::Error) -> String {
    let start = error.span().map_or(0, |span| span.start);
    let before = text.get(..start).unwrap_or_default();
    let (line, column) = match before.rsplit_once('\n') {
        Some((lines, row)) => (lines.matches('\n').count() + 2, row.chars().count() + 1),
        None => (1, before.chars().count() + 1),
    };
    let reason = error.message().trim().replace('\n', "; ");
    format!("TOML parse error at line {line}, column {column}: {reason}")
}

pub fn path_value(path: &Path) -> Result<Value, ConfigurationError> {
    text_of(path).map(Value::from)
}

pub(crate) fn text_of(path: &Path) -> Result<&str, ConfigurationError> {
    path.to_str().ok_or_else(|| {
        ConfigurationError(format!(
            "{path:?} has a name that is not UTF-8, which a configuration cannot hold: rename it, or name a link to it"
        ))
    })
}

pub fn value(section: &str, reason: impl Display) -> ConfigurationError {
    ConfigurationError(format!("[{section}]: {reason}"))
}

/// Names the section of a value that is out of its bounds.
pub fn within<T, E: Display>(
    section: &str,
    checked: Result<T, E>,
) -> Result<(), ConfigurationError> {
    checked.map(drop).map_err(|error| value(section, error))
}

/// Takes a section out of the table; its defaults where it is missing.
pub fn section<T: DeserializeOwned>(
    table: &mut Table,
    name: &str,
) -> Result<T, ConfigurationError> {
    let value = table.remove(name).unwrap_or_else(|| Table::new().into());
    read(name, value)
}

pub fn sections<T: DeserializeOwned>(
    table: &mut Table,
    name: &str,
    known: &[&str],
) -> Result<BTreeMap<String, T>, ConfigurationError> {
    let sections: BTreeMap<String, Value> = section(table, name)?;
    if let Some(key) = sections.keys().find(|key| !known.contains(&key.as_str())) {
        return Err(unknown(name, key, known));
    }
    sections
        .into_iter()
        .map(|(key, value)| Ok((key.clone(), read(&format!("{name}.{key}"), value)?)))
        .collect()
}

pub fn unknown(section: &str, key: &str, known: &[&str]) -> ConfigurationError {
    let suggestion = match suggestion(key, known) {
        nearest if nearest.is_empty() => format!("; it knows {}", known.join(", ")),
        nearest => nearest,
    };
    let key = clipped(key);
    ConfigurationError(format!("[{section}] has no key `{key}`{suggestion}"))
}

/// Returns a question for the nearest known name; empty without a similar name.
pub(crate) fn suggestion(name: &str, known: &[&str]) -> String {
    let alike = |known: &&str| (strsim::jaro_winkler(name, known) * 1e6) as u64;
    let nearest = known.iter().copied().max_by_key(alike);
    let nearest = nearest.filter(|known| strsim::jaro_winkler(name, known) > ALIKE);
    nearest.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

/// Sets a key by an override `section.key=value`; the value is TOML, or else a plain string.
pub fn set(table: &mut Table, sentence: &str) -> Result<(), ConfigurationError> {
    let refused = || {
        ConfigurationError(format!(
            "--set {sentence}: expected section.key=value, as in masking.kind=none"
        ))
    };
    let (path, value) = sentence.split_once('=').ok_or_else(refused)?;
    let value = value_of(value.trim());
    let mut keys: Vec<&str> = path.trim().split('.').collect();
    let last = keys
        .pop()
        .filter(|key| !key.is_empty() && !keys.is_empty())
        .ok_or_else(refused)?;
    let mut place = table;
    for key in keys {
        place = place
            .entry(key)
            .or_insert_with(|| Table::new().into())
            .as_table_mut()
            .ok_or_else(refused)?;
    }
    place.insert(last.to_owned(), value);
    Ok(())
}

fn value_of(text: &str) -> Value {
    let parsed = format!("value = {text}").parse::<Table>().ok();
    parsed
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(text.to_owned()))
}

pub fn read<T: DeserializeOwned>(section: &str, value: Value) -> Result<T, ConfigurationError> {
    value.try_into().map_err(
        |error: toml::de::Error| match unknown_field(error.message()) {
            Some((key, known)) => unknown(section, key, &known),
            None => self::value(section, reason(section, &error)),
        },
    )
}

/// Returns the reason with its key. The library adds "in `key`" behind its sentence; of a section
/// that was read by its name, the key begins with the name.
fn reason(section: &str, error: &toml::de::Error) -> String {
    let sentence = error.to_string().trim().replace('\n', " ");
    let place = sentence.rsplit_once(" in `");
    let key = place.and_then(|(_, key)| key.strip_suffix('`'));
    let key = key.filter(|key| *key != section);
    let key = key.map(|key| key.strip_prefix(&format!("{section}.")).unwrap_or(key));
    in_plain_words(key.unwrap_or("it"), error.message()).unwrap_or(sentence)
}

/// The key and the known ones, from serde's own words: unknown field `x`, expected one of `a`, `b`.
fn unknown_field(message: &str) -> Option<(&str, Vec<&str>)> {
    let quoted = message.strip_prefix("unknown field")?;
    let mut names = quoted.split('`').skip(1).step_by(2);
    Some((names.next()?, names.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_that_is_a_value_is_said_to_be_one() {
        let mut table: Table = "masking = 3".parse().unwrap();
        let refused = section::<BTreeMap<String, Value>>(&mut table, "masking");
        assert_eq!(
            refused.unwrap_err().to_string(),
            "[masking]: it is `3`, but must be a section of keys"
        );
    }

    #[test]
    fn overrides_are_toml_values_or_plain_strings() {
        let mut table = Table::new();
        for sentence in [
            "masking.kind=none",
            "raster.n = 127",
            "stages.masking.command=['a', 'b']",
        ] {
            set(&mut table, sentence).unwrap();
        }
        assert_eq!(table["masking"]["kind"].as_str(), Some("none"));
        assert_eq!(table["raster"]["n"].as_integer(), Some(127));
        assert_eq!(table["stages"]["masking"]["command"][1].as_str(), Some("b"));
        for sentence in ["n=3", "masking", "=", "masking.threshold"] {
            let error = set(&mut table, sentence).unwrap_err().to_string();
            for word in ["--set", sentence, "section.key=value"] {
                assert!(error.contains(word), "{error}");
            }
        }
    }
}
