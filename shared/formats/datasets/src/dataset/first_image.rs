//! Properties of a dataset from its first image with Navtech metadata columns.

use super::encoder::EncoderTurn;
use super::error::ReadError;
use super::image_size::ImageSize;
use super::images::Images;
use super::navtech_png::{METADATA_BYTES, RowMetadata, chirps_alternate, rows};
use super::stamp;

/// Maximum difference between the time in the name of a file and the stamp of a row that it refers
/// to, ns.
const SAME_TIME_NS: i64 = 5_000_000;

/// The time in the sweep that an image is named by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NamedBy {
    /// The time of the first row.
    Start,
    /// The time of row `n / 2 - 1`.
    Middle,
    /// The time of the last row.
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

/// The metadata of the first image that can be read.
#[derive(Debug)]
pub(crate) struct FirstImage {
    pub(crate) size: ImageSize,
    rows: Vec<RowMetadata>,
    name_ns: Option<i64>,
}

impl FirstImage {
    /// Returns `None` if the first images are damaged, or too narrow for metadata.
    pub(crate) fn read(images: &mut Images) -> Result<Option<Self>, ReadError> {
        let size = images.size;
        if size.width <= METADATA_BYTES || size.height < 2 {
            return Ok(None);
        }
        let found = images.first_readable()?;
        Ok(found.map(|(index, size, pixels)| Self {
            size,
            rows: rows(&pixels, size).collect(),
            name_ns: images.name_stamp_ns(index),
        }))
    }

    /// Time in the name of the file, ns.
    pub(crate) fn name_ns(&self) -> Option<i64> {
        self.name_ns
    }

    pub(crate) fn bins(&self) -> usize {
        self.size.width - METADATA_BYTES
    }

    /// Returns whether every row has a plausible time.
    pub(crate) fn has_stamps(&self) -> bool {
        self.rows
            .iter()
            .all(|row| stamp::to_ns(row.stamp).is_some())
    }

    /// Returns whether the stamps of the rows are in ns.
    pub(crate) fn nanoseconds(&self) -> bool {
        self.rows
            .first()
            .is_some_and(|row| stamp::plausible(row.stamp))
    }

    /// Time of a row, ns.
    fn row_ns(&self, row: usize) -> Option<i64> {
        self.rows.get(row).and_then(|row| stamp::to_ns(row.stamp))
    }

    /// Time of the first row, ns.
    pub(crate) fn start_ns(&self) -> Option<i64> {
        self.row_ns(0)
    }

    /// Returns whether byte 10 is the direction of the chirp.
    pub(crate) fn chirps_alternate(&self) -> bool {
        chirps_alternate(self.rows.iter().map(|row| row.byte_ten))
    }

    /// Returns whether byte 10 is 0 in every row.
    pub(crate) fn byte_ten_is_zero(&self) -> bool {
        self.rows.iter().all(|row| row.byte_ten == 0)
    }

    /// Returns the time in the sweep that the file is named by; `None` if its name is not a time of
    /// the sweep.
    pub(crate) fn named_by(&self) -> Option<NamedBy> {
        let (name, last) = (self.name_ns?, self.rows.len() - 1);
        let rows = [
            (NamedBy::Start, 0),
            (NamedBy::Middle, self.rows.len() / 2 - 1),
            (NamedBy::End, last),
        ];
        let distance = |row| Some((self.row_ns(row)? - name).abs());
        let (by, near) = rows
            .into_iter()
            .filter_map(|(by, row)| Some((by, distance(row)?)))
            .min_by_key(|(_, d)| *d)?;
        (near <= SAME_TIME_NS).then_some(by)
    }

    /// Minimum, maximum and mean time between consecutive rows, ns.
    pub(crate) fn row_intervals_ns(&self) -> Option<(i64, i64, i64)> {
        let stamps: Vec<i64> = self
            .rows
            .iter()
            .map_while(|row| stamp::to_ns(row.stamp))
            .collect();
        let intervals = || stamps.windows(2).map(|w| w[1] - w[0]);
        let mean = (stamps.last()? - stamps.first()?) / (stamps.len().max(2) as i64 - 1);
        Some((intervals().min()?, intervals().max()?, mean))
    }

    /// The turn of the rows.
    pub(crate) fn turn(&self) -> EncoderTurn {
        EncoderTurn::new(self.rows.iter().map(|row| row.count).collect(), |row| {
            self.row_ns(row)
        })
    }
}
