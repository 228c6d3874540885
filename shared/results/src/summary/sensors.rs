//! The use of gyro, wheels and GNSS in a run, and errors of their settings.

use std::collections::VecDeque;

use gyre_calibration::{Compared, delay};
use gyre_configuration::Configuration;
use gyre_contract::{PoseHeader, flag, initial_guess, outcome};

use super::{Counts, GnssSummary};

/// Largest shares of turns that are doubted or refused, and of distances of slipping wheels, in a
/// run that succeeds. Fewer contradictions are chance.
const MAX_DOUBTED_SHARE: f64 = 0.1;
const MAX_SLIPPING_SHARE: f64 = 0.5;
const MIN_CONTRADICTIONS: u64 = 10;
/// A delay of more than so many standard deviations is one.
const DELAY_SIGMAS: f64 = 4.0;
/// The delay is measured over so many motions: an hour.
const MOTIONS_OF_DELAY: usize = 1 << 14;

/// The motions by the radar alone and by a sensor, to measure the delay between them.
#[derive(Debug, Default)]
pub struct Clock(VecDeque<Compared>);

impl Clock {
    pub fn add(&mut self, pose: &PoseHeader, by_radar: f64, by_sensor: Option<f64>) {
        if self.0.is_empty() && by_sensor.is_none() {
            return;
        }
        if self.0.len() == MOTIONS_OF_DELAY {
            self.0.pop_front();
        }
        let of = &pose.motion.refinement;
        let is_seen = of.outcome == outcome::REFINED
            && of.initial_guess != initial_guess::ALONG_WALLS
            && !pose.item.is(flag::BREAK);
        self.0.push_back(Compared {
            stamp_ns: pose.item.stamp_ns,
            interval_ns: pose.motion.interval_ns,
            radar: is_seen.then_some(by_radar),
            other: by_sensor,
        });
    }

    /// Returns the delay and its standard deviation, s; `None` where it is not determined.
    pub fn delay_s(mut self, has_bias: bool) -> Option<[f64; 2]> {
        let delay = delay(self.0.make_contiguous(), has_bias)?;
        Some([delay.value, delay.sigma])
    }
}

/// Returns why a run has not used its sensors, or why their settings must be wrong.
pub fn problem(
    configuration: &Configuration,
    counts: &Counts,
    gnss: Option<&GnssSummary>,
) -> Option<String> {
    let config = &configuration.odometry;
    // Without a refinement it is not known what gyro and wheels were used for.
    let motions = counts.processed.saturating_sub(1 + counts.breaks);
    let motions = counts.motions.map_or(0, |_| motions);
    let unused = [
        ("gyro", config.gyro.is_used() && counts.gyro.is_none()),
        ("wheels", config.wheels.is_used() && counts.wheels.is_none()),
    ];
    if let Some((section, _)) = unused.iter().find(|it| it.1 && motions > 0) {
        return Some(format!(
            "{section}.kind is set, but none of the {motions} motions has a measurement of it: no samples arrived, or they are farther apart than {section}.max_gap_s. `gyre inspect` shows the log of a recording, and {section}.kind=none leaves it out"
        ));
    }
    let by_gyro = counts.gyro.and_then(|it| {
        let doubts = it.doubted + it.refused;
        let is_wrong = too_many(doubts, it.motions, MAX_DOUBTED_SHARE)
            || !config.gyro.allows_scale(it.scale);
        let cause = cause("gyro", config.gyro.delay_s, it.delay_s, is_wrong)?;
        Some(format!(
            "the gyro contradicts the radar: {doubts} of its {} turns were doubted or refused; {cause}, and gyro.kind=none leaves it out",
            it.motions
        ))
    });
    let by_wheels = || {
        let it = counts.wheels?;
        let is_wrong = too_many(it.slips, it.motions, MAX_SLIPPING_SHARE);
        let cause = cause("wheels", config.wheels.delay_s, it.delay_s, is_wrong)?;
        Some(format!(
            "the wheels contradict the radar: {} of their {} distances are not those that it sees; {cause}, and wheels.kind=none leaves them out",
            it.slips, it.motions
        ))
    };
    let by_gnss = || {
        let (reason, _) = gnss?.refusal().filter(|it| it.1)?;
        Some(format!("the fixes of GNSS are not used: {reason}"))
    };
    by_gyro.or_else(by_wheels).or_else(by_gnss)
}

/// Returns which key of a section is wrong: by a delay, if that is certain.
fn cause(section: &str, set_s: f64, measured: Option<[f64; 2]>, is_wrong: bool) -> Option<String> {
    let up = if section == "gyro" { "`gyro.up`, " } else { "" };
    match measured {
        Some([delay_s, sigma_s]) if delay_s.abs() > DELAY_SIGMAS * sigma_s => Some(format!(
            "the stamps are late by {delay_s:.2} \u{b1} {sigma_s:.2} s: set {section}.delay_s={:.2}, which `gyre calibrate` finds too",
            set_s + delay_s
        )),
        _ => is_wrong.then(|| {
            format!(
                "{up}`{section}.delay_s`, `{section}.scale` or the unit of the log is wrong: `gyre calibrate` finds them from a recording"
            )
        }),
    }
}

pub fn too_many(contradictions: u64, motions: u64, max_share: f64) -> bool {
    contradictions >= MIN_CONTRADICTIONS && contradictions as f64 > max_share * motions as f64
}
