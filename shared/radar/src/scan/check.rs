//! Consistency of a scan with its geometry.

use super::{MAX_AZIMUTHS, PolarScan};
use std::ops::RangeInclusive;

/// An inconsistent scan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// A slice is shorter than the geometry requires.
    #[error("the scan's {what} has {actual} elements, but its geometry requires {expected}")]
    Length {
        /// The slice.
        what: &'static str,
        /// Elements required by the geometry.
        expected: usize,
        /// Elements present.
        actual: usize,
    },
    /// A number of the geometry is out of bounds.
    #[error("the scan's {what} is {value}, expected {} to {}", bounds.start(), bounds.end())]
    Geometry {
        /// The number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Permitted values.
        bounds: RangeInclusive<f64>,
    },
    /// The angle of an azimuth is not finite.
    #[error("azimuth {index} of the scan is at {value} rad")]
    Azimuth {
        /// The row.
        index: usize,
        /// Its angle.
        value: f32,
    },
}

impl PolarScan<'_> {
    /// Checks that the slices are as long as the geometry requires, and that every number is within its bounds.
    ///
    /// # Errors
    /// Returns the first inconsistency.
    pub fn check(&self) -> Result<(), ScanError> {
        let geometry = &self.geometry;
        check_length("azimuth table", self.azimuth_rad.len(), geometry.azimuths)?;
        check_length("stamp table", self.stamp_ns.len(), geometry.azimuths)?;
        check_length("flag table", self.flags.len(), geometry.azimuths)?;
        if geometry.azimuths > 0 {
            let last_row = (geometry.azimuths - 1).saturating_mul(geometry.stride);
            let bytes = last_row
                .saturating_add(geometry.first_byte)
                .saturating_add(geometry.bins);
            check_length("image", self.bytes.len(), bytes)?;
        }
        check_number(
            "number of azimuths",
            geometry.azimuths as f64,
            0.0..=MAX_AZIMUTHS as f64,
        )?;
        check_number("number of bins", geometry.bins as f64, 0.0..=1e6)?;
        if geometry.azimuths > 1 {
            let bins = geometry.bins as f64;
            check_number("row stride in bytes", geometry.stride as f64, bins..=1e9)?;
        }
        check_number(
            "range resolution in metres",
            geometry.range_resolution_m.into(),
            1e-3..=1e3,
        )?;
        check_number(
            "range offset in metres",
            geometry.range_offset_m.into(),
            -1e4..=1e4,
        )?;
        check_number(
            "Doppler shift in seconds",
            geometry.doppler_s.into(),
            -1.0..=1.0,
        )?;
        match self.azimuth_rad[..geometry.azimuths]
            .iter()
            .position(|azimuth| !azimuth.is_finite())
        {
            Some(index) => Err(ScanError::Azimuth {
                index,
                value: self.azimuth_rad[index],
            }),
            None => Ok(()),
        }
    }
}

fn check_length(what: &'static str, actual: usize, expected: usize) -> Result<(), ScanError> {
    match actual >= expected {
        true => Ok(()),
        false => Err(ScanError::Length {
            what,
            expected,
            actual,
        }),
    }
}

fn check_number(
    what: &'static str,
    value: f64,
    bounds: RangeInclusive<f64>,
) -> Result<(), ScanError> {
    match bounds.contains(&value) {
        true => Ok(()),
        false => Err(ScanError::Geometry {
            what,
            value,
            bounds,
        }),
    }
}
