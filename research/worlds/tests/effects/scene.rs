//! Small scenes and the powers measured in them.

use std::f64::consts::TAU;

use gyre_geometry::{Twist, OwnedScan, ScanLimits};
use gyre_worlds::{body::{NO_BODY, Scatterer}, profile::{Profile, Receiver, Sampling}, weather::WeatherConfig, Body, Effects, Movers, Path, Relief, Scene, Sensor, SensorConfig, SweepTime, World};
use nalgebra::Point2;

/// A scene and a radar. Default: Oxford's radar at rest, without effects.
pub struct Setup<'a> {
    pub body: Body,
    pub movers: &'a dyn Movers,
    pub path: &'a dyn Path,
    pub weather: WeatherConfig,
    pub sensor: SensorConfig,
    pub effects: Effects,
    pub relief: Relief,
}

const AT_REST: Twist = Twist {
    vx_mps: 0.0,
    vy_mps: 0.0,
    yaw_rate_radps: 0.0,
};

impl Default for Setup<'_> {
    fn default() -> Self {
        Self {
            body: Body::default(),
            movers: &(),
            path: &AT_REST,
            weather: WeatherConfig::default(),
            sensor: SensorConfig::default(),
            effects: Effects::NONE,
            relief: Relief::LEVEL,
        }
    }
}

impl Setup<'_> {
    pub fn of(scatterers: Vec<Scatterer>, effects: Effects) -> Self {
        Self {
            body: Body::of(scatterers),
            effects,
            ..Self::default()
        }
    }

    pub fn with(mut self, profile: Profile) -> Self {
        self.sensor.profile = profile;
        self
    }

    pub fn sampling(&self) -> Sampling {
        self.sensor.sampling()
    }

    pub fn receiver(&self) -> Receiver {
        self.sensor.profile.receiver()
    }

    /// Measures the first scan, whose middle is the path's time zero.
    pub fn scan(&self) -> OwnedScan {
        self.scans(1).remove(0)
    }

    pub fn scans(&self, count: u64) -> Vec<OwnedScan> {
        let Sampling {
            azimuths,
            period_us,
            ..
        } = self.sampling();
        let world = World::new(self.body.clone()).on(self.relief);
        let mut sensor = Sensor::new(&self.sensor, &self.effects, 7);
        let mut scan = |index: u64| {
            let epoch_us = 1_500_000_000_000_000;
            let mut time = SweepTime {
                start_us: epoch_us,
                period_us,
                azimuths,
                epoch_us,
            };
            time.epoch_us = time.middle_us();
            time.start_us += period_us * index as i64;
            let scene = Scene {
                world: &world,
                movers: self.movers,
                path: self.path,
                weather: self.weather,
            };
            let bytes = azimuths * self.sampling().stride();
            let mut scan = OwnedScan::with_limits(ScanLimits { bytes, azimuths });
            scan.geometry = sensor.sweep(scene, time, index, &mut scan.slot());
            scan
        };
        (0..count).map(&mut scan).collect()
    }

    /// The bins of a range interval, metres.
    pub fn bins(&self, range_m: std::ops::Range<f64>) -> std::ops::Range<usize> {
        let bin = |range_m: f64| self.sampling().bin(range_m).round().max(0.0) as usize;
        bin(range_m.start)..bin(range_m.end)
    }

    /// Received power of a scatterer with a cross-section at a range, dB.
    pub fn received_db(&self, cross_section_m2: f64, range_m: f64) -> f64 {
        db(cross_section_m2 * self.receiver().sensitivity(range_m))
    }
}

/// A scatterer at a range, at the centre of an azimuth of Oxford's radar (with fractions).
pub fn post(range_m: f64, azimuth: f64, cross_section_m2: f64) -> Scatterer {
    let angle = Profile::Cts350xOxford.sampling().azimuth_rad(0) + azimuth * TAU / 400.0;
    let position = Point2::new(range_m * angle.cos(), -range_m * angle.sin());
    Scatterer::all_round(position, cross_section_m2, NO_BODY)
}

/// Returns this effect alone, or none.
pub fn only(switch: fn(&mut Effects) -> &mut bool, on: bool) -> Effects {
    changed(Effects::NONE, switch, on)
}

/// Returns effects with this one on or off.
pub fn changed(mut of: Effects, switch: fn(&mut Effects) -> &mut bool, on: bool) -> Effects {
    *switch(&mut of) = on;
    of
}

/// Returns whether nothing is received.
pub fn is_dark(scan: &OwnedScan) -> bool {
    powers(scan).into_iter().flatten().all(|count| *count == 0)
}

pub fn db(power: f64) -> f64 {
    10.0 * power.log10()
}

/// Power of a byte: counts of half a decibel, rounded down from 0.4 above.
pub fn power(count: u8) -> f64 {
    10f64.powf((f64::from(count) + 0.1) / 20.0)
}

/// Mean power of bins in azimuths, dB.
pub fn mean_db(
    scans: &[OwnedScan],
    azimuths: impl IntoIterator<Item = usize> + Clone,
    bins: std::ops::Range<usize>,
) -> f64 {
    let rows = scans.iter().flat_map(|scan| {
        azimuths
            .clone()
            .into_iter()
            .map(move |azimuth| scan.view().row(azimuth))
    });
    let powers: Vec<f64> = rows
        .flat_map(|row| row[bins.clone()].iter().map(|count| power(*count)))
        .collect();
    db(powers.iter().sum::<f64>() / powers.len() as f64)
}

/// Maximum power of bins in an azimuth, dB.
pub fn peak_db(scan: &OwnedScan, azimuth: usize, bins: std::ops::Range<usize>) -> f64 {
    db(power(
        scan.view().row(azimuth)[bins]
            .iter()
            .copied()
            .max()
            .unwrap(),
    ))
}

/// The bin of the maximum power in an azimuth: the middle of its plateau.
pub fn peak_bin(scan: &OwnedScan, azimuth: usize) -> f64 {
    let row = scan.view().row(azimuth);
    let top = row.iter().copied().max().unwrap();
    let bins: Vec<usize> = (0..row.len()).filter(|bin| row[*bin] == top).collect();
    bins.iter().sum::<usize>() as f64 / bins.len() as f64
}

/// The powers without metadata, azimuth by azimuth.
pub fn powers(scan: &OwnedScan) -> Vec<&[u8]> {
    let view = scan.view();
    (0..view.geometry.azimuths)
        .map(|azimuth| view.row(azimuth))
        .collect()
}
