//! Tables as CSV.

use std::path::Path;

use csv::StringRecord;
use gyre_storage as storage;

use super::{LogError, Raw, columns::Columns};
use gyre_samples::{Sample, SampleKind};

/// The largest file: a day of samples at 200 Hz has 2 GB.
const MAX_BYTES: u64 = 4 << 30;
/// Marks between columns that are looked for in the first row.
const MARKS: [u8; 3] = [b',', b';', b'\t'];

/// The columns of a table in which each row is a sample.
pub(crate) trait SampleColumns: Sized {
    /// The sensor.
    const OF: SampleKind;

    /// Finds the columns by the first row.
    ///
    /// # Errors
    /// A column that is missing, and the remedy.
    fn of(first: &StringRecord) -> Result<Self, String>;

    /// The unit of the values is named nowhere.
    fn unit_is_assumed(&self) -> bool;

    /// Reads a row; `None` if a field is missing or no number. `nan` is one.
    fn sample(&self, row: &StringRecord) -> Option<Sample>;
}

/// Reads a table.
pub(crate) fn read<C: SampleColumns>(path: &Path) -> Result<Raw, LogError> {
    let text = storage::read_text(path, MAX_BYTES).map_err(|source| LogError::Io {
        of: C::OF,
        path: path.to_owned(),
        source,
    })?;
    parse::<C>(&text).map_err(|reason| LogError::Unknown {
        of: C::OF,
        path: path.to_owned(),
        reason,
    })
}

/// Returns a reader of the rows, the first one among them.
pub(crate) fn reader(text: &str) -> csv::Reader<&[u8]> {
    let first = text.lines().next().unwrap_or_default();
    let mark = MARKS
        .into_iter()
        .find(|mark| first.as_bytes().contains(mark));
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(mark.unwrap_or(b','))
        .from_reader(text.as_bytes())
}

fn parse<C: SampleColumns>(text: &str) -> Result<Raw, String> {
    let mut reader = reader(text);
    let mut row = StringRecord::new();
    let mut next = |row: &mut StringRecord| reader.read_record(row).map_err(|e| e.to_string());
    if !next(&mut row)? {
        return Err("it is empty".to_owned());
    }
    let columns = C::of(&row)?;
    let count = row.len();
    let mut raw = Raw {
        unit_is_assumed: columns.unit_is_assumed(),
        ..Raw::default()
    };
    // Without a header the first row is a sample.
    let mut is_sample = row.iter().all(|field| field.parse::<f64>().is_ok());
    loop {
        if is_sample {
            match columns.sample(&row).filter(|_| row.len() == count) {
                Some(sample) => raw.samples.push(sample),
                None => raw.leave_out(row.position().map_or(0, |at| at.line() as usize)),
            }
        }
        if !next(&mut row)? {
            return Ok(raw);
        }
        is_sample = true;
    }
}

impl Raw {
    pub(super) fn leave_out(&mut self, line: usize) {
        if self.unreadable == 0 {
            self.first_unreadable = line;
        }
        self.unreadable += 1;
    }
}

impl SampleColumns for Columns {
    const OF: SampleKind = SampleKind::Gyro;

    fn of(first: &StringRecord) -> Result<Self, String> {
        Self::of(first)
    }

    fn unit_is_assumed(&self) -> bool {
        self.unit_is_assumed
    }

    fn sample(&self, row: &StringRecord) -> Option<Sample> {
        let (column, unit) = self.stamp;
        let stamp_ns = unit.ns(row.get(column)?)?;
        let read = |columns: [usize; 3], factor: f64| {
            let mut values = [0.0; 3];
            for (value, column) in values.iter_mut().zip(columns) {
                *value = row.get(column)?.parse::<f64>().ok()? * factor;
            }
            Some(values)
        };
        let rates = read(self.rates, self.rate_unit)?;
        let accelerations = self.accelerations.and_then(|(at, factor)| read(at, factor));
        Some(sample(stamp_ns, rates, accelerations.unwrap_or_default()))
    }
}

/// A sample of rates and accelerations, which are zero if one of them is not finite.
pub(super) fn sample(stamp_ns: i64, rates: [f64; 3], accelerations: [f64; 3]) -> Sample {
    let are_finite = accelerations.iter().all(|value| value.is_finite());
    let [x, y, z] = rates;
    let [ax, ay, az] = if are_finite { accelerations } else { [0.0; 3] };
    Sample {
        stamp_ns,
        kind: SampleKind::Gyro as u32,
        reserved: 0,
        values: [x, y, z, ax, ay, az],
    }
}
