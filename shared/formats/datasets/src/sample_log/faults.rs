//! The faults of logs.

use serde::Serialize;

/// Faults of a log. Counted samples are left out unless the count states otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogFaults {
    /// Rows that do not fit the table, such as a truncated row.
    pub unreadable: usize,
    /// Line (of a folder of files: number) of the first of them.
    pub first_unreadable: usize,
    /// Messages of a live receiver of fixes that came faster than they were read, or died with a
    /// process.
    pub lost: usize,
    /// Messages of a bag, and rows with a stamp but no place: the receiver had no fix.
    pub without_fix: usize,
    /// Samples that are stated to have no value, or have one that is not finite.
    pub not_a_number: usize,
    /// Samples with a rate beyond 10 rad/s, or a speed beyond 100 m/s.
    pub absurd: usize,
    /// Fixes that are on no place of the earth.
    pub off_the_earth: usize,
    /// Fixes at latitude 0, longitude 0: what receivers write without a fix.
    pub zero: usize,
    /// Samples that come in bursts of one stamp: spread over the time since the burst before.
    pub spread: usize,
    /// Samples with a repeated stamp.
    pub repeated: usize,
    /// Fixes at the very place of the fix before, as of a frozen receiver or a standing vehicle:
    /// only the first is used.
    pub frozen: usize,
    /// Samples with a stamp before an earlier one: sorted.
    pub out_of_order: usize,
    /// Samples of times for which the clock was set back, by up to a second.
    pub measured_twice: usize,
    /// Fixes whose status the receiver does not state: used.
    pub of_unknown_status: usize,
    /// Fixes that state to be better than a centimetre: used as if they stated that.
    pub too_certain: usize,
    /// Fixes that jump away from the others faster than a vehicle.
    pub jumps: usize,
    /// Places where the stamps step back by more than a second, or ahead by more than an hour, s.
    pub clock_steps_s: Vec<f64>,
    /// The number of the sample, from 1, behind which the first of them is.
    pub first_clock_step: usize,
    /// Samples whose stamps such steps make unusable.
    pub by_clock_steps: usize,
    /// Times without samples, of more than three periods.
    pub gaps: Vec<LogGap>,
    /// Samples that are missing one or two at a time: the value is interpolated.
    pub bridged: usize,
    /// The header names no unit: rad/s or m/s is assumed.
    pub unit_is_assumed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogGap {
    /// The last sample before it, s since the first of the log.
    pub after_s: f64,
    pub seconds: f64,
}

/// A count of faults: its name among the figures, the count, and the words behind it. LINE, VALUES
/// and ABSURD in the words stand for the first unreadable line and the words of the kind.
pub(crate) type FaultWords = (&'static str, fn(&LogFaults) -> usize, &'static str);

macro_rules! words {
    ($($name:ident: $words:literal),+ $(,)?) => {
        &[$((stringify!($name), |faults| faults.$name, $words)),+]
    };
}

pub(super) const OF_SAMPLES: &[FaultWords] = words! {
    unreadable: "rows are not of its table, the first in line LINE: left out.",
    not_a_number: "samples have no VALUES, or some that are not finite: left out.",
    absurd: "samples have ABSURD: left out.",
    spread: "samples come in bursts of one stamp: spread evenly back to the burst before.",
    repeated: "samples have the stamp of a different sample: left out.",
    out_of_order: "samples come later than their stamps say: sorted.",
    measured_twice: "samples are of times over which the clock was set back, and which have two measurements: left out.",
};

pub(super) const OF_FIXES: &[FaultWords] = words! {
    unreadable: "unreadable",
    lost: "lost",
    without_fix: "without a fix",
    not_a_number: "not a number",
    off_the_earth: "off the earth",
    zero: "at 0, 0",
    repeated: "repeated",
    frozen: "at the very place of the fix before",
    out_of_order: "out of order",
    of_unknown_status: "of unknown status, used",
    too_certain: "stated better than 1 cm, used as of 1 cm",
    jumps: "jump faster than a vehicle",
};

impl LogFaults {
    /// Returns how the clock steps, and where first: without a full stop.
    pub fn clock_steps(&self) -> String {
        let (count, first) = (self.clock_steps_s.len(), self.first_clock_step);
        let steps = self.clock_steps_s.iter().take(5);
        let steps: Vec<String> = steps.map(|step| format!("{step:+.6} s")).collect();
        let steps = steps.join(", ");
        format!("The clock steps {count} times ({steps}), first behind sample {first}")
    }
}
