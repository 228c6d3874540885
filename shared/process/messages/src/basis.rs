//! The basis of motions: the radar, other sensors, or a guess; and how often the others were used.

use crate::refinement::{RefinementRecord, doppler, gyro, initial_guess, outcome, wheels};

/// The basis of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Two scans: there is no refinement, or the chain starts here.
    ScanToScan,
    /// The map alone: there is no gyro, no wheels and no Doppler, or they are not used.
    RadarOnly,
    /// The map, and a gyro, wheels or Doppler that do not contradict it.
    RadarAndOthers,
    /// Walls without structure, and wheels or Doppler for the way along them.
    AlongWalls,
    /// As above without these sensors: the displacement comes from the motions before.
    WayGuessed,
    /// Wheels or Doppler, since nothing matches: with the turn of a gyro, if there is one.
    DeadReckoning,
    /// The motions before, since nothing matches and there are no wheels and no Doppler: with the
    /// turn of a gyro, if there is one.
    Guessed,
}

impl Basis {
    pub const ALL: [Self; 7] = [
        Self::ScanToScan,
        Self::RadarOnly,
        Self::RadarAndOthers,
        Self::AlongWalls,
        Self::WayGuessed,
        Self::DeadReckoning,
        Self::Guessed,
    ];

    /// Returns its name in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScanToScan => "scan to scan",
            Self::RadarOnly => "radar only",
            Self::RadarAndOthers => "radar and others",
            Self::AlongWalls => "along walls",
            Self::WayGuessed => "way guessed",
            Self::DeadReckoning => "dead reckoning",
            Self::Guessed => "guessed",
        }
    }

    /// Returns whether the radar leaves part of the motion undetermined, so that other sensors or
    /// the motions before determine it.
    pub fn is_degraded(self) -> bool {
        match self {
            Self::ScanToScan | Self::RadarOnly | Self::RadarAndOthers => false,
            Self::AlongWalls | Self::WayGuessed | Self::DeadReckoning | Self::Guessed => true,
        }
    }
}

impl RefinementRecord {
    /// Returns whether the motion is made with the turn of the gyro.
    pub fn uses_gyro(&self) -> bool {
        [gyro::USED, gyro::DOUBTED].contains(&self.gyro)
    }

    /// Returns the basis of the motion.
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

/// Counts of motions by their basis, and by the part of gyro, wheels and Doppler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct WitnessCounts {
    /// Motions by their basis, in the order of [`Basis::ALL`].
    pub by_basis: [u64; Basis::ALL.len()],
    /// Those whose turn the gyro has measured, and which were made with it.
    pub gyro_used: u64,
    /// Those whose turn it has measured, and which contradict it.
    pub gyro_refused: u64,
    /// Those whose distance the wheels have measured without slipping.
    pub wheels_used: u64,
    /// Those whose distance they have measured slipping.
    pub wheel_slips: u64,
    /// Motions with a Doppler velocity that agrees with them.
    pub doppler_used: u64,
    /// Motions with a Doppler velocity that contradicts them.
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
        let words = [
            of("gyro", self.gyro_used, ("refused", self.gyro_refused)),
            of("wheels", self.wheels_used, ("slips", self.wheel_slips)),
            of(
                "Doppler",
                self.doppler_used,
                ("refused", self.doppler_refused),
            ),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion([outcome, initial_guess]: [u32; 2], gyro: u64, wheels: u64) -> RefinementRecord {
        RefinementRecord {
            outcome,
            initial_guess,
            gyro,
            wheels,
            ..RefinementRecord::default()
        }
    }

    #[test]
    fn each_state_has_its_name_and_the_sensors_that_were_used_are_counted() {
        let refined = [outcome::REFINED, initial_guess::PREDICTION];
        let walls = [outcome::REFINED, initial_guess::ALONG_WALLS];
        let predicted = [outcome::PREDICTED, initial_guess::PREDICTION];
        let cases = [
            (motion([0, 0], 0, 0), "scan to scan"),
            (motion(refined, gyro::NONE, wheels::NONE), "radar only"),
            (motion(refined, gyro::REFUSED, wheels::SLIP), "radar only"),
            (
                motion(refined, gyro::USED, wheels::SLIP),
                "radar and others",
            ),
            (
                motion(refined, gyro::REFUSED, wheels::USED),
                "radar and others",
            ),
            (motion(walls, gyro::USED, wheels::USED), "along walls"),
            (motion(walls, gyro::USED, wheels::NONE), "way guessed"),
            (
                motion(predicted, gyro::NONE, wheels::USED),
                "dead reckoning",
            ),
            (motion(predicted, gyro::USED, wheels::SLIP), "guessed"),
        ];
        for (motion, name) in cases {
            assert_eq!(motion.basis().name(), name, "{motion:?}");
        }
        let counts = WitnessCounts::of(cases.iter().map(|(motion, _)| motion));
        assert_eq!(counts.by_basis, [1, 2, 2, 1, 1, 1, 1]);
        assert_eq!(counts.motions(), 9);
        assert_eq!(counts.degraded_percent(), Some(400.0 / 9.0));
        assert_eq!(WitnessCounts::default().degraded_percent(), None);
        let words = "gyro 44 %, 2 refused, wheels 33 %, 3 slips";
        assert_eq!(counts.in_words().as_deref(), Some(words));
        assert_eq!(WitnessCounts::of([&cases[1].0]).in_words(), None);
        let by_doppler = |made: [u32; 2], doppler: u64| RefinementRecord {
            doppler,
            ..motion(made, gyro::NONE, wheels::NONE)
        };
        let cases = [
            (by_doppler(refined, doppler::USED), "radar and others"),
            (by_doppler(refined, doppler::REFUSED), "radar only"),
            (by_doppler(walls, doppler::USED), "along walls"),
            (by_doppler(walls, doppler::REFUSED), "way guessed"),
            (by_doppler(predicted, doppler::USED), "dead reckoning"),
        ];
        for (motion, name) in cases {
            assert_eq!(motion.basis().name(), name, "{motion:?}");
        }
        let counts = WitnessCounts::of(cases.iter().map(|(motion, _)| motion));
        let words = "Doppler 60 %, 2 refused";
        assert_eq!(counts.in_words().as_deref(), Some(words));
    }
}
