//! The columns of a table that have the values of a sample, and how each is read.

use csv::StringRecord;

use crate::header::{Sign, Stamp};

#[derive(Clone)]
pub(crate) struct Columns {
    pub stamp: Stamp,
    fields: Vec<Field>,
    pub form: Form,
}

/// The form of the values.
#[derive(Clone, Copy, Default)]
pub(crate) struct Form {
    pub unit_is_assumed: bool,
    /// Places are m east and north, and not degrees of latitude and longitude.
    pub is_plane: bool,
    pub counts: Option<Counts>,
}

/// The unit of values that count since some time.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Counts {
    Ticks,
    Metres,
}

#[derive(Clone, Copy)]
struct Field {
    value: usize,
    column: usize,
    read: Read,
}

#[derive(Clone, Copy)]
pub(crate) enum Read {
    /// A number times this factor: `nan` is one.
    Number(f64),
    /// The same, where any other text is not a number.
    NumberIfAny(f64),
    /// A number with the sign in this column.
    Signed(usize, &'static Sign),
    /// The value of this function of a number; a field is blank if the sensor does not know it.
    OrBlank(fn(f64) -> f64),
    /// 1 for this text, 0 for any other.
    Is(&'static str),
}

impl Columns {
    pub fn of(stamp: Stamp) -> Self {
        Self {
            stamp,
            fields: Vec::new(),
            form: Form::default(),
        }
    }

    /// Adds the columns of the values from this one on.
    pub fn with(
        mut self,
        first: usize,
        columns: impl IntoIterator<Item = usize>,
        read: Read,
    ) -> Self {
        let field = |(value, column)| Field {
            value,
            column,
            read,
        };
        self.fields.extend((first..).zip(columns).map(field));
        self
    }

    /// Reads the stamp and the values of a row; `None` if a field is missing or no number.
    pub fn read(&self, row: &StringRecord) -> Option<(i64, [f64; 6])> {
        let mut values = [0.0; 6];
        for field in &self.fields {
            values[field.value] = field.read(row)?;
        }
        Some((self.stamp.ns(row)?, values))
    }

    /// Returns whether a row has a stamp, and the columns of this many first values are blank.
    pub fn are_blank(&self, values: usize, row: &StringRecord) -> bool {
        let mut first = self.fields.iter().filter(|field| field.value < values);
        self.stamp.ns(row).is_some() && first.all(|field| row.get(field.column) == Some(""))
    }
}

impl Field {
    fn read(&self, row: &StringRecord) -> Option<f64> {
        let text = row.get(self.column)?;
        let number = text.parse::<f64>().ok();
        let known = || {
            if text.is_empty() {
                Some(f64::NAN)
            } else {
                number
            }
        };
        match self.read {
            Read::Number(factor) => Some(number? * factor),
            Read::NumberIfAny(factor) => Some(number.unwrap_or(f64::NAN) * factor),
            Read::Signed(column, sign) => sign.apply(number?, row.get(column)?),
            Read::OrBlank(of) => known().map(of),
            Read::Is(known) => Some(f64::from(text == known)),
        }
    }
}
