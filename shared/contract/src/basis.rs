//! The basis of motions: the radar, other sensors, or a guess; and how often the others were used.

use crate::refinement::{RefinementRecord, doppler, gyro, initial_guess, outcome, wheels};

crate::named! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Basis {
        /// Two scans: there is no refinement, or the chain starts here.
        ScanToScan = "scan to scan",
        /// The map alone: there is no gyro, no wheels and no Doppler, or they are not used.
        RadarOnly = "radar only",
        /// The map, and a gyro, wheels or Doppler that do not contradict it.
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
    pub fn uses_gyro(&self) -> bool {
        [gyro::USED, gyro::DOUBTED].contains(&self.gyro)
    }

    pub fn basis(&self) -> Basis {
        let by_distance = self.wheels == wheels::USED || self.doppler == doppler::USED;
        match self.outcome {
            outcome::SEARCHED => Basis::ScanToScan,
            outcome::PREDICTED if by_distance => Basis::DeadReckoning,
            outcome::PREDICTED => Basis::Guessed,
            _ if self.initial_guess == initial_guess::ALONG_WALLS => match by_distance {
                true => Basis::AlongWalls,
                false => Basis::WayGuessed,
            },
            _ if by_distance || self.uses_gyro() => Basis::RadarAndOthers,
            _ => Basis::RadarOnly,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct WitnessCounts {
    /// In the order of [`Basis::ALL`].
    pub by_basis: [u64; Basis::ALL.len()],
    pub gyro_used: u64,
    pub gyro_refused: u64,
    pub wheels_used: u64,
    pub wheel_slips: u64,
    pub doppler_used: u64,
    pub doppler_refused: u64,
}

impl WitnessCounts {
    pub fn add(&mut self, motion: &RefinementRecord) {
        self.by_basis[motion.basis() as usize] += 1;
        self.gyro_used += u64::from(motion.uses_gyro());
        self.gyro_refused += u64::from(motion.gyro == gyro::REFUSED);
        self.wheels_used += u64::from(motion.wheels == wheels::USED);
        self.wheel_slips += u64::from(motion.wheels == wheels::SLIP);
        self.doppler_used += u64::from(motion.doppler == doppler::USED);
        self.doppler_refused += u64::from(motion.doppler == doppler::REFUSED);
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

    /// Returns the part of gyro, wheels and Doppler in words, as `gyro 98 %, 1 refused, wheels 100
    /// %`; `None` without any measurement.
    pub fn in_words(&self) -> Option<String> {
        let of = |name, used: u64, (not, count): (&str, u64)| {
            let share = 100.0 * used as f64 / self.motions().max(1) as f64;
            let not = match count {
                0 => String::new(),
                _ => format!(", {count} {not}"),
            };
            (used + count > 0).then(|| format!("{name} {share:.0} %{not}"))
        };
        let doppler_refused = ("refused", self.doppler_refused);
        let words = [
            of("gyro", self.gyro_used, ("refused", self.gyro_refused)),
            of("wheels", self.wheels_used, ("slips", self.wheel_slips)),
            of("Doppler", self.doppler_used, doppler_refused),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_name_and_the_sensors_that_were_used_are_counted() {
        let of = |[outcome, initial_guess]: [u32; 2]| {
            move |gyro, wheels, doppler| RefinementRecord {
                outcome,
                initial_guess,
                gyro,
                wheels,
                doppler,
                ..RefinementRecord::default()
            }
        };
        let counted = |cases: &[(RefinementRecord, &str)]| {
            for (motion, name) in cases {
                assert_eq!(motion.basis().name(), *name, "{motion:?}");
            }
            WitnessCounts::of(cases.iter().map(|(motion, _)| motion))
        };
        let refined = of([outcome::REFINED, initial_guess::PREDICTION]);
        let walls = of([outcome::REFINED, initial_guess::ALONG_WALLS]);
        let predicted = of([outcome::PREDICTED, initial_guess::PREDICTION]);
        let counts = counted(&[
            (of([0, 0])(0, 0, 0), "scan to scan"),
            (refined(0, 0, 0), "radar only"),
            (refined(gyro::REFUSED, wheels::SLIP, 0), "radar only"),
            (refined(gyro::USED, wheels::SLIP, 0), "radar and others"),
            (refined(gyro::REFUSED, wheels::USED, 0), "radar and others"),
            (walls(gyro::USED, wheels::USED, 0), "along walls"),
            (walls(gyro::USED, 0, 0), "way guessed"),
            (predicted(0, wheels::USED, 0), "dead reckoning"),
            (predicted(gyro::USED, wheels::SLIP, 0), "guessed"),
        ]);
        assert_eq!(counts.by_basis, [1, 2, 2, 1, 1, 1, 1]);
        assert_eq!(counts.motions(), 9);
        assert_eq!(counts.degraded_percent(), Some(400.0 / 9.0));
        assert_eq!(WitnessCounts::default().degraded_percent(), None);
        let words = "gyro 44 %, 2 refused, wheels 33 %, 3 slips";
        assert_eq!(counts.in_words().as_deref(), Some(words));
        let counts = counted(&[
            (refined(0, 0, doppler::USED), "radar and others"),
            (refined(0, 0, doppler::REFUSED), "radar only"),
            (walls(0, 0, doppler::USED), "along walls"),
            (walls(0, 0, doppler::REFUSED), "way guessed"),
            (predicted(0, 0, doppler::USED), "dead reckoning"),
        ]);
        let words = "Doppler 60 %, 2 refused";
        assert_eq!(counts.in_words().as_deref(), Some(words));
        let counts = counted(&[(refined(0, 0, 0), "radar only")]);
        assert_eq!(counts.in_words(), None);
    }
}
