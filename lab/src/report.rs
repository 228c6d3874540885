//! The form of all reports: where, when and how something was measured, and tables in Markdown.

use std::{collections::BTreeMap, env, fmt::Display, fs, path::Path};

use gyre::{
    Failure,
    machine::{Machine, today},
    print,
};
use serde::Serialize;

/// Rows that share a reason, or a network, by that.
pub type Notes = BTreeMap<String, Vec<String>>;

/// Where, when and how something was measured.
#[derive(Debug, Serialize)]
pub struct Heading {
    version: &'static str,
    /// Known where the builder set `GYRE_COMMIT`.
    commit: Option<&'static str>,
    machine: Machine,
    /// UTC.
    date: String,
    command: String,
}

impl Heading {
    /// The heading of what this process measures now.
    pub fn now() -> Self {
        let arguments = env::args_os().skip(1);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit: option_env!("GYRE_COMMIT"),
            machine: Machine::this(),
            date: today(),
            command: command(
                "gyre-lab",
                arguments.map(|a| a.to_string_lossy().into_owned()),
            ),
        }
    }

    /// Markdown under a title.
    pub fn markdown(&self, title: &str) -> String {
        let commit = self
            .commit
            .map_or_else(String::new, |commit| format!(" ({commit})"));
        format!(
            "# {title} by gyre {}{commit}\n\n{}; {}\n\n```sh\n{}\n```\n",
            self.version, self.machine, self.date, self.command
        )
    }
}

/// A command line that a shell takes.
pub fn command(program: &str, arguments: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let quoted = |argument: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
        match !argument.is_empty() && argument.chars().all(plain) {
            true => argument.to_owned(),
            false => format!("'{}'", argument.replace('\'', r"'\''")),
        }
    };
    arguments
        .into_iter()
        .fold(program.to_owned(), |line, argument| {
            line + " " + &quoted(argument.as_ref())
        })
}

/// A table in Markdown.
pub fn table(header: &[impl AsRef<str>], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let header: Vec<&str> = header.iter().map(AsRef::as_ref).collect();
    let head = format!(
        "| {} |\n|{}\n",
        header.join(" | "),
        "---|".repeat(header.len())
    );
    rows.into_iter().fold(head, |text, row| {
        text + &format!("| {} |\n", row.join(" | "))
    })
}

/// A figure in fixed decimals; `-` where there is none.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    or_dash(value.map(|value| format!("{value:.decimals$}")))
}

/// `-` where there is nothing.
pub fn or_dash(value: Option<impl Display>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

/// A paragraph of notes, each with its rows; nothing of nothing.
pub fn paragraph(title: &str, notes: &Notes) -> String {
    let sentences: Vec<String> = notes
        .iter()
        .map(|(what, rows)| format!("{}: {what}", rows.join("; ")))
        .collect();
    match sentences.is_empty() {
        true => String::new(),
        false => format!("\n{title}. {}.\n", sentences.join(". ")),
    }
}

/// Writes `NAME.json` and `NAME.md` to `out`, and prints the latter.
///
/// # Errors
/// A file that cannot be written.
pub fn publish(
    out: &Path,
    name: &str,
    report: &impl Serialize,
    markdown: &str,
) -> Result<(), Failure> {
    save(
        &out.join(name).with_extension("json"),
        &serde_json::to_string_pretty(report)?,
    )?;
    save(&out.join(name).with_extension("md"), markdown)?;
    print::line(markdown.trim_end())
}

/// Writes a file.
///
/// # Errors
/// A sentence that names it.
pub fn save(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text)
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

/// Makes a folder, and those that lead to it.
///
/// # Errors
/// A sentence that names it.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    fs::create_dir_all(path)
        .map_err(|error| format!("cannot write to {}: {error}", path.display()).into())
}

/// A row's name as that of a folder.
pub fn folder(name: &str) -> String {
    let words = name
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty());
    words
        .map(str::to_ascii_lowercase)
        .collect::<Vec<_>>()
        .join("-")
}

#[cfg(test)]
mod tests {
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
    fn tables_have_a_line_a_row_and_notes_are_sentences() {
        let rows = [
            vec!["a".to_owned(), number(Some(2.125), 2)],
            vec!["b".to_owned(), number(None, 2)],
        ];
        assert_eq!(
            table(&["row", "%"], rows),
            "| row | % |\n|---|---|\n| a | 2.12 |\n| b | - |\n"
        );
        let notes = Notes::from([(
            "there is none".to_owned(),
            vec!["a".to_owned(), "b".to_owned()],
        )]);
        assert_eq!(
            paragraph("Left out", &notes),
            "\nLeft out. a; b: there is none.\n"
        );
        assert_eq!(paragraph("Left out", &Notes::new()), "");
        assert_eq!(folder("f-raw, Eq. 7"), "f-raw-eq-7");
    }
}
