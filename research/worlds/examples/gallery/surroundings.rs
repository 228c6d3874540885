//! Weather, traffic, and the receiving host.

use std::sync::Arc;

use gyre_datasets::ImageSource;
use gyre_worlds::output::OutputConfig;
use gyre_worlds::profile::Profile;
use gyre_worlds::weather::WeatherConfig;
use gyre_worlds::{
    Body, HostStamps, OutputFormat, SimulatedDrive, SimulationConfig, SimulatorError,
};

use crate::exhibit::Exhibit;
use crate::picture::{BLACK, Frame, Picture};
use crate::scenes;
use crate::shot::Shot;

pub fn exhibits() -> Result<Vec<Exhibit>, SimulatorError> {
    Ok(vec![
        rain(),
        fog(),
        snow(),
        traffic(),
        host_stamps()?,
        lost_azimuths()?,
    ])
}

fn weather(title: &'static str, weather: WeatherConfig, shot: Shot, frame: &Frame) -> Exhibit {
    Exhibit::switched(title, &Shot { weather, ..shot }, frame, |e| &mut e.weather)
}

fn rain() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(12.0, 90.0, 10.0));
    let heavy = WeatherConfig {
        rain_mm_h: 25.0,
        ..WeatherConfig::default()
    };
    weather("Rain", heavy, shot, &Frame::map(95.0).shades(12.0, 70.0))
}

fn fog() -> Exhibit {
    let mut rings = Body::default();
    for range_m in [60.0f64, 100.0, 140.0, 180.0, 220.0, 260.0, 295.0] {
        // Compensates the dependence on range, including the receiver's filter.
        let loss = range_m.powi(2) * (range_m.powi(2) + 60f64.powi(2)) / 300f64.powi(4);
        rings.extend(scenes::ring(range_m, 300, 80.0 * loss));
    }
    let shot = Shot::drawn(rings).with(Profile::Ras6);
    let thick = WeatherConfig {
        fog_g_m3: 3.0,
        ..WeatherConfig::default()
    };
    weather(
        "Fog",
        thick,
        shot,
        &Frame::polar(0.0..100.0, 50.0..300.0).shades(30.0, 70.0),
    )
}

fn snow() -> Exhibit {
    let shot = Shot::drawn(scenes::lattice(8.0, 40.0, 1.0));
    let heavy = WeatherConfig {
        snow_mm_h: 8.0,
        ..WeatherConfig::default()
    };
    weather("Snow", heavy, shot, &Frame::map(42.0).shades(BLACK, 40.0))
}

fn traffic() -> Exhibit {
    let mut shot = Shot::drawn(scenes::lattice(8.0, 24.0, 2.0));
    shot.movers = Arc::new(scenes::Passing::new(12.0));
    let frame = Frame::map(26.0);
    let mut picture = |index| {
        shot.index = index;
        frame.picture(&[shot.scan()])
    };
    Exhibit::of(
        "Traffic",
        vec![("one scan", picture(0)), ("1 s later", picture(4))],
    )
}

/// Delay of each scan at the host relative to the first, seconds.
fn delays_s(host_stamps: HostStamps) -> Result<Vec<f64>, SimulatorError> {
    let output = OutputConfig {
        format: Some(OutputFormat::Radiate),
        host_stamps,
    };
    let mut config = SimulationConfig {
        scans: Some(240),
        output,
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    let drive = SimulatedDrive::new(&config)?;
    let received_s: Vec<f64> = drive
        .renderer()
        .stamps()
        .unwrap_or_default()
        .lines()
        .filter_map(received)
        .collect();
    let period_s = drive.simulator().sampling().period_us as f64 * 1e-6;
    Ok(received_s
        .iter()
        .enumerate()
        .map(|(i, at)| at - received_s[0] - i as f64 * period_s)
        .collect())
}

/// `Frame: 000001 Time: 1547132400.250000000`, the nanoseconds without leading zeros.
fn received(line: &str) -> Option<f64> {
    let (seconds, nanoseconds) = line.rsplit(' ').next()?.split_once('.')?;
    Some(seconds.parse::<f64>().ok()? + nanoseconds.parse::<f64>().ok()? * 1e-9)
}

fn host_stamps() -> Result<Exhibit, SimulatorError> {
    let plot = |delays_s: Vec<f64>| {
        const SECONDS_HIGH: f64 = 1.5;
        Picture::of((240, 80), |column, row| {
            let height = (79 - row) as f64 / 80.0 * SECONDS_HIGH;
            let bar = delays_s
                .get(column)
                .is_some_and(|delay| height <= *delay + 0.02);
            if bar {
                1.0
            } else if row % 26 == 0 {
                0.2
            } else {
                0.0
            }
        })
    };
    let pictures = vec![
        ("even", plot(delays_s(HostStamps::Even)?)),
        ("stalling", plot(delays_s(HostStamps::Stalling)?)),
    ];
    Ok(Exhibit::of("Host stamps", pictures))
}

/// The last azimuths of an image, down, by range.
fn lost_azimuths() -> Result<Exhibit, SimulatorError> {
    const AZIMUTHS: usize = 24;
    const BINS: usize = 200;
    let drive = |lost_azimuths| {
        let mut config = SimulationConfig {
            scans: Some(60),
            ..SimulationConfig::default()
        };
        config.output.format = Some(OutputFormat::Radiate);
        config.sensor.profile = Profile::Cts350xRadiate;
        config.effects.lost_azimuths = Some(lost_azimuths);
        SimulatedDrive::new(&config)
    };
    let losing = drive(true)?;
    let scan = (1..losing.scans()).max_by_key(|scan| losing.lost_azimuths(*scan).len());
    let scan = scan.unwrap_or_default();
    let lost = losing.lost_azimuths(scan).len();
    let picture = |drive: &SimulatedDrive, stale: usize| {
        let size = drive.image_size();
        let mut pixels = vec![0; size.width * size.height];
        drive.renderer().draw(scan, &mut pixels);
        let grey = |column: usize, row: usize| {
            let azimuth = size.width - AZIMUTHS + row / 4;
            f64::from(pixels[column * size.width + azimuth]) / 120.0
        };
        Picture::of((BINS, 4 * AZIMUTHS), grey).with_margin(|row| row / 4 < AZIMUTHS - stale)
    };
    let pictures = vec![
        ("off", picture(&drive(false)?, 0)),
        ("on", picture(&losing, lost)),
    ];
    Ok(Exhibit::of("Lost azimuths", pictures))
}
