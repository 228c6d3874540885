//! Scans as Navtech's messages.

use std::f64::consts::TAU;

use gyre_colossus::{ClockFormat, Configuration};
use gyre_geometry::{PolarScan, scan::flag};

use crate::{
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    sensor_msgs::Image,
    std_msgs::Header,
};

/// Angles nearer to a count than this are that count, rad: several roundings of an angle in 32
/// bits.
const ROUNDING_RAD: f64 = 2e-6;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoder {
    pub counts: u16,
    /// True if the angles of the scan are such counts, but for rounding.
    pub is_exact: bool,
}

impl Encoder {
    /// Returns the encoder of the angles of a scan: `known`, or the one that is found; the finest
    /// possible for angles that are of none. An encoder that matches all angles to the bit has
    /// priority.
    pub fn of(azimuth_rad: &[f32], known: Option<u16>) -> Self {
        let rows = u16::try_from(azimuth_rad.len()).unwrap_or(u16::MAX);
        let [twice, four_times] = [2, 4].map(|times| rows.checked_mul(times));
        let candidates = [known, Some(rows), twice, four_times, Some(5600), Some(5595)];
        let all = |is: fn(f32, u16) -> bool| {
            let mut candidates = candidates.into_iter().flatten();
            let is_it = |counts: &u16| azimuth_rad.iter().all(|rad| is(*rad, *counts));
            candidates.find(|counts| *counts >= 16 && is_it(counts))
        };
        let found = all(is_count).or_else(|| all(is_near_count));
        Self {
            counts: found.unwrap_or(u16::MAX),
            is_exact: found.is_some(),
        }
    }
}

fn count(azimuth_rad: f32, counts: u16) -> u16 {
    let turns = f64::from(azimuth_rad) / TAU;
    let count = (turns * f64::from(counts)).round();
    count.rem_euclid(counts.into()) as u16
}

fn angle(count: u16, counts: u16) -> f64 {
    f64::from(count) * (TAU / f64::from(counts))
}

/// Returns whether an angle belongs to a count, as readers compute it.
fn is_count(azimuth_rad: f32, counts: u16) -> bool {
    angle(count(azimuth_rad, counts), counts) as f32 == azimuth_rad
}

fn is_near_count(azimuth_rad: f32, counts: u16) -> bool {
    let apart = f64::from(azimuth_rad) - angle(count(azimuth_rad, counts), counts);
    apart.abs() < ROUNDING_RAD || (TAU - apart.abs()).abs() < ROUNDING_RAD
}

#[derive(Clone, Debug)]
pub struct ScanMessages {
    radar: Configuration,
    frame_id: String,
    sweep_counter: u16,
}

impl ScanMessages {
    /// Writes scans of a radar, which is in the frame `frame_id`.
    pub fn new(radar: Configuration, frame_id: &str) -> Self {
        Self {
            radar,
            frame_id: frame_id.to_owned(),
            sweep_counter: 0,
        }
    }

    pub fn configuration(&self, stamp_ns: i64) -> RadarConfigurationMsg {
        RadarConfigurationMsg::of(&self.radar, self.header(stamp_ns))
    }

    /// Returns a message for each azimuth that was measured, stamped with its time.
    pub fn azimuths<'a>(
        &'a mut self,
        scan: PolarScan<'a>,
    ) -> impl Iterator<Item = RadarFftDataMsg> + 'a {
        (0..scan.geometry.azimuths).filter_map(move |row| {
            self.sweep_counter = self.sweep_counter.wrapping_add(1);
            let is_measured = scan.flags[row] & flag::MEASURED != 0;
            is_measured.then(|| self.azimuth(&scan, row))
        })
    }

    fn azimuth(&self, scan: &PolarScan<'_>, row: usize) -> RadarFftDataMsg {
        let (azimuth_rad, stamp_ns) = (scan.azimuth_rad[row], scan.stamp_ns[row]);
        let (seconds, split_seconds) = ClockFormat::default().fields(stamp_ns);
        let data = scan.row(row).to_vec();
        RadarFftDataMsg {
            header: self.header(stamp_ns),
            angle: f64::from(azimuth_rad).to_degrees(),
            azimuth: count(azimuth_rad, self.radar.encoder_size),
            sweep_counter: self.sweep_counter,
            ntp_seconds: u32::from_le_bytes(seconds),
            ntp_split_seconds: u32::from_le_bytes(split_seconds),
            data_length: u16::try_from(data.len()).unwrap_or(u16::MAX),
            data,
        }
    }

    /// Returns the message of a whole turn, stamped with the time of the scan. Rows that were not
    /// measured have powers, but no encoder value and no time, as the driver leaves those that it
    /// has not received.
    pub fn b_scan(&self, scan: PolarScan<'_>) -> RadarBScanMsg {
        let (azimuths, bins) = (scan.geometry.azimuths, scan.geometry.bins);
        let mut message = RadarBScanMsg {
            b_scan_img: Image {
                header: self.header(scan.geometry.stamp_ns),
                height: azimuths as u32,
                width: bins as u32,
                encoding: "8UC1".to_owned(),
                is_bigendian: 0,
                step: bins as u32,
                data: vec![0; azimuths * bins],
            },
            encoder_values: vec![0; azimuths],
            timestamps: vec![0; azimuths],
        };
        for row in 0..azimuths {
            message.b_scan_img.data[row * bins..][..bins].copy_from_slice(scan.row(row));
            if scan.flags[row] & flag::MEASURED == 0 {
                continue;
            }
            message.encoder_values[row] = count(scan.azimuth_rad[row], self.radar.encoder_size);
            message.timestamps[row] = scan.stamp_ns[row].max(0) as u64;
        }
        message
    }

    fn header(&self, stamp_ns: i64) -> Header {
        Header::new(stamp_ns, &self.frame_id)
    }
}
