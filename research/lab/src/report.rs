//! The form of all reports: where, when and how something was measured, and tables of records, in
//! Markdown and in JSON.

use std::{collections::BTreeMap, env, fs, io, path::Path};

use gyre_results::machine::{Machine, today};
use gyre_configuration::terminal::{Failure, print};
use serde::Serialize;
use serde_json::{Map, Value, json};

/// The figures and words of a row by their keys. What is not known is missing or null.
pub type Record = Map<String, Value>;

/// A column of a table: the key in its records, the heading, the decimals of its figures.
pub type Column = (&'static str, &'static str, usize);

/// Rows that share a reason, by the reason.
pub type Notes = BTreeMap<String, Vec<String>>;

/// A table of records.
#[derive(Debug, Default, Serialize)]
pub struct Table {
    /// The title.
    pub title: String,
    /// The columns in Markdown. One that no row knows anything about is left out.
    #[serde(skip)]
    pub columns: Vec<Column>,
    /// Row by row. A row that came of a run has its `command`.
    pub rows: Vec<Record>,
    /// Rows that are left out, by the reason.
    pub left_out: Notes,
    /// The meaning of the columns, and what else there is to say.
    pub legend: String,
}

/// Returns the record of a JSON object.
pub fn record(object: Value) -> Record {
    match object {
        Value::Object(record) => record,
        _ => Record::new(),
    }
}

/// Writes tables that this process has measured, and where, when and how it did, to `NAME.json` and
/// `NAME.md` in `out`. Prints the latter.
pub fn publish(name: &str, tables: &[Table], out: &Path) -> Result<(), Failure> {
    let arguments = env::args_os().skip(1);
    let arguments = arguments.map(|argument| argument.to_string_lossy().into_owned());
    let (command, machine, date) = (command("gyre-lab", arguments), Machine::this(), today());
    // Known where the builder set `GYRE_COMMIT`.
    let (version, commit) = (env!("CARGO_PKG_VERSION"), option_env!("GYRE_COMMIT"));
    let report = json!({
        "version": version, "commit": commit, "machine": machine, "date": date, "command": command, "tables": tables,
    });
    let of_commit = commit
        .map(|commit| format!(" ({commit})"))
        .unwrap_or_default();
    let mut markdown = format!(
        "# gyre-lab {name}, version {version}{of_commit}\n\n{machine}; {date}\n\n```sh\n{command}\n```\n"
    );
    markdown.extend(tables.iter().map(Table::markdown));
    save(
        &out.join(format!("{name}.json")),
        &serde_json::to_string_pretty(&report)?,
    )?;
    save(&out.join(format!("{name}.md")), &markdown)?;
    print::line(markdown.trim_end())
}

impl Table {
    fn markdown(&self) -> String {
        let knows = |row: &Record, key| row.get(key).is_some_and(|value| !value.is_null());
        let known = |(key, ..): &&Column| self.rows.iter().any(|row| knows(row, *key));
        let columns: Vec<&Column> = self.columns.iter().filter(known).collect();
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let cells = |row: &Record| {
            let cell = |(key, _, decimals): &&Column| shown(row.get(*key), *decimals);
            columns.iter().map(cell).collect()
        };
        let headings = columns.iter().map(|(_, heading, _)| (*heading).to_owned());
        let mut text = format!("\n## {}\n\n{}", self.title, line(headings.collect()));
        text += &format!("|{}\n", "---|".repeat(columns.len()));
        text.extend(self.rows.iter().map(|row| line(cells(row))));
        let left_out = self.left_out.iter();
        let left_out = left_out.map(|(reason, rows)| format!("{}: {reason}. ", rows.join("; ")));
        for (opening, notes) in [
            ("Left out. ", left_out.collect()),
            ("", self.legend.clone()),
        ] {
            if !notes.is_empty() {
                text += &format!("\n{opening}{}\n", notes.trim_end());
            }
        }
        let commands = self
            .rows
            .iter()
            .filter_map(|row| row.get("command")?.as_str());
        let commands: Vec<&str> = commands.collect();
        match commands.is_empty() {
            true => text,
            false => text + &format!("\n```sh\n{}\n```\n", commands.join("\n")),
        }
    }
}

fn shown(value: Option<&Value>, decimals: usize) -> String {
    match value {
        None | Some(Value::Null) => "-".to_owned(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => match value.as_f64() {
            Some(figure) => format!("{figure:.decimals$}"),
            None => value.to_string(),
        },
    }
}

/// Returns a command line that a shell takes.
pub fn command(program: &str, arguments: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let quoted = |argument: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
        match !argument.is_empty() && argument.chars().all(plain) {
            true => argument.to_owned(),
            false => format!("'{}'", argument.replace('\'', r"'\''")),
        }
    };
    let mut line = program.to_owned();
    for argument in arguments {
        line += &format!(" {}", quoted(argument.as_ref()));
    }
    line
}

/// Writes a file.
pub fn save(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text).map_err(cannot_write(path))
}

/// Creates a folder, and those that lead to it.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    fs::create_dir_all(path).map_err(cannot_write(path))
}

/// Returns what makes a sentence of an error in writing `path`.
pub fn cannot_write(path: &Path) -> impl Fn(io::Error) -> Failure {
    move |error| format!("cannot write {}: {error}", path.display()).into()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_command_can_be_given_to_a_shell() {
        assert_eq!(
            command("gyre", ["run", "a b.toml", "--set", "x=1", "it's"]),
            r"gyre run 'a b.toml' --set x=1 'it'\''s'"
        );
        assert_eq!(command("gyre", [""; 1]), "gyre ''");
    }

    #[test]
    fn tables_have_a_line_a_row_and_what_nobody_knows_is_left_out() {
        let record = |value: Value| value.as_object().unwrap().clone();
        let table = Table {
            title: "Errors".to_owned(),
            columns: vec![("row", "row", 0), ("%", "%", 2), ("ate", "ATE m", 2)],
            rows: vec![
                record(serde_json::json!({ "row": "a", "%": 2.125, "command": "gyre run a" })),
                record(serde_json::json!({ "row": "b", "%": null })),
            ],
            left_out: Notes::from([(
                "there is none".to_owned(),
                vec!["c".to_owned(), "d".to_owned()],
            )]),
            legend: "-: not known.".to_owned(),
        };
        let expected = "\n## Errors\n\n| row | % |\n|---|---|\n| a | 2.12 |\n| b | - |\n\nLeft out. c; d: there is none.\n\
                        \n-: not known.\n\n```sh\ngyre run a\n```\n";
        assert_eq!(table.markdown(), expected);
    }
}
