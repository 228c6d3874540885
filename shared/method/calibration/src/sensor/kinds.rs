//! The kinds of sensors beside the radar: a row each, with the messages that only one kind has.

use std::ops::RangeInclusive;

use gyre_geometry::{samples::SampleKind, wrap_angle};

use super::search::{MAX_LATE_S, Peak};
use crate::Track;

/// A kind of sensor, as it is calibrated.
#[derive(Debug)]
pub struct Kind {
    pub sensor: SampleKind,
    /// The name with the verb, for messages.
    pub subject: &'static str,
    /// The radar's turn (rad) or distance (m) from a scan to the next.
    pub(super) step: fn(&Track, usize, usize) -> f64,
    /// Their name in the plural.
    pub(super) compared: &'static str,
    /// Axes that may be the measured one: the mounting of three is unknown.
    pub(super) axes: usize,
    /// Speeds have no bias: it stays zero.
    pub(super) has_bias: bool,
    /// Scales that it can have: beyond, if they exceed 1 by so many standard deviations, its unit
    /// is different.
    pub(super) scales: RangeInclusive<f64>,
    pub(super) unit_sigmas: f64,
    pub(super) least_scale_sigma: f64,
    pub(super) least_bias_sigma: f64,
    /// A scale that is less certain adds nothing to the default.
    pub(super) useful_scale_sigma: f64,
    /// An offset (s) or a scale that is known less well is refused.
    pub(super) max_delay_sigma_s: f64,
    pub(super) max_scale_sigma: f64,
    /// Why a drive leaves the offset uncertain.
    pub(super) steady: &'static str,
    /// Why the log, which begins so many seconds after the scans, has too little in common.
    pub(super) apart: fn(Option<f64>) -> String,
    pub(super) ambiguous: fn(&Peak, &Peak) -> String,
    /// The unit is wrong: the radar measures so many times as much.
    pub(super) wrong_unit: fn(f64) -> String,
}

pub static GYRO: Kind = Kind {
    sensor: SampleKind::Gyro,
    subject: "gyro is",
    step: |track, earlier, later| {
        let [from, to] = [earlier, later].map(|scan| track.poses[scan].rotation.angle());
        wrap_angle(to - from)
    },
    compared: "turns",
    axes: 3,
    has_bias: true,
    scales: 0.9..=1.1,
    unit_sigmas: 3.0,
    // An axis that leans by 2.5 degrees.
    least_scale_sigma: 1e-3,
    // A track turns spuriously if constants of the radar are wrong.
    least_bias_sigma: 1e-4,
    useful_scale_sigma: 0.01,
    // At 10 degrees per second it is half a degree.
    max_delay_sigma_s: 0.05,
    max_scale_sigma: 0.05,
    steady: "the drive turns too little",
    apart: |begins_s| match begins_s.filter(|begins_s| begins_s.abs() > MAX_LATE_S) {
        Some(begins_s) => format!(
            "it begins {begins_s:.0} s after the first scan; is it of a different drive, or its clock set otherwise? Then correct its stamps first"
        ),
        None => "the drive is too short, or most samples are missing".to_owned(),
    },
    ambiguous: |best, rival| {
        let [best, rival] = [best, rival].map(|it| {
            let (axis, correlation) = (it.up().name(), it.correlation.abs());
            format!(
                "about {axis} with delay_s = {:.2} (correlation {correlation:.2})",
                it.delay_s
            )
        });
        format!(
            "the gyro turns as the radar best {best}, but about as well {rival}: the drive is too straight or too short, its turns repeat, or the log is of a different drive"
        )
    },
    wrong_unit: |times| {
        let is_degree = (times / 1f64.to_radians() - 1.0).abs() < 0.1;
        let unit = match is_degree {
            true => "its rates are in deg/s, name the columns so, as gyro_z_degps",
            false => "its rates have another unit, or none of its axes points up",
        };
        format!("the radar turns {times:.4} times as much as the gyro measures: {unit}")
    },
};

pub static WHEELS: Kind = Kind {
    sensor: SampleKind::Wheels,
    subject: "wheels are",
    step: |track, _, later| track.motions[later].translation.x,
    compared: "distances",
    axes: 1,
    has_bias: false,
    scales: 0.8..=1.25,
    unit_sigmas: 0.0,
    // The radar's own, and tyres that warm.
    least_scale_sigma: 2e-3,
    least_bias_sigma: 0.0,
    useful_scale_sigma: f64::INFINITY,
    // While braking at 5 m/s² it is half a m/s.
    max_delay_sigma_s: 0.1,
    max_scale_sigma: f64::INFINITY,
    steady: "the speed changes too little",
    apart: |_| "the drive is too short, or the log is of another one".to_owned(),
    ambiguous: |best, rival| {
        format!(
            "the wheels drive as the radar best with delay_s = {:.2} (correlation {:.2}), but about as well with {:.2} ({:.2}): the speed changes too little, or the log is of a different drive",
            best.delay_s, best.correlation, rival.delay_s, rival.correlation
        )
    },
    wrong_unit: |times| {
        format!(
            "the radar drives {times:.3} times as far as the wheels measure: their speeds have another unit (0.278 is km/h, 0.447 mph)"
        )
    },
};
