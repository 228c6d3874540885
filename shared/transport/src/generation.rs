//! Generations of numbers: masking that is started again in live mode gives the numbers behind the
//! newest pose to other scans, and a sensor's source does so when the run is started again. Each
//! such start begins a generation, which its messages carry, so that a reused number differs from a
//! message that is sent again. The file has all generations, for one that has seen none of some.

use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use gyre_contract::{GivenAnew, Item, NumberedBy};

use crate::{Manifest, RunError};

/// Generations in the file of a run: the newest ones. Who looks on has missed far fewer.
const KEPT: usize = 1000;
const MAX_BYTES: u64 = 64 * KEPT as u64;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Generation(GivenAnew);

impl Generation {
    /// Begins a generation. The process numbers from `first` on during this generation. The
    /// generation is kept beside the journal and survives a power failure, so that no number of one
    /// is given twice.
    pub fn begin(
        manifest: &Manifest,
        by: NumberedBy,
        newest_pose: &Item,
        first: u64,
    ) -> Result<Self, RunError> {
        let path = Self::path(&manifest.out);
        let mut lines = read(&path)?;
        let newest = lines.iter().map(|line| line.generation).max();
        let before = newest.unwrap_or_default().max(newest_pose.generation);
        let generation = before.saturating_add(1);
        lines.push(Line {
            generation,
            gives: Some((first, by)),
        });
        let kept = lines.iter().skip(lines.len().saturating_sub(KEPT));
        let text: String = kept.map(Line::to_string).collect();
        gyre_storage::create_folder(&manifest.out.join("journal"))?;
        match gyre_storage::write(&path, text) {
            // The line may have room behind the others.
            Err(error) if error.is_full() && newest.is_some() => append(&path, lines.last())?,
            written => written?,
        }
        Ok(Self(GivenAnew { generation, first }))
    }

    pub fn path(out: &Path) -> PathBuf {
        out.join("journal").join("generation")
    }

    pub fn mark(&self, item: &mut Item) {
        (item.generation, item.numbered_from) = (self.0.generation, self.0.first);
    }
}

/// Returns, among the generations after `known` and before the item's, the one that reused the
/// smallest number. Without a generation before (0) nothing is known that could be void.
pub fn skipped(
    out: &Path,
    by: NumberedBy,
    known: u32,
    item: &Item,
) -> Result<Option<GivenAnew>, RunError> {
    if known == 0 || item.generation <= known.saturating_add(1) {
        return Ok(None);
    }
    let lines = read(&Generation::path(out))?.into_iter();
    let skipped = lines.filter_map(|Line { generation, gives }| {
        let (first, of) = gives?;
        let is_skipped = of == by && generation > known && generation < item.generation;
        is_skipped.then_some(GivenAnew { generation, first })
    });
    Ok(skipped.min_by_key(|it| it.first))
}

fn append(path: &Path, line: Option<&Line>) -> Result<(), RunError> {
    let file = gyre_storage::File::open_or_create(path)?;
    let text = line.map(Line::to_string).unwrap_or_default();
    let end = file.length()?;
    file.write_at(text.as_bytes(), end).or_else(|error| {
        // A part of a line would make the file invalid.
        file.set_length(end)?;
        Err(error)
    })?;
    Ok(file.sync()?)
}

/// A line of the file: a generation, its first number and who gives its numbers, which a program in
/// the place of masking may leave out.
struct Line {
    generation: u32,
    gives: Option<(u64, NumberedBy)>,
}

impl Line {
    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace();
        let generation = words.next()?.parse().ok()?;
        let gives = match (words.next(), words.next(), words.next()) {
            (None, ..) => None,
            (Some(first), Some(by), None) => Some((first.parse().ok()?, NumberedBy::by_name(by)?)),
            _ => return None,
        };
        Some(Self { generation, gives })
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.gives {
            Some((first, by)) => writeln!(f, "{} {first} {}", self.generation, by.name()),
            None => writeln!(f, "{}", self.generation),
        }
    }
}

fn read(path: &Path) -> Result<Vec<Line>, RunError> {
    let text = match gyre_storage::read_text(path, MAX_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(RunError::file(path))?,
    };
    let lines: Option<Vec<Line>> = text.lines().map(Line::parse).collect();
    lines.filter(|lines| !lines.is_empty()).ok_or_else(|| {
        RunError::Input(format!(
            "{} holds no number: remove it if nobody needs a recording of this run any more",
            path.display()
        ))
    })
}
