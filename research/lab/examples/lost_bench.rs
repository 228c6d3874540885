//! Time to find lost azimuths on one thread: medians over the scans of RADIATE's recordings in
//! `GYRE_DATA`, those that have lost some and the others.
//!
//! `cargo run --release --manifest-path research/Cargo.toml -p gyre-lab --example lost_bench`

use std::{error::Error, path::Path, time::Instant};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{Twist, LostAzimuths, OwnedScan};
use gyre_radar::{LostAzimuthFinder, lost::stale_rows};

/// Recordings, and a typical speed, m/s.
const RECORDINGS: [(&str, f64); 3] = [
    ("radiate-2019-02-12", 7.0),
    ("radiate-2019-02-12-b", 5.0),
    ("radiate-2019-02-12-standing", 0.0),
];
const REPETITIONS: usize = 7;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return Ok(());
    };
    println!(
        "{:>28} {:>6} {:>10} {:>14}",
        "recording", "scans", "lost, ms", "none lost, ms"
    );
    for (recording, speed_mps) in RECORDINGS {
        let (mut lossy, mut whole) = measure(&Path::new(&data).join(recording), speed_mps)?;
        println!(
            "{recording:>28} {:>6} {:>10.3} {:>14.3}",
            lossy.len() + whole.len(),
            median(&mut lossy),
            median(&mut whole)
        );
    }
    Ok(())
}

/// Returns the times of scans that have lost azimuths, and of the others, ms.
fn measure(folder: &Path, speed_mps: f64) -> Result<(Vec<f64>, Vec<f64>), Box<dyn Error>> {
    let mut dataset = gyre_datasets::open(folder, &DatasetOptions::default())?;
    let twist = Twist {
        vx_mps: speed_mps,
        ..Twist::default()
    };
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut previous: Option<(OwnedScan, LostAzimuths)> = None;
    let mut finder = LostAzimuthFinder::default();
    let (mut lossy, mut whole) = (Vec::new(), Vec::new());
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot())?;
        let view = scan.view();
        let mut found = LostAzimuths::default();
        let mut times: [f64; REPETITIONS] = std::array::from_fn(|_| {
            match &previous {
                Some((before, lost)) => finder.set_previous(&before.view(), lost),
                None => finder.reset(),
            }
            let start = Instant::now();
            found = finder.find(std::hint::black_box(&view), Some(twist));
            start.elapsed().as_secs_f64() * 1e3
        });
        match stale_rows(&view) {
            0 => whole.push(median(&mut times)),
            _ => lossy.push(median(&mut times)),
        }
        previous = Some((scan.clone(), found));
    }
    Ok((lossy, whole))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
