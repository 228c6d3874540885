//! The kinds of sensors beside the radar: the measured part of a motion, and the names in outputs.

use crate::samples::SampleKind;

crate::named! {
    /// A kind of sensor beside the radar, with its name in configurations and outputs. Of two that
    /// measure the same, the motions use the first.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Witness {
        Gyro = "gyro",
        Wheels = "wheels",
        Doppler = "doppler",
    }
}

/// The part of a motion that a kind measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measures {
    /// The turn, rad, with a bias.
    Turn,
    /// The distance ahead, m.
    Distance,
    /// The heading itself, rad, with an unknown constant offset.
    Heading,
}

#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub measures: Measures,
    /// The kind of its samples, which have a clock of their own; `None`: it is measured from the
    /// scans themselves.
    pub samples: Option<SampleKind>,
    /// The name in a sentence.
    pub word: &'static str,
    /// The name of a measurement that is not used, and of many of them.
    pub refused: [&'static str; 2],
    /// The keys of `WitnessCounts` in a run's report for those used and those not used.
    pub keys: [&'static str; 2],
    /// The metric of its measurements: name and description.
    pub metric: [&'static str; 2],
}

/// In the order of [`Witness::ALL`].
static TABLE: [Row; Witness::ALL.len()] = [
    Row {
        measures: Measures::Turn,
        samples: Some(SampleKind::Gyro),
        word: "gyro",
        refused: ["refused", "refused"],
        keys: ["gyro_used", "gyro_refused"],
        metric: [
            "gyro_turns",
            "Turns that the gyro has measured: used, or refused since the radar contradicts.",
        ],
    },
    Row {
        measures: Measures::Distance,
        samples: Some(SampleKind::Wheels),
        word: "wheels",
        refused: ["slip", "slips"],
        keys: ["wheels_used", "wheel_slips"],
        metric: [
            "wheel_distances",
            "Distances that the wheels have measured: used, or slipping.",
        ],
    },
    Row {
        measures: Measures::Distance,
        samples: None,
        word: "Doppler",
        refused: ["refused", "refused"],
        keys: ["doppler_used", "doppler_refused"],
        metric: [
            "doppler_velocities",
            "Velocities by Doppler: used, or refused since the matches contradict.",
        ],
    },
];

impl Witness {
    pub const fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// Returns the kinds that come as samples.
    pub fn sampled() -> impl Iterator<Item = (Self, SampleKind)> {
        Self::ALL
            .into_iter()
            .filter_map(|kind| Some((kind, kind.row().samples?)))
    }
}
