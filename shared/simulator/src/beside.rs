//! The sensors beside the radar. A kind is a row of [`KINDS`] and its own mathematics; samples,
//! stamps, losses and logs are made in the same way for all kinds.

pub mod gnss;
pub mod gyro;
pub mod heading;
#[cfg(test)]
mod tests;
pub mod wheels;

use std::fmt::Write as _;

use gyre_geometry::samples::{Sample, SampleKind};
use nalgebra::SVector;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

pub use crate::stream::Episodes;

/// Time between two stamps while a host catches up, ns.
const CATCH_UP_NS: i64 = 100_000;

pub struct Kind {
    pub of: SampleKind,
    /// The log beside the scans, and its first row.
    pub file: &'static str,
    pub header: &'static str,
    /// The value of a sample in each column after the stamp.
    columns: &'static [usize],
    /// The words for its absence from a simulation.
    pub lacks: &'static str,
}

pub const KINDS: [Kind; 4] = [
    Kind {
        of: SampleKind::Gyro,
        file: "imu.csv",
        // As in the log of RADIATE.
        header: "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2",
        columns: &[0, 1, 2, 3, 4, 5],
        lacks: "no gyro: give it one",
    },
    Kind {
        of: SampleKind::Wheels,
        file: "wheels.csv",
        header: "stamp_ns,speed_m_s",
        columns: &[0],
        lacks: "no wheels that measure: give them a rate",
    },
    Kind {
        of: SampleKind::Gnss,
        file: "gnss.csv",
        header: "stamp_ns,latitude_deg,longitude_deg,sigma_m",
        columns: &[0, 1, 3],
        lacks: "no receiver: give it a rate",
    },
    Kind {
        of: SampleKind::Heading,
        file: "heading.csv",
        header: "stamp_ns,yaw_rad",
        columns: &[0],
        lacks: "no headings: give them a rate",
    },
];

/// The stamp of a sample, ns since 1970, and its values as [`SampleKind`] names them.
pub type Record = (i64, [f64; 6]);

/// The samples of a kind, by the records of its row.
pub fn samples(
    kind: SampleKind,
    records: impl FnOnce(&Kind) -> Option<Vec<Record>>,
) -> Option<Vec<Sample>> {
    let row = Kind::of(kind)?;
    let sample = |(stamp_ns, values)| Sample::of(kind, stamp_ns, values);
    Some(records(row)?.into_iter().map(sample).collect())
}

impl Kind {
    pub fn of(kind: SampleKind) -> Option<&'static Self> {
        KINDS.iter().find(|row| row.of == kind)
    }

    pub fn csv(&self, records: &[Record]) -> String {
        let mut text = format!("{}\n", self.header);
        for (stamp_ns, values) in records {
            let _ = write!(text, "{stamp_ns}");
            for column in self.columns {
                let _ = write!(text, ",{}", values[*column]);
            }
            text.push('\n');
        }
        text
    }
}

/// The time on the clock of a host at a time of the drive, s.
pub type Clock<'a> = Box<dyn Fn(&mut ChaCha8Rng, f64) -> f64 + 'a>;
/// Measures from one time of the drive to another, s, in an episode or not; `None` if there is
/// nothing to measure.
pub type Measure<'a> = Box<dyn FnMut(&mut ChaCha8Rng, [f64; 2], bool) -> Option<[f64; 6]> + 'a>;

/// A sensor during a drive, with its host. Each sample takes as many random numbers.
pub struct Device<'a> {
    pub rate_hz: f64,
    /// The part of the period of a sample that is over at its stamp.
    pub stamped_at: f64,
    pub errors: ChaCha8Rng,
    /// The random numbers of the host. `None`: the host draws from `errors`.
    pub host: Option<ChaCha8Rng>,
    pub clock: Clock<'a>,
    /// Share of the samples that the host loses. `None`: the host never draws.
    pub lost: Option<f64>,
    pub episodes: Episodes,
    /// True if the host stalls in an episode, so that samples are stamped at its end.
    pub stalls: bool,
    pub measure: Measure<'a>,
}

impl Device<'_> {
    pub fn records(mut self, (start_ns, end_s): (i64, f64)) -> Vec<Record> {
        let mut last_ns = i64::MIN + CATCH_UP_NS;
        let sample = |index: usize| {
            let span_s = [index, index + 1].map(|index| index as f64 / self.rate_hz);
            let stamped_s = (1.0 - self.stamped_at) * span_s[0] + self.stamped_at * span_s[1];
            let at_s = if self.stalls { stamped_s } else { span_s[0] };
            let episode_s = self.episodes.begin_s(at_s);
            let values = (self.measure)(&mut self.errors, span_s, episode_s.is_some());
            let stall_s = episode_s.filter(|_| self.stalls);
            let handled_s = stall_s.map_or(stamped_s, |begin_s| begin_s + self.episodes.lasts_s);
            let host = self.host.as_mut().unwrap_or(&mut self.errors);
            let stamp_ns = ((self.clock)(host, handled_s) * 1e9).round() as i64;
            let is_lost = self.lost.is_some_and(|lost| host.random::<f64>() < lost);
            let values = values.filter(|_| !is_lost)?;
            last_ns = stamp_ns.max(last_ns + CATCH_UP_NS);
            Some((start_ns + last_ns, values))
        };
        let count = (end_s * self.rate_hz).ceil() as usize;
        (0..count).filter_map(sample).collect()
    }
}

/// An error that wanders: a Gauss-Markov process of first order.
pub struct Drift<const N: usize> {
    kept: f64,
    fresh: f64,
    pub value: SVector<f64, N>,
}

impl<const N: usize> Drift<N> {
    /// An error with the standard deviation `sigma` after a long time. A third of an error remains
    /// after `lasts_s`.
    pub fn new(sigma: f64, lasts_s: f64, rate_hz: f64, value: SVector<f64, N>) -> Self {
        let kept = (-1.0 / (rate_hz * lasts_s)).exp();
        Self {
            kept,
            fresh: sigma * (1.0 - kept * kept).sqrt(),
            value,
        }
    }

    pub fn step(&mut self, rng: &mut ChaCha8Rng) {
        self.value = self.value * self.kept + normal(rng) * self.fresh;
    }
}

/// Random numbers of the standard normal distribution.
pub fn normal<const N: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Rounds to a multiple of a step; without a step, which is 0, the value stays.
pub fn rounded(value: f64, step: f64) -> f64 {
    match step > 0.0 {
        // Adding zero turns a negative one into a positive one.
        true => (value / step).round() * step + 0.0,
        false => value,
    }
}
