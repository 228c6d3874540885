use super::{MAX_AZIMUTHS, PolarScan};
use crate::chain::MAX_INTERVAL_NS;
use std::ops::RangeInclusive;

/// Maximum step back from row to row, ns: a clock that is being adjusted. A row that is so much off
/// is displaced by less than a cell of a raster.
const MAX_STEP_BACK_NS: i64 = 5_000_000;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ScanError(String);

impl PolarScan<'_> {
    /// Checks that the slices are as long as the geometry requires, and that every number is within
    /// its bounds.
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
        let resolution_m = geometry.range_resolution_m.into();
        let (offset_m, doppler_s) = (geometry.range_offset_m.into(), geometry.doppler_s.into());
        check_number("range resolution in metres", resolution_m, 1e-3..=1e3)?;
        check_number("range offset in metres", offset_m, -1e4..=1e4)?;
        check_number("Doppler shift in seconds", doppler_s, -1.0..=1.0)?;
        let mut azimuths = self.azimuth_rad[..geometry.azimuths].iter().enumerate();
        match azimuths.find(|(_, azimuth)| !azimuth.is_finite()) {
            Some((index, azimuth)) => Err(ScanError(format!(
                "azimuth {index} of the scan is at {azimuth} rad"
            ))),
            None => Ok(()),
        }
    }

    /// Checks that the times of the rows, and the scan's own, form one sweep. For a scan that
    /// passes [`PolarScan::check`].
    pub fn check_times(&self) -> Result<(), ScanError> {
        let stamps = &self.stamp_ns[..self.geometry.azimuths];
        check_sweep(stamps, MAX_INTERVAL_NS)?;
        let stamp_ns = self.geometry.stamp_ns;
        let apart_ns = stamps
            .first()
            .map_or(0, |first| stamp_ns.saturating_sub(*first));
        match apart_ns.saturating_abs() <= MAX_INTERVAL_NS {
            true => Ok(()),
            false => Err(ScanError(format!(
                "the scan's stamp is {:.3} s from that of its first row",
                seconds(apart_ns)
            ))),
        }
    }
}

/// Checks that the times of the rows, ns, do not decrease, and span at most `max_sweep_ns`.
pub fn check_sweep(stamp_ns: &[i64], max_sweep_ns: i64) -> Result<(), ScanError> {
    let Some(first) = stamp_ns.first().copied() else {
        return Ok(());
    };
    let mut latest = first;
    for (row, stamp) in stamp_ns.iter().copied().enumerate() {
        let (back_ns, after_ns) = (latest.saturating_sub(stamp), stamp.saturating_sub(first));
        if back_ns > MAX_STEP_BACK_NS {
            return Err(ScanError(format!(
                "row {row}: stamp is {:.3} s before that of an earlier row, so the rows are not one sweep: the clock was set in between, or a stamp is damaged",
                seconds(back_ns)
            )));
        }
        if after_ns > max_sweep_ns {
            return Err(ScanError(format!(
                "row {row}: stamp is {:.3} s after that of the first row, so the rows are not one sweep of at most {:.3} s: the clock was set in between, or a stamp is damaged",
                seconds(after_ns),
                seconds(max_sweep_ns)
            )));
        }
        latest = latest.max(stamp);
    }
    Ok(())
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

fn check_length(what: &str, actual: usize, expected: usize) -> Result<(), ScanError> {
    match actual >= expected {
        true => Ok(()),
        false => Err(ScanError(format!(
            "the scan's {what} has {actual} elements, but its geometry requires {expected}"
        ))),
    }
}

fn check_number(what: &str, value: f64, bounds: RangeInclusive<f64>) -> Result<(), ScanError> {
    match bounds.contains(&value) {
        true => Ok(()),
        false => Err(ScanError(format!(
            "the scan's {what} is {value}, expected {} to {}",
            bounds.start(),
            bounds.end()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_times_of_a_sweep_increase_and_span_one_sweep() {
        const YEAR_NS: i64 = 31_536_000_000_000_000;
        let sweep = |edit: fn(&mut [i64])| {
            let mut stamps: Vec<i64> = (0..400)
                .map(|row| 1_547_131_046_000_000_000 + row * 625_000)
                .collect();
            edit(&mut stamps);
            check_sweep(&stamps, 500_000_000)
        };
        assert!(sweep(|_| ()).is_ok());
        assert!(
            sweep(|stamps| stamps[200] -= 3_000_000).is_ok(),
            "an adjusted clock"
        );
        let names = |result: Result<(), ScanError>, row: usize, words: &str| {
            let sentence = result.unwrap_err().to_string();
            sentence.starts_with(&format!("row {row}: ")) && sentence.contains(words)
        };
        let order = |result, row| names(result, row, "before that of an earlier row");
        let time = |result, row| names(result, row, "after that of the first row");
        assert!(order(sweep(|stamps| stamps[0] += 300_000_000), 1));
        assert!(order(sweep(|stamps| stamps[200] -= YEAR_NS), 200));
        assert!(order(sweep(|stamps| stamps[399] -= 20_000_000), 399));
        assert!(time(sweep(|stamps| stamps[0] -= YEAR_NS), 1));
        assert!(time(sweep(|stamps| stamps[200] += YEAR_NS), 200));
        assert!(time(
            sweep(|stamps| stamps[300..]
                .iter_mut()
                .for_each(|stamp| *stamp += 400_000_000)),
            300
        ));
    }
}
