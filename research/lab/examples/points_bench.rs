//! Time to extract the points of a scan on one thread, and their number: medians over the first
//! scans of each recording in `GYRE_DATA`.
//!
//! `cargo run --release --manifest-path research/Cargo.toml -p gyre-lab --example points_bench`

use std::{error::Error, path::Path, time::Instant};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{SparsePoint, OwnedScan};
use gyre_radar::{PointExtractor, PointsConfig};

const RECORDINGS: [&str; 2] = ["radiate-2019-02-12", "oxford-2019-01-10-14-36-48"];
const SCANS: usize = 50;
const FLOORS: [u8; 3] = [60, 40, 0];
const REPETITIONS: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return Ok(());
    };
    println!("one thread; medians over scans");
    println!(
        "{:>28} {:>12} {:>6} {:>8} {:>8}",
        "recording", "sweep", "floor", "points", "ms"
    );
    for recording in RECORDINGS {
        let scans = first_scans(&Path::new(&data).join(recording))?;
        let sweep = format!(
            "{} x {}",
            scans[0].geometry.azimuths, scans[0].geometry.bins
        );
        for floor in FLOORS {
            let (points, ms) = measure(&scans, floor)?;
            println!("{recording:>28} {sweep:>12} {floor:>6} {points:>8} {ms:>8.3}");
        }
    }
    Ok(())
}

fn first_scans(folder: &Path) -> Result<Vec<OwnedScan>, Box<dyn Error>> {
    let mut dataset = gyre_datasets::open(folder, &DatasetOptions::default())?;
    let count = SCANS.min(dataset.len());
    let read = |index| {
        let mut scan = OwnedScan::with_limits(dataset.limits());
        scan.geometry = dataset.read(index, scan.slot())?;
        Ok(scan)
    };
    (0..count).map(read).collect()
}

/// Returns the medians of the number of points and of the time, ms.
fn measure(scans: &[OwnedScan], floor: u8) -> Result<(usize, f64), Box<dyn Error>> {
    let config = PointsConfig::default();
    let mut extractor = PointExtractor::new(&config)?;
    let mut out = vec![SparsePoint::default(); config.capacity];
    let (mut counts, mut times) = (Vec::new(), Vec::new());
    // Repetitions in the outer loop, so that a scan has left the cache before it is processed
    // again.
    for _ in 0..REPETITIONS {
        for scan in scans {
            let start = Instant::now();
            counts.push(extractor.extract(&scan.view(), floor, &mut out)?);
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    counts.sort_unstable();
    times.sort_unstable_by(f64::total_cmp);
    Ok((counts[counts.len() / 2], times[times.len() / 2]))
}
