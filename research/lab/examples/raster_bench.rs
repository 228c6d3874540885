//! Time to make a raster on one thread: medians for an Oxford scan (the first in `GYRE_DATA`), or a
//! synthetic one of its size, at three raster sizes, with both samplings, with and without motion
//! compensation.
//!
//! `cargo run --release --manifest-path research/Cargo.toml -p gyre-lab --example raster_bench`

use std::{error::Error, path::Path, time::{Duration, Instant}};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{Twist, OwnedScan, ScanLimits, Sense, SweepGeometry};
use gyre_radar::{RasterConfig, Rasteriser, Sampling};
use ndarray::Array2;

const AZIMUTHS: usize = 400;
const BINS: usize = 3768;
const METADATA: usize = 11;
const FLOOR: u8 = 60;
const REPETITIONS: usize = 301;

fn main() -> Result<(), Box<dyn Error>> {
    let (scan, origin) = match oxford_scan()? {
        Some(scan) => (scan, "Oxford"),
        None => (synthetic_scan(), "synthetic (GYRE_DATA is not set)"),
    };
    println!(
        "one thread; scan: {origin}, {} x {}",
        scan.geometry.azimuths, scan.geometry.bins
    );
    println!(
        "{:>5} {:>7} {:>9} {:>10} {:>14}",
        "n", "cell m", "sampling", "plain ms", "compensated ms"
    );
    for (n, cell_m) in [(127, 0.8), (255, 0.8), (255, 0.4), (511, 0.4)] {
        for sampling in [Sampling::Averaged, Sampling::Bilinear] {
            let config = RasterConfig {
                n,
                cell_m,
                sampling,
                ..RasterConfig::default()
            };
            let twist = Twist {
                vx_mps: 9.5,
                vy_mps: 0.1,
                yaw_rate_radps: 0.3,
            };
            let plain = median_ms(&config, &scan, None)?;
            let compensated = median_ms(&config, &scan, Some(twist))?;
            let sampling = format!("{sampling:?}");
            println!("{n:>5} {cell_m:>7} {sampling:>9} {plain:>10.3} {compensated:>14.3}");
        }
    }
    Ok(())
}

fn median_ms(
    config: &RasterConfig,
    scan: &OwnedScan,
    twist: Option<Twist>,
) -> Result<f64, Box<dyn Error>> {
    let mut rasteriser = Rasteriser::new(config)?;
    let mut raster = Array2::zeros((config.n, config.n));
    let mut times = Vec::<Duration>::with_capacity(REPETITIONS);
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        rasteriser.rasterise(&scan.view(), FLOOR, twist, raster.view_mut())?;
        times.push(start.elapsed());
    }
    times.sort_unstable();
    Ok(times[REPETITIONS / 2].as_secs_f64() * 1e3)
}

/// Noise at the level of a real scan, with occasional walls.
fn synthetic_scan() -> OwnedScan {
    let stride = BINS + METADATA;
    let mut scan = OwnedScan::with_limits(ScanLimits {
        bytes: AZIMUTHS * stride,
        azimuths: AZIMUTHS,
    });
    scan.geometry = SweepGeometry {
        azimuths: AZIMUTHS,
        bins: BINS,
        stride,
        first_byte: METADATA,
        range_resolution_m: 0.0438,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        sense: Sense::Clockwise,
        stamp_ns: 0,
    };
    let mut state = 1u32;
    for (index, power) in scan.bytes.iter_mut().enumerate() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *power = 40 + (state >> 26) as u8 + if index % 911 < 20 { 100 } else { 0 };
    }
    for azimuth in 0..AZIMUTHS {
        scan.azimuth_rad[azimuth] = (14 * azimuth + 13) as f32 * std::f32::consts::TAU / 5600.0;
        scan.stamp_ns[azimuth] = 625_000 * (azimuth as i64 - AZIMUTHS as i64 / 2);
    }
    scan
}

fn oxford_scan() -> Result<Option<OwnedScan>, Box<dyn Error>> {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        return Ok(None);
    };
    let folder = Path::new(&data).join("oxford-2019-01-10-14-36-48");
    let mut dataset = gyre_datasets::open(&folder, &DatasetOptions::default())?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(0, scan.slot())?;
    Ok(Some(scan))
}
