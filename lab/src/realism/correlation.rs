//! Autocorrelation of powers in range and in azimuth, after subtracting the mean at their range: 1
//! at lag 0.
//!
//! Sums of powers and of their products are whole numbers: nothing is lost, whatever the order.

use super::{grid::RangeGrid, sample::Sample};

/// Longest lag in range, m.
const RANGE_LAG_M: f32 = 12.0;
/// Longest lag in azimuth: this part of a turn.
const TURN_PART: usize = 8;

/// Returns the mean power at each range.
pub fn mean_power(samples: &[Sample], grid: RangeGrid) -> Vec<f64> {
    let mut sums = vec![0u64; grid.cells];
    for row in samples.iter().flat_map(rows) {
        let cells = sums.iter_mut().zip(row);
        cells.for_each(|(sum, power)| *sum += u64::from(*power));
    }
    let count = row_count(samples);
    sums.into_iter().map(|sum| sum as f64 / count).collect()
}

/// Returns the autocorrelation in range by lags in cells; nothing where all powers at a range are
/// the same.
pub fn in_range(samples: &[Sample], means: &[f64], grid: RangeGrid) -> Vec<f64> {
    let lags = (RANGE_LAG_M / grid.resolution_m) as usize + 1;
    let covariance = |lag: usize| {
        let products = samples
            .iter()
            .flat_map(rows)
            .map(|row| dot(row, &row[lag..]));
        let expected: f64 = means.iter().zip(&means[lag..]).map(|(a, b)| a * b).sum();
        let pairs = grid.cells - lag;
        (products.sum::<u64>() as f64 / row_count(samples) - expected) / pairs as f64
    };
    normalised((0..lags.min(grid.cells)).map(covariance).collect())
}

/// Returns the autocorrelation in azimuth, round the whole turn, by lags in azimuths; nothing where
/// all powers at a range are the same.
pub fn in_azimuth(samples: &[Sample], means: &[f64]) -> Vec<f64> {
    let azimuths = samples
        .first()
        .map_or(0, |sample| sample.scan.geometry.azimuths);
    let expected: f64 = means.iter().map(|mean| mean * mean).sum();
    let covariance = |lag: usize| {
        let products = |sample: &Sample| -> u64 {
            rows(sample)
                .zip(rows(sample).cycle().skip(lag))
                .map(|(a, b)| dot(a, b))
                .sum()
        };
        samples.iter().map(products).sum::<u64>() as f64 / row_count(samples) - expected
    };
    normalised((0..azimuths.div_ceil(TURN_PART)).map(covariance).collect())
}

/// Returns the lag at which an autocorrelation first falls to a half, on the straight line between
/// its values; `None` where it never does.
///
/// A half rather than 1/e: streets and streaks give the curve a long flat tail, and there 1/e lies.
/// In range it is crossed at 2.5 to 4.4 m on real drives that have 1.2 to 1.4 m at a half.
pub fn lag_at_half(values: &[f64]) -> Option<f64> {
    let level = 0.5;
    let after = values.iter().position(|value| *value <= level)?;
    let (above, below) = (values[after.checked_sub(1)?], values[after]);
    Some(after as f64 - (below - level) / (below - above))
}

fn normalised(covariances: Vec<f64>) -> Vec<f64> {
    match covariances.first().copied() {
        // What is left of rounding is no variance.
        Some(variance) if variance > 1e-9 => covariances.iter().map(|c| c / variance).collect(),
        _ => Vec::new(),
    }
}

/// The powers of a scan on the grid, azimuth by azimuth.
fn rows(sample: &Sample) -> impl Iterator<Item = &[u8]> + Clone {
    sample.scan.bytes.chunks_exact(sample.scan.geometry.bins)
}

fn row_count(samples: &[Sample]) -> f64 {
    let azimuths = samples.iter().map(|sample| sample.scan.geometry.azimuths);
    azimuths.sum::<usize>() as f64
}

/// Sum of the products over the shorter of both.
fn dot(a: &[u8], b: &[u8]) -> u64 {
    // Fewer products of two bytes than overflow a u32.
    const SAFE: usize = 1 << 16;
    let products = |(a, b): (&[u8], &[u8])| {
        let products = a.iter().zip(b).map(|(a, b)| u32::from(*a) * u32::from(*b));
        u64::from(products.sum::<u32>())
    };
    a.chunks(SAFE).zip(b.chunks(SAFE)).map(products).sum()
}
