//! Times the rendering of scans:
//! `cargo run --release -p gyre-worlds --example render -- [CONFIG [SCANS]]`.
//!
//! CONFIG has the keys of the section `[simulation]` at its top level.

use std::time::Instant;

use gyre_geometry::OwnedScan;
use gyre_worlds::{SimulationConfig, Simulator};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let config: SimulationConfig = match arguments.first() {
        Some(path) => toml::from_str(&std::fs::read_to_string(path)?)?,
        None => SimulationConfig::default(),
    };
    let scans = arguments.get(1).map_or(Ok(20), |scans| scans.parse())?;
    let began = Instant::now();
    let simulator = Simulator::new(&config)?;
    println!(
        "{} scatterers in {:.2} s",
        simulator.world().scatterers().len(),
        began.elapsed().as_secs_f64()
    );
    let (mut sensor, mut scan) = (
        simulator.sensor(),
        OwnedScan::with_limits(simulator.limits()),
    );
    let mut times_ms: Vec<f64> = Vec::new();
    for index in 0..scans {
        let began = Instant::now();
        scan.geometry = simulator.render_into(index, &mut sensor, &mut scan.slot());
        times_ms.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    println!(
        "{scans} scans: median {:.1} ms, worst {:.1} ms",
        times_ms[scans / 2],
        times_ms[scans - 1]
    );
    Ok(())
}
