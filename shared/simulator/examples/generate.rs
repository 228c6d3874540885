//! Generates a dataset: `cargo run --release -p gyre-simulator --example generate FOLDER [SCANS [SEED]]`.

use std::path::Path;

use gyre_simulator::{SimulationConfig, write_dataset};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = arguments.first().ok_or("usage: generate FOLDER [SCANS [SEED]]")?;
    let mut config = SimulationConfig::default();
    if let Some(scans) = arguments.get(1) {
        config.scans = scans.parse()?;
    }
    if let Some(seed) = arguments.get(2) {
        config.seed = seed.parse()?;
    }
    let started = std::time::Instant::now();
    let summary = write_dataset(&config, Path::new(folder), &mut |_, _| {})?;
    println!("{summary:?} in {:.1} s", started.elapsed().as_secs_f64());
    Ok(())
}
