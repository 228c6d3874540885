//! What one image with Navtech's columns says of its dataset, before anything is decided.

use super::image_size::ImageSize;
use super::images::Images;
use super::navtech_png::{METADATA_BYTES, RowMetadata, chirps_alternate, rows};
use super::stamp;

/// How near the time in a file's name must be to a row's to count as that row's, ns.
const SAME_TIME_NS: i64 = 5_000_000;

/// Which time of the sweep an image is named by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NamedBy {
    /// The first row's.
    Start,
    /// That of row `n / 2 - 1`.
    Middle,
    /// The last row's.
    End,
}

impl NamedBy {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Start => "the sweep's start",
            Self::Middle => "the sweep's middle",
            Self::End => "the sweep's end",
        }
    }
}

/// The metadata of the first image that can be read.
#[derive(Debug)]
pub(crate) struct FirstLook {
    pub(crate) size: ImageSize,
    rows: Vec<RowMetadata>,
    name_ns: Option<i64>,
}

impl FirstLook {
    /// `None` where no image can be read or they are too narrow for metadata.
    pub(crate) fn take(images: &mut Images) -> Option<Self> {
        let size = images.size;
        if size.width <= METADATA_BYTES || size.height < 2 {
            return None;
        }
        let (index, pixels) = images.first_readable()?;
        Some(Self {
            size,
            rows: rows(&pixels, size).collect(),
            name_ns: images.name_stamp_ns(index),
        })
    }

    /// Range bins.
    pub(crate) fn bins(&self) -> usize {
        self.size.width - METADATA_BYTES
    }

    /// Whether every row bears a time at which a radar may have run.
    pub(crate) fn has_stamps(&self) -> bool {
        self.rows
            .iter()
            .all(|row| stamp::to_ns(row.stamp).is_some())
    }

    /// Whether the rows' stamps are in nanoseconds.
    pub(crate) fn nanoseconds(&self) -> bool {
        self.rows
            .first()
            .is_some_and(|row| stamp::plausible(row.stamp))
    }

    /// A row's time, ns.
    fn row_ns(&self, row: usize) -> Option<i64> {
        self.rows.get(row).and_then(|row| stamp::to_ns(row.stamp))
    }

    /// The first row's time, ns.
    pub(crate) fn start_ns(&self) -> Option<i64> {
        self.row_ns(0)
    }

    /// Whether byte 10 is the chirp's direction.
    pub(crate) fn chirps_alternate(&self) -> bool {
        chirps_alternate(self.rows.iter().map(|row| row.byte_ten))
    }

    /// Whether byte 10 is 0 in every row.
    pub(crate) fn byte_ten_is_zero(&self) -> bool {
        self.rows.iter().all(|row| row.byte_ten == 0)
    }

    /// Which of the rows' times the file is named by; `None` where its name is no time or near none of them.
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

    /// Least and most time between neighbouring rows, ns, and the mean.
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

    /// Encoder counts from row to row where all rows have the same step, and over the seam from the last row to the first.
    pub(crate) fn encoder_step(&self, counts: u16) -> Option<(u16, u16)> {
        let step = self.rows[1].count.checked_sub(self.rows[0].count)?;
        let even = self
            .rows
            .windows(2)
            .all(|w| w[1].count.checked_sub(w[0].count) == Some(step));
        let (first, last) = (self.rows[0].count, self.rows[self.rows.len() - 1].count);
        let seam = first.checked_add(counts)?.checked_sub(last)?;
        even.then_some((step, seam))
    }
}
