//! Properties of a dataset from its first image with Navtech metadata columns.

use super::encoder::EncoderTurn;
use super::error::ReadError;
use super::images::Images;
use super::navtech_png::{METADATA_BYTES, RowMetadata, chirps_alternate, rows};
use super::stamp;

/// Maximum difference between the time in the name of a file and the stamp of a row that it refers
/// to, ns.
const SAME_TIME_NS: i64 = 5_000_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NamedBy {
    Start,
    /// The time of row `n / 2 - 1`.
    Middle,
    End,
}

impl NamedBy {
    pub(crate) fn description(self) -> &'static str {
        match self {
            Self::Start => "the sweep's start",
            Self::Middle => "the sweep's middle",
            Self::End => "the sweep's end",
        }
    }
}

pub(crate) struct FirstImage {
    rows: Vec<RowMetadata>,
    pub(crate) bins: usize,
    pub(crate) name_ns: Option<i64>,
}

impl FirstImage {
    /// Returns `None` if the first images are damaged, or too narrow for metadata.
    pub(crate) fn read(images: &mut Images) -> Result<Option<Self>, ReadError> {
        if images.size.width <= METADATA_BYTES || images.size.height < 2 {
            return Ok(None);
        }
        let found = images.first_readable()?;
        Ok(found.map(|(index, size, pixels)| Self {
            rows: rows(&pixels, size).collect(),
            bins: size.width - METADATA_BYTES,
            name_ns: images.name_stamp_ns(index),
        }))
    }

    pub(crate) fn has_stamps(&self) -> bool {
        (0..self.rows.len()).all(|row| self.row_ns(row).is_some())
    }

    pub(crate) fn nanoseconds(&self) -> bool {
        let first = self.rows.first();
        first.is_some_and(|row| stamp::plausible(row.stamp))
    }

    pub(crate) fn row_ns(&self, row: usize) -> Option<i64> {
        stamp::to_ns(self.rows.get(row)?.stamp)
    }

    pub(crate) fn chirps_alternate(&self) -> bool {
        chirps_alternate(self.rows.iter().map(|row| row.byte_ten))
    }

    pub(crate) fn byte_ten_is_zero(&self) -> bool {
        self.rows.iter().all(|row| row.byte_ten == 0)
    }

    /// Returns the time in the sweep that the file is named by; `None` if its name is not a time of
    /// the sweep.
    pub(crate) fn named_by(&self) -> Option<NamedBy> {
        let (name, count) = (self.name_ns?, self.rows.len());
        let rows = [
            (NamedBy::Start, 0),
            (NamedBy::Middle, count / 2 - 1),
            (NamedBy::End, count - 1),
        ];
        let distance = |(by, row)| Some((by, (self.row_ns(row)? - name).abs()));
        let nearest = rows.into_iter().filter_map(distance);
        let (by, near) = nearest.min_by_key(|(_, distance)| *distance)?;
        (near <= SAME_TIME_NS).then_some(by)
    }

    /// Minimum, maximum and mean time between consecutive rows, ns.
    pub(crate) fn row_intervals_ns(&self) -> Option<(i64, i64, i64)> {
        let stamps = (0..self.rows.len()).map_while(|row| self.row_ns(row));
        let stamps: Vec<i64> = stamps.collect();
        let intervals = || stamps.windows(2).map(|w| w[1] - w[0]);
        let mean = (stamps.last()? - stamps.first()?) / (stamps.len().max(2) as i64 - 1);
        Some((intervals().min()?, intervals().max()?, mean))
    }

    pub(crate) fn turn(&self) -> EncoderTurn {
        turn_of(&self.rows)
    }
}

pub(crate) fn turn_of(rows: &[RowMetadata]) -> EncoderTurn {
    let counts: Vec<u16> = rows.iter().map(|row| row.count).collect();
    EncoderTurn::new(&counts, |row| stamp::to_ns(rows.get(row)?.stamp))
}
