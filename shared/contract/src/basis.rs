//! The basis of motions: the radar, other sensors, or a guess; and how often the others were used.

use gyre_geometry::samples::Witness;
use serde::{Serialize, Serializer, ser::SerializeMap};

use crate::refinement::{RefinementRecord, initial_guess, outcome, verdict};

gyre_geometry::named! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Basis {
        /// Two scans: there is no refinement, or the chain starts here.
        ScanToScan = "scan to scan",
        /// The map alone: there are no other sensors, or they are not used.
        RadarOnly = "radar only",
        /// The map, and another sensor that does not contradict it.
        RadarAndOthers = "radar and others",
        /// Walls without structure, and wheels or Doppler for the way along them.
        AlongWalls = "along walls",
        /// As above without these sensors: the displacement comes from the motions before.
        WayGuessed = "way guessed",
        /// Wheels or Doppler, since nothing matches: with the turn of a gyro, if there is one.
        DeadReckoning = "dead reckoning",
        /// The motions before, since nothing matches and there are no wheels and no Doppler: with
        /// the turn of a gyro, if there is one.
        Guessed = "guessed",
    }
}

impl Basis {
    /// Returns whether the radar leaves part of the motion undetermined, so that other sensors or
    /// the motions before determine it.
    pub fn is_degraded(self) -> bool {
        !matches!(
            self,
            Self::ScanToScan | Self::RadarOnly | Self::RadarAndOthers
        )
    }
}

impl RefinementRecord {
    pub fn basis(&self) -> Basis {
        let by_distance = self.distance_by().is_some();
        match self.outcome {
            outcome::SEARCHED => Basis::ScanToScan,
            outcome::PREDICTED if by_distance => Basis::DeadReckoning,
            outcome::PREDICTED => Basis::Guessed,
            _ if self.initial_guess == initial_guess::ALONG_WALLS => match by_distance {
                true => Basis::AlongWalls,
                false => Basis::WayGuessed,
            },
            _ if self.witnesses.iter().any(|it| it.is_used()) => Basis::RadarAndOthers,
            _ => Basis::RadarOnly,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WitnessCounts {
    /// In the order of [`Basis::ALL`].
    pub by_basis: [u64; Basis::ALL.len()],
    /// Motions that use each kind, and that do not use its measurement.
    pub used: [u64; Witness::ALL.len()],
    pub refused: [u64; Witness::ALL.len()],
}

impl Serialize for WitnessCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("by_basis", &self.by_basis)?;
        for kind in Witness::ALL {
            let [used, refused] = kind.row().keys;
            map.serialize_entry(used, &self.used[kind as usize])?;
            map.serialize_entry(refused, &self.refused[kind as usize])?;
        }
        map.end()
    }
}

impl WitnessCounts {
    pub fn add(&mut self, motion: &RefinementRecord) {
        self.by_basis[motion.basis() as usize] += 1;
        for (kind, of) in motion.witnesses.iter().enumerate() {
            self.used[kind] += u64::from(of.is_used());
            self.refused[kind] += u64::from(of.verdict == verdict::REFUSED);
        }
    }

    pub fn of<'a>(motions: impl IntoIterator<Item = &'a RefinementRecord>) -> Self {
        let mut counts = Self::default();
        motions.into_iter().for_each(|motion| counts.add(motion));
        counts
    }

    pub fn motions(&self) -> u64 {
        self.by_basis.iter().sum()
    }

    /// Returns the share of the motions that the radar does not wholly determine, %: see
    /// [`Basis::is_degraded`]; `None` without motions.
    pub fn degraded_percent(&self) -> Option<f64> {
        let degraded = Basis::ALL.iter().filter(|basis| basis.is_degraded());
        let degraded: u64 = degraded.map(|basis| self.by_basis[*basis as usize]).sum();
        let motions = self.motions();
        (motions > 0).then(|| 100.0 * degraded as f64 / motions as f64)
    }

    /// Returns the part of other sensors in words, as `gyro 98 %, 1 refused, wheels 100
    /// %`; `None` without any measurement.
    pub fn in_words(&self) -> Option<String> {
        let words = Witness::ALL.into_iter().filter_map(|kind| {
            let (used, refused) = (self.used[kind as usize], self.refused[kind as usize]);
            let share = 100.0 * used as f64 / self.motions().max(1) as f64;
            let (name, [_, refusals]) = (kind.row().word, kind.row().refused);
            let not = match refused {
                0 => String::new(),
                _ => format!(", {refused} {refusals}"),
            };
            (used + refused > 0).then(|| format!("{name} {share:.0} %{not}"))
        });
        let words: Vec<String> = words.collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_name_and_the_sensors_that_were_used_are_counted() {
        let of = |[outcome, initial_guess]: [u32; 2]| {
            move |verdicts: [u64; 3]| {
                let mut record = RefinementRecord {
                    outcome,
                    initial_guess,
                    ..RefinementRecord::default()
                };
                for (of, verdict) in record.witnesses.iter_mut().zip(verdicts) {
                    of.verdict = verdict;
                }
                record
            }
        };
        let [no, used, refused] = [verdict::NONE, verdict::USED, verdict::REFUSED];
        let counted = |cases: &[(RefinementRecord, &str)]| {
            for (motion, name) in cases {
                assert_eq!(motion.basis().name(), *name, "{motion:?}");
            }
            WitnessCounts::of(cases.iter().map(|(motion, _)| motion))
        };
        let by_match = of([outcome::REFINED, initial_guess::PREDICTION]);
        let walls = of([outcome::REFINED, initial_guess::ALONG_WALLS]);
        let predicted = of([outcome::PREDICTED, initial_guess::PREDICTION]);
        let counts = counted(&[
            (of([0, 0])([no; 3]), "scan to scan"),
            (by_match([no, no, no]), "radar only"),
            (by_match([refused, refused, no]), "radar only"),
            (by_match([used, refused, no]), "radar and others"),
            (by_match([refused, used, no]), "radar and others"),
            (walls([used, used, no]), "along walls"),
            (walls([used, no, no]), "way guessed"),
            (predicted([no, used, no]), "dead reckoning"),
            (predicted([used, refused, no]), "guessed"),
        ]);
        assert_eq!(counts.by_basis, [1, 2, 2, 1, 1, 1, 1]);
        assert_eq!(counts.motions(), 9);
        assert_eq!(counts.degraded_percent(), Some(400.0 / 9.0));
        assert_eq!(WitnessCounts::default().degraded_percent(), None);
        let words = "gyro 44 %, 2 refused, wheels 33 %, 3 slips";
        assert_eq!(counts.in_words().as_deref(), Some(words));
        let counts = counted(&[
            (by_match([no, no, used]), "radar and others"),
            (by_match([no, no, refused]), "radar only"),
            (walls([no, no, used]), "along walls"),
            (walls([no, no, refused]), "way guessed"),
            (predicted([no, no, used]), "dead reckoning"),
        ]);
        let words = "Doppler 60 %, 2 refused";
        assert_eq!(counts.in_words().as_deref(), Some(words));
        let json = serde_json::to_string(&counts).unwrap_or_default();
        let keys = r#""gyro_used":0,"gyro_refused":0,"wheels_used":0,"wheel_slips":0,"doppler_used":3,"doppler_refused":2"#;
        let expected = format!(r#"{{"by_basis":[0,1,1,1,1,1,0],{keys}"#);
        assert!(json.starts_with(&expected), "{json}");
        let counts = counted(&[(by_match([no, no, no]), "radar only")]);
        assert_eq!(counts.in_words(), None);
    }
}
