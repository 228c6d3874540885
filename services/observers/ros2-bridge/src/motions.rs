//! The basis of a run's motions: how far the radar determines them, and whether the other
//! sensors agree with it.

use gyre_contract::{
    Basis, RefinementRecord, Witness, WitnessCounts, WitnessRecord, outcome, verdict,
};
use gyre_ros2_messages::diagnostic_msgs::{DiagnosticStatus, KeyValue, OK, WARN};

/// Counts since the start of the run.
#[derive(Clone, Debug, Default)]
pub struct Motions {
    counts: WitnessCounts,
    doubted: [u64; Witness::ALL.len()],
    weak: u64,
    newest: Option<RefinementRecord>,
}

impl Motions {
    pub fn add(&mut self, motion: &RefinementRecord) {
        self.counts.add(motion);
        self.weak += u64::from(motion.outcome == outcome::WEAK);
        for (doubted, of) in self.doubted.iter_mut().zip(&motion.witnesses) {
            *doubted += u64::from(of.verdict == verdict::DOUBTED);
        }
        self.newest = Some(*motion);
    }

    /// Returns the basis of the newest motion, and all counts. It is a warning if the radar does
    /// not wholly determine the motion, or contradicts another sensor; `None` before a motion.
    pub fn diagnostic(&self) -> Option<DiagnosticStatus> {
        let newest = self.newest.as_ref()?;
        let basis = newest.basis();
        let is_weak = newest.outcome == outcome::WEAK;
        let of_sensors = Witness::ALL.map(|kind| contradiction(kind, newest.of(kind)));
        let of_sensors = of_sensors.iter().flatten().cloned();
        let weak = is_weak.then(|| "weak".to_owned());
        let reasons: Vec<String> = weak.into_iter().chain(of_sensors).collect();
        let level = match basis.is_degraded() || !reasons.is_empty() {
            true => WARN,
            false => OK,
        };
        let message = [vec![basis.name().to_owned()], reasons].concat();
        let mut part = DiagnosticStatus::new("gyre: motion", level, message.join(", "));
        let by_basis = Basis::ALL.iter().zip(self.counts.by_basis);
        let by_basis = by_basis.map(|(basis, count)| KeyValue::new(basis.name(), count));
        part.values = by_basis.chain([KeyValue::new("weak", self.weak)]).collect();
        for kind in Witness::ALL {
            let of = kind as usize;
            let (word, doubted) = (kind.row().word, self.doubted[of]);
            let agrees = self.counts.used[of] - doubted;
            part.values.extend([
                KeyValue::new(&format!("{word} agrees"), agrees),
                KeyValue::new(&format!("{word} doubted"), doubted),
                KeyValue::new(&format!("{word} refused"), self.counts.refused[of]),
            ]);
        }
        Some(part)
    }
}

fn contradiction(kind: Witness, of: &WitnessRecord) -> Option<String> {
    let word = kind.row().word;
    match of.verdict {
        verdict::DOUBTED => Some(format!("{word} doubted")),
        verdict::REFUSED => Some(format!("{word} refused")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_contract::initial_guess;

    #[test]
    fn weak_motions_walls_and_contradictions_are_warnings() {
        let mut motions = Motions::default();
        assert_eq!(motions.diagnostic(), None);
        let mut newest = |outcome, initial_guess, verdict| {
            let mut motion = RefinementRecord {
                outcome,
                initial_guess,
                ..RefinementRecord::default()
            };
            motion.of_mut(Witness::Gyro).verdict = verdict;
            motions.add(&motion);
            let part = motions.diagnostic().unwrap();
            (part.level, part.message, part.values)
        };
        let matched = initial_guess::PREDICTION;
        for (motion, level, message) in [
            ([outcome::REFINED, matched], OK, "radar only"),
            ([outcome::WEAK, matched], WARN, "radar only, weak"),
            (
                [outcome::REFINED, initial_guess::ALONG_WALLS],
                WARN,
                "way guessed",
            ),
            ([outcome::PREDICTED, matched], WARN, "guessed"),
        ] {
            let found = newest(motion[0], motion[1], verdict::NONE);
            assert_eq!((found.0, &*found.1), (level, message));
        }
        for (verdict, level, message) in [
            (verdict::USED, OK, "radar and others"),
            (verdict::DOUBTED, WARN, "radar and others, gyro doubted"),
            (verdict::REFUSED, WARN, "radar only, gyro refused"),
        ] {
            let found = newest(outcome::REFINED, matched, verdict);
            assert_eq!((found.0, &*found.1), (level, message));
        }
        let (_, _, values) = newest(outcome::WEAK, matched, verdict::DOUBTED);
        let count = |key: &str| {
            let of_key = values.iter().find(|it| it.key == key);
            of_key.map(|it| it.value.clone())
        };
        let keys = [
            "weak",
            "guessed",
            "gyro agrees",
            "gyro doubted",
            "gyro refused",
        ];
        let expected = ["2", "1", "1", "2", "1"].map(|it| Some(it.to_owned()));
        assert_eq!(keys.map(count), expected);
    }
}
