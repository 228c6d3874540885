//! Tables as CSV: their rows, by the columns that the first row names, and the stretches of rows
//! between steps that belong together.

use std::{iter, ops::Range};

use csv::StringRecord;
use gyre_geometry::samples::Sample;
use gyre_storage::quoted;

use super::{Columns, kinds::Kind};
use crate::header::Header;

/// The largest file: a day of samples at 200 Hz has 2 GB.
pub(crate) const MAX_BYTES: u64 = 4 << 30;
/// Marks between columns that are looked for in the first row.
const MARKS: [u8; 3] = [b',', b';', b'\t'];
/// The first field of a row that replaces unreadable rows, or lost ones; the second field is their
/// number.
const UNREADABLE: &str = "unreadable";
const LOST: &str = "lost";

#[derive(Clone)]
pub(crate) struct Rows {
    kind: &'static Kind,
    pub columns: Columns,
    pub raw: Raw,
    stating: Vec<(usize, f64)>,
    count: usize,
    mark: u8,
    lines: usize,
}

impl Rows {
    pub fn of(text: &str, kind: &'static Kind) -> Result<Self, String> {
        let first = text.lines().next().unwrap_or_default().as_bytes();
        let mark = MARKS.into_iter().find(|mark| first.contains(mark));
        let mark = mark.unwrap_or(b',');
        let mut row = StringRecord::new();
        let mut reader = reader(text, mark);
        if !reader.read_record(&mut row).map_err(|e| e.to_string())? {
            return Err("it is empty".to_owned());
        }
        let is_named = row.iter().any(|field| field.parse::<f64>().is_err());
        let (columns, stating) = match is_named {
            true => {
                let header = Header::of(&row)?;
                ((kind.by_names)(&header)?, header.unmeasured())
            }
            false => ((kind.by_number)(row.len())?, Vec::new()),
        };
        let mut rows = Self {
            kind,
            columns,
            stating,
            mark,
            count: row.len(),
            raw: Raw::default(),
            lines: 0,
        };
        // Without names the first row is an entry.
        let mut from = 0;
        if is_named {
            rows.lines = (reader.position().line() - 1) as usize;
            from = reader.position().byte() as usize;
        }
        rows.go_on(text.get(from..).unwrap_or_default());
        Ok(rows)
    }

    pub fn go_on(&mut self, text: &str) {
        let mut reader = reader(text, self.mark);
        let mut row = StringRecord::new();
        // Of a text rows of any form can be read.
        while reader.read_record(&mut row).unwrap_or_default() {
            self.take(&row);
        }
        self.lines += (reader.position().line() - 1) as usize;
    }

    fn take(&mut self, row: &StringRecord) {
        let states_so = |(column, number): &(usize, f64)| {
            let text = row.get(*column).unwrap_or_default();
            text.eq_ignore_ascii_case("false") || text.parse() == Ok(*number)
        };
        let (kind, is_whole) = (self.kind, row.len() == self.count);
        let is_blank = || kind.has_blanks && self.columns.are_blank(kind.values, row);
        match self.columns.read(row).filter(|_| is_whole) {
            Some(_) if self.stating.iter().any(states_so) => self.raw.unmeasured += 1,
            Some((stamp_ns, values)) => self.raw.entries.push((kind.sample)(stamp_ns, values)),
            None if is_whole && is_blank() => self.raw.unmeasured += 1,
            None => {
                let line = self.lines + row.position().map_or(0, |at| at.line() as usize);
                let times = row.get(1).and_then(|it| it.parse().ok());
                let why = || why(row, self.count);
                match (row.get(0), times) {
                    (Some(LOST), Some(times)) if kind.has_blanks => {
                        self.raw.lost = self.raw.lost.saturating_add(times);
                    }
                    (Some(UNREADABLE), Some(times)) => self.raw.unreadable.add(times, line, why),
                    _ => self.raw.unreadable.add(1, line, why),
                }
            }
        }
    }
}

fn reader(text: &str, mark: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(mark)
        .from_reader(text.as_bytes())
}

/// Leaves out bad entries, and returns their number.
pub(crate) fn leave_out<T>(entries: &mut Vec<T>, is_bad: impl Fn(&T) -> bool) -> usize {
    let before = entries.len();
    entries.retain(|entry| !is_bad(entry));
    before - entries.len()
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Raw {
    pub entries: Vec<Sample>,
    pub unreadable: Unreadable,
    /// Rows or messages that state that nothing was measured.
    pub unmeasured: usize,
    /// Messages of a live receiver that were lost.
    pub lost: usize,
}

impl Raw {
    /// All entries, those that cannot be used too.
    pub fn count(&self) -> usize {
        (self.entries.len() + self.unmeasured).saturating_add(self.unreadable.count)
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Unreadable {
    pub count: usize,
    /// The line (of a folder of files: the number) of the first of them.
    pub first: usize,
    why: String,
}

impl Unreadable {
    pub fn add(&mut self, times: usize, line: usize, why: impl FnOnce() -> String) {
        if self.count == 0 {
            (self.first, self.why) = (line, why());
        }
        self.count = self.count.saturating_add(times);
    }

    /// Returns a sentence if most of all rows are unreadable.
    pub fn are_most(&self, all: usize) -> Option<String> {
        let Self { count, first, why } = self;
        (*count > all / 2).then(|| {
            format!("{count} of its {all} rows cannot be read, the first in line {first}: {why}")
        })
    }
}

fn why(row: &StringRecord, columns: usize) -> String {
    match row.len() {
        fields if fields != columns => format!(
            "it has {fields} fields in place of {columns}: do all rows have the mark between columns that the first row has, and decimal points in place of commas?"
        ),
        _ => {
            let row = quoted(&row.iter().collect::<Vec<_>>().join("; "));
            format!(
                "in {row}, write stamps as seconds or nanoseconds since 1970, numbers with decimal points, and degrees to the south and to the west with a minus"
            )
        }
    }
}

/// Returns the stretches of `count` rows between these starts of new ones.
pub(crate) fn between(count: usize, starts: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let ends = (count > 0).then_some(count);
    let bounds: Vec<usize> = iter::once(0).chain(starts).chain(ends).collect();
    bounds.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

/// Returns the chain of stretches with the most rows; each stretch follows the one before. No two
/// neighbours of it are more than `look_back` stretches apart.
pub(crate) fn longest_chain(
    stretches: &[Range<usize>],
    look_back: usize,
    follows: impl Fn(usize, usize) -> bool,
) -> Vec<Range<usize>> {
    // The rows of the best chain that ends with a stretch, and the stretch before that.
    let mut best: Vec<(usize, Option<usize>)> = Vec::new();
    for (k, stretch) in stretches.iter().enumerate() {
        let before = (k.saturating_sub(look_back)..k)
            .filter(|earlier| follows(*earlier, k))
            .max_by_key(|earlier| best[*earlier].0);
        best.push((stretch.len() + before.map_or(0, |k| best[k].0), before));
    }
    let mut at = (0..best.len()).max_by_key(|k| best[*k].0);
    let mut chain = Vec::new();
    while let Some(k) = at {
        chain.push(stretches[k].clone());
        at = best[k].1;
    }
    chain.reverse();
    chain
}
