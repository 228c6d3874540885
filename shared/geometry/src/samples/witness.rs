//! The kinds of sensors beside the radar, and of their samples: the measured part of a motion, and
//! the names in outputs.

use std::f64::consts::TAU;

use crate::samples::{MAX_RATE_RADPS, MAX_SPEED_MPS, Sample};

crate::named! {
    /// A kind of sensor beside the radar, with its name in configurations and outputs. Of two that
    /// measure the same, the motions use the first.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Witness {
        Gyro = "gyro",
        Wheels = "wheels",
        Doppler = "doppler",
        Heading = "heading",
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
    /// The figures of a run: name, place in `summary.json`, and decimals; without decimals it is
    /// the count of something unusual.
    pub figures: &'static [(&'static str, &'static str, Option<usize>)],
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
        figures: &[
            ("turns by the gyro", "/gyro/motions", Some(0)),
            ("turns of the gyro doubted", "/gyro/doubted", None),
            ("turns of the gyro refused", "/gyro/refused", None),
            ("bias of the gyro, rad/s", "/gyro/bias_radps", Some(7)),
            ("its deviation, rad/s", "/gyro/bias_sigma_radps", Some(7)),
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
        figures: &[
            ("distances by the wheels", "/wheels/motions", Some(0)),
            ("distances of slipping wheels", "/wheels/slips", None),
            (
                "motions predicted by the wheels",
                "/wheels/predicted",
                Some(0),
            ),
            ("scale of the wheels", "/wheels/scale", Some(4)),
            ("its deviation", "/wheels/scale_sigma", Some(4)),
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
        figures: &[
            ("velocities by Doppler", "/doppler/motions", Some(0)),
            ("velocities by Doppler refused", "/doppler/refused", Some(0)),
            (
                "motions predicted by Doppler",
                "/doppler/predicted",
                Some(0),
            ),
            ("scale of Doppler", "/doppler/scale", Some(4)),
            ("its deviation", "/doppler/scale_sigma", Some(4)),
        ],
    },
    Row {
        measures: Measures::Heading,
        samples: Some(SampleKind::Heading),
        word: "heading",
        refused: ["refused", "refused"],
        keys: ["heading_used", "heading_refused"],
        metric: [
            "headings",
            "Absolute headings: used, or refused since the radar contradicts.",
        ],
        figures: &[
            ("absolute headings", "/heading/motions", Some(0)),
            ("absolute headings refused", "/heading/refused", None),
            ("their offset, rad", "/heading/offset_rad", Some(4)),
            ("its deviation, rad", "/heading/offset_sigma_rad", Some(5)),
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

/// The quantity that a sample measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SampleKind {
    /// Angular velocity about x, y, z (rad/s), then acceleration along them (m/s²).
    Gyro = 1,
    /// Speed along x (m/s), negative backwards.
    Wheels = 2,
    /// Place of the antenna: latitude and longitude (degrees), or east and north (m); altitude
    /// above the ellipsoid (m), 0 where the log has none; standard deviation along each of both
    /// axes (m), not above zero where the log has none; 1 if the receiver does not state whether it
    /// had a fix. Fixes travel with no scan.
    Gnss = 3,
    /// Heading of the vehicle (rad), counter-clockwise from east.
    Heading = 4,
}

/// The properties of a kind of samples.
struct SampleRow {
    section: &'static str,
    /// The numbers of values that a line of a datagram can have; none of a kind whose lines can be
    /// without a measurement.
    counts: &'static [usize],
    /// The values at the front that are bounded, and their bound; `None`: it travels with no scan.
    bounded: Option<(usize, f64)>,
    /// The value that is integrated from scan to scan.
    rate: usize,
}

impl SampleKind {
    pub const ALL: [Self; 4] = [Self::Gyro, Self::Wheels, Self::Gnss, Self::Heading];

    const fn row(self) -> SampleRow {
        let (section, counts, bounded, rate): (_, &[usize], _, _) = match self {
            Self::Gyro => ("gyro", &[3, 6], Some((3, MAX_RATE_RADPS)), 2),
            Self::Wheels => ("wheels", &[1], Some((1, MAX_SPEED_MPS)), 0),
            Self::Gnss => ("gnss", &[], None, 0),
            Self::Heading => ("heading", &[1], Some((1, TAU)), 0),
        };
        SampleRow {
            section,
            counts,
            bounded,
            rate,
        }
    }

    pub const fn section(self) -> &'static str {
        self.row().section
    }

    pub(super) const fn rate(self) -> usize {
        self.row().rate
    }

    pub(super) const fn bounded(self) -> Option<(usize, f64)> {
        self.row().bounded
    }

    /// Parses a line of a datagram: a stamp, ns, and the values in their order, with commas
    /// between. `None`: it is no sample.
    pub fn parse(self, line: &str) -> Option<Sample> {
        let (stamp_ns, rest) = line.split_once(',')?;
        let parsed: Result<Vec<f64>, _> = rest.split(',').map(|it| it.trim().parse()).collect();
        let parsed = parsed
            .ok()
            .filter(|it| self.row().counts.contains(&it.len()))?;
        let mut values = [0.0; 6];
        values[..parsed.len()].copy_from_slice(&parsed);
        Some(Sample::of(self, stamp_ns.trim().parse().ok()?, values))
    }
}
