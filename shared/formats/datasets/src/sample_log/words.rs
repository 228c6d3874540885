//! The faults of a log in words and in figures.

use gyre_geometry::samples::SampleKind;
use serde_json::{Map, Value, json};

use super::{
    SampleLog,
    faults::{FaultWords, LogFaults, LogGap},
    kinds::Kind,
};

impl LogFaults {
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
