//! Values of Python as TOML, and results of Rust as dictionaries.

use std::path::PathBuf;

use gyre_configuration::strict;
use pyo3::{
    prelude::*,
    types::{PyBool, PyList, PyMapping, PyString, PyTuple},
};
use serde::Serialize;
use toml::{Table, Value};

use crate::errors;

/// Maximum depth of nested sections; a deeper value contains itself.
const MAX_DEPTH: usize = 8;

pub fn table(sections: &Bound<'_, PyMapping>) -> PyResult<Table> {
    table_within(sections, MAX_DEPTH)
}

/// Sets the keys of a mapping as in `{"masking.kind": "none"}`.
pub fn set_all(table: &mut Table, overrides: Option<&Bound<'_, PyMapping>>) -> PyResult<()> {
    let Some(overrides) = overrides else {
        return Ok(());
    };
    for item in overrides.items()? {
        let (key, value) = item.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
        let key = name(&key)?;
        if !key.contains('.') || key.contains('=') {
            return Err(errors::config(format!(
                "`{key}`: expected section.key, as in {{\"masking.kind\": \"none\"}}"
            )));
        }
        let sentence = format!("{key}={}", value_within(&key, &value, MAX_DEPTH)?);
        strict::set(table, &sentence).map_err(errors::config)?;
    }
    Ok(())
}

/// Converts a value to dictionaries, lists, strings and numbers.
pub fn dictionary<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(errors::other)?;
    py.import("json")?.call_method1("loads", (text,))
}

fn table_within(sections: &Bound<'_, PyMapping>, depth: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for item in sections.items()? {
        let (key, value) = item.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
        // An open setting of a configuration becomes None in the dictionary.
        if !value.is_none() {
            let key = name(&key)?;
            let value = value_within(&key, &value, depth)?;
            table.insert(key, value);
        }
    }
    Ok(table)
}

fn name(key: &Bound<'_, PyAny>) -> PyResult<String> {
    let named = key.cast::<PyString>().ok().map(|name| name.to_string());
    named.ok_or_else(|| errors::config(format!("the key {key} is not a str")))
}

fn value_within(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    let Some(within) = depth.checked_sub(1) else {
        return Err(errors::config(format!("`{key}` has too many levels")));
    };
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.extract()?));
    }
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(Value::Boolean(truth.is_true()));
    }
    if let Ok(mapping) = value.cast::<PyMapping>() {
        return Ok(Value::Table(table_within(mapping, within)?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let items = value.try_iter()?;
        let items = items.map(|item| value_within(key, &item?, within));
        let items: PyResult<Vec<Value>> = items.collect();
        return Ok(Value::Array(items?));
    }
    // Numbers of numpy do not belong to Python's classes.
    if let Ok(number) = value.extract::<i64>() {
        return Ok(Value::Integer(number));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::Float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(Value::String(path.to_string_lossy().into_owned()));
    }
    let kind = value.get_type().name()?;
    Err(errors::config(format!(
        "`{key}` is of type {kind}, but values are numbers, strings, paths, booleans, lists and mappings"
    )))
}
