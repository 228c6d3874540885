//! Median time to read a scan: `GYRE_DATA=... cargo bench -p gyre-datasets --bench read`.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_datasets::{DatasetOptions, OpenError, inspect, open};
use gyre_geometry::OwnedScan;

const ROUNDS: usize = 200;

fn main() {
    let Some(root) = std::env::var_os("GYRE_DATA").map(PathBuf::from) else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    for folder in [
        "oxford-2019-01-10-14-36-48",
        "radiate-2019-02-12",
        "samples/boreas-rt-2024-12-03",
    ] {
        if let Err(error) = measure(&root.join(folder)) {
            println!("{folder}: {error}");
        }
    }
}

fn measure(root: &Path) -> Result<(), OpenError> {
    let mut dataset = open(root, &DatasetOptions::default())?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut file = Vec::new();
    let (mut reading, mut decoding) = (Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        let index = round % dataset.len();
        let start = Instant::now();
        if let Err(error) = dataset.read(index, scan.slot()) {
            println!("{error}");
        }
        reading.push(start.elapsed());
        let start = Instant::now();
        decode_alone(dataset.file(index), &mut file, &mut scan.bytes);
        decoding.push(start.elapsed());
    }
    let start = Instant::now();
    inspect(root, &DatasetOptions::default(), None)?;
    println!(
        "{:30} {}: read {:.2} ms, the decoder alone {:.2} ms; inspect {:.0} ms",
        root.file_name().unwrap_or_default().to_string_lossy(),
        dataset.image_size(),
        median_ms(&mut reading),
        median_ms(&mut decoding),
        start.elapsed().as_secs_f64() * 1e3
    );
    Ok(())
}

/// Decodes the same file with the PNG decoder only.
fn decode_alone(path: &Path, file: &mut Vec<u8>, pixels: &mut [u8]) {
    use std::io::Read;
    file.clear();
    let loaded = std::fs::File::open(path).and_then(|mut f| f.read_to_end(file));
    let decoded = png::Decoder::new(std::io::Cursor::new(file.as_slice()))
        .read_info()
        .and_then(|mut r| r.next_frame(pixels));
    if loaded.is_err() || decoded.is_err() {
        println!("{} cannot be decoded", path.display());
    }
}

fn median_ms(times: &mut [Duration]) -> f64 {
    times.sort_unstable();
    times
        .get(times.len() / 2)
        .map_or(f64::NAN, |t| t.as_secs_f64() * 1e3)
}
