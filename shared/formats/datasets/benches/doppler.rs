//! Median time to estimate the velocity of a scan by Doppler, and the velocity:
//! `GYRE_DATA=... cargo bench -p gyre-datasets --bench doppler`.

use std::path::PathBuf;
use std::time::Instant;

use gyre_datasets::{DatasetOptions, open};
use gyre_radar::{DopplerEstimator, OwnedScan, PointsConfig};

const ROUNDS: usize = 200;

fn main() {
    let Some(root) = std::env::var_os("GYRE_DATA").map(PathBuf::from) else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    let options = DatasetOptions {
        doppler_s: Some(0.049),
        ..DatasetOptions::default()
    };
    let mut dataset = match open(&root.join("samples/boreas-rt-2024-12-03"), &options) {
        Ok(dataset) => dataset,
        Err(error) => return println!("skipped: {error}"),
    };
    let mut scan = OwnedScan::with_limits(dataset.limits());
    match dataset.read(0, scan.slot()) {
        Ok(geometry) => scan.geometry = geometry,
        Err(error) => return println!("{error}"),
    }
    let min_range_m = PointsConfig::default().min_range_m;
    let mut estimator = DopplerEstimator::default();
    let mut times_ms: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            let _ = std::hint::black_box(estimator.estimate(&scan.view(), min_range_m));
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times_ms.sort_unstable_by(f64::total_cmp);
    let found = estimator.estimate(&scan.view(), min_range_m);
    println!("{:.2} ms: {found:?}", times_ms[ROUNDS / 2]);
}
