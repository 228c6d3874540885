//! Synthetic scans: exact measurements of Gaussian scatterers by a moving sensor.

use std::f64::consts::TAU;

use gyre_geometry::{
    Twist,
    scan::{OwnedScan, Sense, SweepGeometry, flag},
};
use nalgebra::Point2;
use ndarray::Array2;

use crate::raster::{RasterConfig, Rasteriser};

/// Bytes before each row, so that rows do not start at byte 0.
const METADATA: usize = 11;
pub const STAMP_NS: i64 = 1_547_131_046_353_776_000;

#[derive(Clone, Debug)]
pub struct Sensor {
    pub azimuth_rad: Vec<f32>,
    /// Times relative to the scan's stamp, s.
    pub time_s: Vec<f64>,
    pub bins: usize,
    pub range_resolution_m: f32,
    pub range_offset_m: f32,
    pub doppler_s: f32,
    pub chirps_alternate: bool,
    pub sense: Sense,
    pub twist: Twist,
}

impl Sensor {
    /// 400 uniform azimuths in 0.25 s, the first one encoder step past straight ahead, 160 m.
    pub fn navtech() -> Self {
        let count = 400;
        Self {
            azimuth_rad: (0..count)
                .map(|i| ((14 * i + 13) as f64 / 5600.0 * TAU) as f32)
                .collect(),
            time_s: (0..count)
                .map(|i| 0.25 * ((f64::from(i) + 0.5) / f64::from(count) - 0.5))
                .collect(),
            bins: 3650,
            range_resolution_m: 0.0438,
            range_offset_m: 0.0,
            doppler_s: 0.0,
            chirps_alternate: false,
            sense: Sense::Clockwise,
            twist: Twist::default(),
        }
    }

    pub fn scan(&self) -> OwnedScan {
        let azimuths = self.azimuth_rad.len();
        let stride = METADATA + self.bins;
        let mut scan = OwnedScan::of(SweepGeometry {
            azimuths,
            bins: self.bins,
            stride,
            first_byte: METADATA,
            range_resolution_m: self.range_resolution_m,
            range_offset_m: self.range_offset_m,
            doppler_s: self.doppler_s,
            sense: self.sense,
            stamp_ns: STAMP_NS,
        });
        scan.azimuth_rad.copy_from_slice(&self.azimuth_rad);
        let stamp_ns = |time_s: &f64| STAMP_NS + (time_s * 1e9).round() as i64;
        scan.stamp_ns = self.time_s.iter().map(stamp_ns).collect();
        for (azimuth, flags) in scan.flags.iter_mut().enumerate() {
            *flags |= self.chirp(azimuth);
        }
        scan
    }

    /// The scan of Gaussians of height 200 and the given sigma around points in the frame at the
    /// scan's stamp.
    pub fn measure(&self, scatterers: &[Point2<f64>], sigma_m: f64) -> OwnedScan {
        let mut scan = self.scan();
        let resolution_m = f64::from(self.range_resolution_m);
        let first_centre_m = 0.5 * resolution_m + f64::from(self.range_offset_m);
        let rows = scan.bytes.chunks_exact_mut(METADATA + self.bins);
        for (azimuth, row) in rows.enumerate() {
            row[..METADATA].fill(255);
            let sensor_from_stamp = self.twist.pose_at(self.time_s[azimuth]).inverse();
            let direction = self.direction(azimuth);
            let velocity = nalgebra::Vector2::new(self.twist.vx_mps, self.twist.vy_mps);
            let is_falling = self.chirp(azimuth) == flag::CHIRP_KNOWN;
            let sign = if is_falling { -1.0 } else { 1.0 };
            let shift_m = sign * f64::from(self.doppler_s) * direction.dot(&velocity);
            for scatterer in scatterers {
                let scatterer = sensor_from_stamp * scatterer;
                for (bin, power) in row[METADATA..].iter_mut().enumerate() {
                    let range_m = first_centre_m + bin as f64 * resolution_m + shift_m;
                    let distance_sq = (scatterer.coords - direction * range_m).norm_squared();
                    let power_here = 200.0 * (-0.5 * distance_sq / (sigma_m * sigma_m)).exp();
                    *power = power.saturating_add(power_here.round() as u8);
                }
            }
        }
        scan
    }

    fn chirp(&self, azimuth: usize) -> u8 {
        match (self.chirps_alternate, azimuth % 2) {
            (false, _) => 0,
            (true, 0) => flag::CHIRP_KNOWN | flag::CHIRP_UP,
            (true, _) => flag::CHIRP_KNOWN,
        }
    }

    /// The unit vector of an azimuth, x forward and y left.
    fn direction(&self, azimuth: usize) -> nalgebra::Vector2<f64> {
        let angle = f64::from(self.azimuth_rad[azimuth]);
        match self.sense {
            Sense::Clockwise => nalgebra::Vector2::new(angle.cos(), -angle.sin()),
            Sense::CounterClockwise => nalgebra::Vector2::new(angle.cos(), angle.sin()),
        }
    }
}

pub fn raster(config: &RasterConfig, scan: &OwnedScan, twist: Option<Twist>) -> Vec<f32> {
    let mut raster = Array2::from_elem((config.n, config.n), f32::NAN);
    let mut rasteriser = Rasteriser::new(config).unwrap();
    rasteriser
        .rasterise(&scan.view(), 0, twist, raster.view_mut())
        .unwrap();
    raster.into_raw_vec_and_offset().0
}

pub fn centre_m(config: &RasterConfig, row: usize, column: usize) -> Point2<f64> {
    let middle = 0.5 * (config.n as f64 - 1.0);
    let cell_m = f64::from(config.cell_m);
    Point2::new(
        (middle - row as f64) * cell_m,
        (middle - column as f64) * cell_m,
    )
}

/// Distance of the centroid of the raster within `reach_m` of `expected` from it, cells. Infinite
/// if the raster is zero there.
pub fn miss_cells(
    config: &RasterConfig,
    raster: &[f32],
    expected: &Point2<f64>,
    reach_m: f64,
) -> f64 {
    let (mut sum, mut moment) = (0.0, nalgebra::Vector2::zeros());
    for (cell, &power) in raster.iter().enumerate() {
        let offset = centre_m(config, cell / config.n, cell % config.n) - expected;
        if offset.norm() <= reach_m {
            sum += f64::from(power);
            moment += offset * f64::from(power);
        }
    }
    if sum < 200.0 {
        return f64::INFINITY;
    }
    (moment / sum).norm() / f64::from(config.cell_m)
}
