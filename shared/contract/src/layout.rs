//! The topics and their structures as data, for documents and for programs in other languages.

use std::fmt::Write;

use serde::Serialize;

use crate::{
    StageId, Topic, all, flag,
    message::Sender,
    wire::{Bounds, Field, Kind, Structure},
};

/// The layout of all messages: `gyre schema --messages` prints it.
#[derive(Debug, Serialize)]
pub struct Layout {
    pub topics: Vec<TopicLayout>,
    pub structures: Vec<StructureLayout>,
    /// The stages by the indices of their hops.
    pub stages: Vec<&'static str>,
    /// The bits of `Item.flags`.
    pub flags: [(&'static str, u32); 4],
}

#[derive(Debug, Serialize)]
pub struct TopicLayout {
    pub name: &'static str,
    pub doc: String,
    pub from: Vec<&'static str>,
    pub to: Vec<&'static str>,
    /// The structure of the header.
    pub header: &'static str,
    /// The name of an element of the payload, which has 64 bytes and this alignment.
    pub element: &'static str,
}

#[derive(Debug, Serialize)]
pub struct StructureLayout {
    pub name: &'static str,
    /// The name that the transport compares.
    pub type_name: &'static str,
    pub doc: String,
    pub bytes: usize,
    pub fields: Vec<FieldLayout>,
}

#[derive(Debug, Serialize)]
pub struct FieldLayout {
    pub name: &'static str,
    /// A number as `f64`, or a structure.
    pub kind: &'static str,
    /// The lengths of an array, the outer one first; none of a single value.
    pub shape: Vec<usize>,
    pub offset: usize,
    pub doc: String,
    pub bounds: String,
    /// The names of codes, from 0.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub codes: &'static [&'static str],
}

impl Layout {
    pub fn new() -> Self {
        let mut structures = Vec::new();
        for topic in all() {
            collect(topic.structure, &mut structures);
        }
        Self {
            topics: all().map(TopicLayout::of).collect(),
            structures: structures.into_iter().map(StructureLayout::of).collect(),
            stages: StageId::ALL.map(StageId::name).to_vec(),
            flags: [
                ("END", flag::END),
                ("BREAK", flag::BREAK),
                ("SYNC", flag::SYNC),
                ("BASE", flag::BASE),
            ],
        }
    }
}

impl Default for Layout {
    fn default() -> Self {
        Self::new()
    }
}

/// Adds a structure behind those that it consists of.
fn collect(structure: &'static Structure, known: &mut Vec<&'static Structure>) {
    if known.iter().any(|it| it.type_name == structure.type_name) {
        return;
    }
    for field in structure.fields {
        if let (Kind::Structure(part), _) = flat(&field.kind) {
            collect(part, known);
        }
    }
    known.push(structure);
}

/// Returns the kind of the elements of an array of any depth, and its lengths.
fn flat(kind: &Kind) -> (Kind, Vec<usize>) {
    match kind {
        Kind::Array(element, length) => {
            let (kind, mut shape) = flat(element);
            shape.insert(0, *length);
            (kind, shape)
        }
        kind => (*kind, Vec::new()),
    }
}

/// Joins the lines of a comment, without the brackets of links.
fn text(doc: &[&str]) -> String {
    let lines: Vec<&str> = doc.iter().map(|line| line.trim()).collect();
    lines.join(" ").replace("[`", "`").replace("`]", "`")
}

impl TopicLayout {
    fn of(topic: &Topic) -> Self {
        Self {
            name: topic.name,
            doc: text(topic.doc),
            from: match topic.sender {
                Sender::Stage(stages) => stages.iter().map(|it| it.name()).collect(),
                Sender::Follower(follower) => vec![follower.name()],
            },
            to: topic.readers.to_vec(),
            header: topic.structure.name,
            element: topic.element.name,
        }
    }
}

impl StructureLayout {
    fn of(structure: &Structure) -> Self {
        Self {
            name: structure.name,
            type_name: structure.type_name,
            doc: text(structure.doc),
            bytes: structure.bytes,
            fields: structure.fields.iter().map(FieldLayout::of).collect(),
        }
    }
}

impl FieldLayout {
    /// Returns the bounds, and the names of codes.
    fn in_words(&self) -> String {
        match self.codes {
            [] | ["no", "yes"] => self.bounds.clone(),
            codes => {
                let codes = codes.iter().enumerate();
                let codes = codes.map(|(code, name)| format!("{code} {name}"));
                codes.collect::<Vec<_>>().join(", ")
            }
        }
    }

    fn of(field: &Field) -> Self {
        let (kind, shape) = flat(&field.kind);
        Self {
            name: field.name,
            kind: match kind {
                Kind::U8 => "u8",
                Kind::U16 => "u16",
                Kind::U32 => "u32",
                Kind::U64 => "u64",
                Kind::I64 => "i64",
                Kind::F32 => "f32",
                Kind::F64 => "f64",
                Kind::Structure(structure) => structure.name,
                Kind::Array(..) => "",
            },
            shape,
            offset: field.offset,
            doc: text(field.doc),
            bounds: field.bounds.to_string(),
            codes: match field.bounds {
                Bounds::Codes(names) => names,
                _ => &[],
            },
        }
    }
}

/// Returns the tables of topics and of bounds for a page.
pub fn tables() -> String {
    let layout = Layout::new();
    let mut text = "| topic | from | to | header | content |\n|---|---|---|---|---|\n".to_owned();
    for topic in &layout.topics {
        let to = match &topic.to[..] {
            [] => "observers".to_owned(),
            readers => readers.join(", "),
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "| `{}` | {} | {to} | `{}` | {} |",
            topic.name,
            topic.from.join(" or "),
            topic.header,
            topic.doc
        );
    }
    text += "\n| fields | must be |\n|---|---|\n";
    let mut bounded: Vec<(&str, &str, String)> = Vec::new();
    for structure in &layout.structures {
        let fields = structure.fields.iter().filter(|it| !it.bounds.is_empty());
        bounded.extend(fields.map(|it| (structure.name, it.name, it.in_words())));
    }
    let mut rows: Vec<(&str, Vec<String>)> = Vec::new();
    for (structure, name, words) in &bounded {
        let is_other = |it: &(&str, &str, String)| it.1 == *name && it.2 != *words;
        let name = match bounded.iter().any(is_other) {
            true => format!("`{structure}.{name}`"),
            false => format!("`{name}`"),
        };
        match rows.iter_mut().find(|row| row.0 == words) {
            Some((_, names)) if names.contains(&name) => {}
            Some((_, names)) => names.push(name),
            None => rows.push((words, vec![name])),
        }
    }
    for (words, names) in rows {
        let _ = writeln!(text, "| {} | {words} |", names.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_page_has_the_topics_and_their_bounds() {
        let page = include_str!("../../../docs/replace-a-stage.md");
        assert!(
            page.contains(super::tables().trim()),
            "put the output of `gyre schema --messages --markdown` into docs/replace-a-stage.md"
        );
    }
}
