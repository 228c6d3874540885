//! The faults of logs, and their words.

use gyre_geometry::samples::SampleKind;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{SampleLog, kinds::Kind};

/// Faults of a log. Counted samples are left out unless the count states otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogFaults {
    /// Rows that do not fit the table, such as a truncated row.
    pub unreadable: usize,
    /// Line (of a folder of files: number) of the first of them.
    pub first_unreadable: usize,
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

/// A count of faults: its name among the figures, and the words behind it, in which LINE, VALUES
/// and ABSURD stand for the first unreadable line and the words of the kind.
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

    /// Returns each count of the faults of a kind that is not zero, with its words.
    pub fn named(&self, of: SampleKind) -> Vec<String> {
        let kind = Kind::of(of);
        let named = |(_, count, words): &FaultWords| {
            let count = Some(count(self)).filter(|count| *count > 0)?;
            let words = words.replace("LINE", &self.first_unreadable.to_string());
            let words = words.replace("VALUES", kind.value_words);
            Some(format!("{count} {}", words.replace("ABSURD", kind.absurd)))
        };
        kind.faults.iter().filter_map(named).collect()
    }
}

impl SampleLog {
    /// Returns a sentence for each kind of fault; of fixes, one for all.
    pub fn sentences(&self) -> Vec<String> {
        let (faults, named) = (&self.faults, self.faults.named(self.of));
        if self.of == SampleKind::Gnss {
            let listed = named.join(", ");
            let sentence = || format!("entries of its log that are left out, or sorted: {listed}.");
            return (!named.is_empty()).then(sentence).into_iter().collect();
        }
        let steps = (!faults.clock_steps_s.is_empty()).then(|| {
            let (steps, count) = (faults.clock_steps(), faults.by_clock_steps);
            format!("{steps}: {count} samples that do not fit with the others are left out.")
        });
        let longest = faults.gaps.iter().copied();
        let longest = longest.max_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let gaps = longest.map(|LogGap { after_s, seconds }| {
            let places = faults.gaps.len();
            format!("Samples are missing in {places} places, for up to {seconds:.2} s ({after_s:.1} s after the first).")
        });
        let count = faults.bridged;
        let bridged = (count > 0).then(|| {
            format!("{count} samples are missing one or two at a time: interpolated where `max_gap_s` allows it.")
        });
        let unit = format!("The header names no unit {}.", Kind::of(self.of).unit);
        let unit = faults.unit_is_assumed.then_some(unit);
        let others = [steps, gaps, bridged, unit].into_iter().flatten();
        named.into_iter().chain(others).collect()
    }

    /// Returns the figures of the faults.
    pub fn fault_figures(&self) -> Value {
        let (faults, of_fixes) = (&self.faults, self.of == SampleKind::Gnss);
        let mut figures = Map::new();
        for (name, count, _) in Kind::of(self.of).faults {
            figures.insert((*name).to_owned(), json!(count(faults)));
            if *name == "unreadable" && !(of_fixes && faults.first_unreadable == 0) {
                let first = json!(faults.first_unreadable);
                figures.insert("first_unreadable".to_owned(), first);
            }
        }
        let of_times = [
            ("clock_steps_s", json!(faults.clock_steps_s)),
            ("first_clock_step", json!(faults.first_clock_step)),
            ("by_clock_steps", json!(faults.by_clock_steps)),
            ("gaps", json!(faults.gaps)),
            ("bridged", json!(faults.bridged)),
            ("unit_is_assumed", json!(faults.unit_is_assumed)),
        ];
        let of_times = of_times.into_iter().filter(|_| !of_fixes);
        figures.extend(of_times.map(|(name, value)| (name.to_owned(), value)));
        Value::Object(figures)
    }
}
