//! The difference between a scan and the next, seen from the same place.

use gyre_geometry::{Pose, Twist};
use gyre_radar::{RasterConfig, RasterError, Rasteriser, Sampling};
use ndarray::{Array2, s};

use super::sample::Sample;

/// Cells of the rasters in which consecutive scans are compared, m.
const CELL_M: f32 = 0.4;

/// The difference between consecutive scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Pairs of scans that were compared.
    pub pairs: usize,
    /// Correlation coefficient of the powers above the threshold, the mean over the pairs.
    pub correlation: f64,
    /// Share of the cells with a return that have none within one cell in the other scan, both
    /// ways.
    pub unmatched_share: f64,
}

/// Compares each scan with the one before it where the motion between them is known, in rasters
/// that reach to `range_m`. What is not above `threshold` is no return. `None` where nothing could
/// be compared.
///
/// Both are drawn as seen from where the sensor was half-way between, by one motion at constant
/// velocity through both sweeps: so both sweeps are motion-compensated and aligned in one step, and
/// blurred alike. A motion that no sensor makes is a wrong one: those scans are not compared.
///
/// # Errors
/// A raster that cannot be made.
pub fn change(
    samples: &[Sample],
    range_m: f64,
    threshold: u8,
) -> Result<Option<Change>, RasterError> {
    let n = 2 * (range_m / f64::from(CELL_M)) as usize + 1;
    let mut rasteriser = Rasteriser::new(&RasterConfig {
        n,
        cell_m: CELL_M,
        sampling: Sampling::Averaged,
        ..RasterConfig::default()
    })?;
    let mut rasters = [Array2::zeros((n, n)), Array2::zeros((n, n))];
    let (mut pairs, mut correlations, mut returns, mut alone) = (0, 0.0, 0, 0);
    for pair in samples.windows(2) {
        let Some(motion) = &pair[1].motion else {
            continue;
        };
        match draw(
            [&pair[0], &pair[1]],
            motion,
            threshold,
            &mut rasteriser,
            &mut rasters,
        ) {
            Err(RasterError::Twist { .. }) => continue,
            drawn => drawn?,
        }
        let [earlier, later] = &rasters;
        if let Some(correlation) = correlation(earlier, later) {
            pairs += 1;
            correlations += correlation;
        }
        for (these, those) in [(earlier, later), (later, earlier)] {
            returns += these.iter().filter(|power| **power > 0.0).count();
            alone += unmatched(these, those);
        }
    }
    Ok((pairs > 0 && returns > 0).then(|| Change {
        pairs,
        correlation: correlations / pairs as f64,
        unmatched_share: alone as f64 / returns as f64,
    }))
}

fn draw(
    pair: [&Sample; 2],
    motion: &Pose,
    threshold: u8,
    rasteriser: &mut Rasteriser,
    rasters: &mut [Array2<f32>; 2],
) -> Result<(), RasterError> {
    let [from_ns, to_ns] = pair.map(|sample| sample.scan.geometry.stamp_ns);
    let interval_ns = to_ns.saturating_sub(from_ns);
    let twist = Twist::from_motion(motion, interval_ns as f64 * 1e-9);
    for (sample, raster) in pair.into_iter().zip(rasters) {
        let mut scan = sample.scan.view();
        scan.geometry.stamp_ns = from_ns + interval_ns / 2;
        rasteriser.rasterise(&scan, threshold, Some(twist), raster.view_mut())?;
    }
    Ok(())
}

/// Pearson's coefficient over the cells in the raster's circle; `None` where one of them is the
/// same everywhere.
fn correlation(a: &Array2<f32>, b: &Array2<f32>) -> Option<f64> {
    let half = (a.nrows() / 2) as i64;
    let in_circle = |(row, column): (usize, usize)| {
        let (ahead, left) = (row as i64 - half, column as i64 - half);
        ahead * ahead + left * left <= half * half
    };
    let cells = a.indexed_iter().zip(b);
    let cells = cells.filter(|((place, _), _)| in_circle(*place));
    let [n, sum_a, sum_b, aa, bb, ab] = cells.fold([0.0; 6], |sums, ((_, a), b)| {
        let (a, b) = (f64::from(*a), f64::from(*b));
        let terms = [1.0, a, b, a * a, b * b, a * b];
        std::array::from_fn(|k| sums[k] + terms[k])
    });
    let covariance = |products: f64, x: f64, y: f64| products / n - x / n * (y / n);
    let variances = covariance(aa, sum_a, sum_a) * covariance(bb, sum_b, sum_b);
    (variances > 0.0).then(|| covariance(ab, sum_a, sum_b) / variances.sqrt())
}

/// Returns the number of cells with a return that have none within one cell in `those`.
fn unmatched(these: &Array2<f32>, those: &Array2<f32>) -> usize {
    let within_one = |place: usize| place.saturating_sub(1)..(place + 2).min(these.nrows());
    let alone = |((row, column), power): &((usize, usize), &f32)| {
        let near = || those.slice(s![within_one(*row), within_one(*column)]);
        **power > 0.0 && near().iter().all(|power| *power <= 0.0)
    };
    these.indexed_iter().filter(alone).count()
}
