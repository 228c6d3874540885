//! The section `[objects]` of a configuration.

use serde::{Deserialize, Serialize};

/// The kind of the tracking.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectsKind {
    /// No objects.
    #[default]
    None,
    /// Moving objects are tracked by Kalman filters.
    Tracks,
}

/// The tracking of moving objects: the section `[objects]`.
///
/// The constants are those of road vehicles and of radars that turn four times a second; those of
/// the score were fitted to simulated drives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsConfig {
    /// `none` or `tracks`. Default `none`.
    pub kind: ObjectsKind,
    /// Maximum range of what is tracked, m. Beyond it a beam of 1.8 degrees is wider than a car.
    /// Default 76: an oncoming car that is one at 60 m was first seen a second before.
    pub max_range_m: f64,
    /// Minimum range of a new object, m: nearer, the vehicle sees itself. Default 8.
    pub min_range_m: f64,
    /// Weight of a return over the mean weight of the range cells around it from which on it
    /// stands out: what does not is taken for the reverberation of a strong echo. Default 2.
    pub contrast: f64,
    /// Scans that are remembered, at most 64. A vehicle of 4.5 m at walking pace leaves its place
    /// within them. Default 20: five seconds.
    pub memory_scans: u32,
    /// Time between two scans beyond which all tracks end, s. Default 2: by then a car at walking
    /// pace is elsewhere.
    pub max_gap_s: f64,
    /// Expected share of the scans with a return at a place, from which on it belongs to what
    /// stands; what has never been in view has 0.5. Default 0.4: three scans that saw a place free
    /// make it 0.08, and a vehicle that has just passed 0.1 to 0.3.
    pub standing_share: f64,
    /// The same share where a known object is expected: from there on a return is of what stands.
    /// Default 0.7: a vehicle drives past what returns in every second scan.
    pub own_share: f64,
    /// Largest distance along the beam between neighbouring returns of one object, m. Default 5:
    /// the two ends of a van, with nothing between them.
    pub cluster_along_m: f64,
    /// Largest distance across the beam between them near the sensor, m; it grows by two azimuths
    /// with the range. Default 2.5: the width of a lorry.
    pub cluster_across_m: f64,
    /// Difference to the strongest weight of a cluster up to which a return is of the body, and no
    /// skirt of a strong echo, which is 20 dB below it and more. Default 0.5: 15 dB.
    pub skirt_weight: f64,
    /// Length and width of a new object, m. Default 4.4 and 1.9: a car.
    pub usual_size_m: [f64; 2],
    /// Length and width of the smallest object, m. Default 4 and 1.7.
    pub smallest_size_m: [f64; 2],
    /// Length and width of the largest object, m. Default 18 and 2.6: an articulated lorry or bus.
    pub largest_size_m: [f64; 2],
    /// Distance beyond the outline of an object within which returns are its own, m, besides the
    /// uncertainty of its place and of their bearings. Default 0.7: what two edges are uncertain
    /// by.
    pub margin_m: f64,
    /// Squared Mahalanobis distance between a cluster and a prediction up to which the two can be
    /// one object. Default 13.8: one cluster in a thousand of its own track is beyond it.
    pub gate: f64,
    /// Standard deviation between the edge that reflects and that of the body, m: corners are
    /// round, and bumpers reach beyond them. What the range cells and azimuths of the radar add is
    /// measured from its points. Default 0.3.
    pub edge_sigma_m: f64,
    /// The same of the near end of what has no heading yet, m: as it turns towards the sensor,
    /// another corner becomes the nearest. Default 0.6.
    pub unknown_edge_sigma_m: f64,
    /// Standard deviation of an object's acceleration along its way, m/s²: vehicles brake and
    /// accelerate with 1 to 3. Default 1.5.
    pub acceleration_mps2: f64,
    /// Standard deviation of its acceleration across its way beyond that of a turn, m/s²: a lane is
    /// changed with about 1. Default 1.
    pub lateral_acceleration_mps2: f64,
    /// Largest turn rate, rad/s: a car turns off at 7 m/s on a radius of 10 m. Default 0.7.
    pub turn_rate_radps: f64,
    /// Mean time for which a turn rate lasts, s: a driver steers into a corner, and out of it, in
    /// about that. Default 0.5.
    pub turn_lasts_s: f64,
    /// Standard deviation of a new object's velocity, each component, m/s: two of it are 60 km/h.
    /// Default 8.
    pub speed_sigma_mps: f64,
    /// Speed up to which an object counts as standing, m/s: the odometry's own error, and what
    /// wind moves. Default 0.8.
    pub standing_mps: f64,
    /// Speed above which its direction is the heading, m/s. Default 1: below, noise turns it.
    pub heading_mps: f64,
    /// Largest difference of the velocities of two tracks that are one object, m/s. Default 3.
    pub alike_mps: f64,
    /// Standard deviations by which the speed must exceed `standing_mps` for an object to be
    /// moving. Default 1.5: the score tells what stands as well.
    pub moving_sigmas: f64,
    /// Returns of a cluster that begins a track, at least. Default 3.
    pub min_returns: usize,
    /// Sum of their weights, at least; that of a return 30 dB above the threshold of the masks is
    /// 1. Default 0.8.
    pub min_weight: f64,
    /// The score from which on a track is an object: the logarithm of the likelihood of an object
    /// over that of clutter. More finds less, and less that is false. Default 3.
    pub confirm_score: f64,
    /// The score below which a track ends. Default -3: clutter is twenty times as likely.
    pub end_score: f64,
    /// The largest score, so that an object that has gone ends soon. Default 8: three scans that
    /// see its place empty.
    pub max_score: f64,
    /// Share of the scans in which an object is seen. Default 0.8: scatterers fade.
    pub seen_share: f64,
    /// Loss of the score by a scan that sees the place of an object and not the object, beyond that
    /// of one which may be hidden. Default 1.5.
    pub missed_loss: f64,
    /// Scans with a cluster, of the first `birth_scans`, that confirm a track. Default 3.
    pub birth_hits: u32,
    /// The scans in which a track is confirmed, or given up. Default 4.
    pub birth_scans: u32,
    /// Time that a confirmed track is continued without a cluster, s: a car that passes hides
    /// another for about one. Default 1.
    pub coast_s: f64,
}

impl Default for ObjectsConfig {
    fn default() -> Self {
        Self {
            kind: ObjectsKind::None,
            max_range_m: 76.0,
            min_range_m: 8.0,
            contrast: 2.0,
            memory_scans: 20,
            max_gap_s: 2.0,
            standing_share: 0.4,
            own_share: 0.7,
            cluster_along_m: 5.0,
            cluster_across_m: 2.5,
            skirt_weight: 0.5,
            usual_size_m: [4.4, 1.9],
            smallest_size_m: [4.0, 1.7],
            largest_size_m: [18.0, 2.6],
            margin_m: 0.7,
            gate: 13.8,
            edge_sigma_m: 0.3,
            unknown_edge_sigma_m: 0.6,
            acceleration_mps2: 1.5,
            lateral_acceleration_mps2: 1.0,
            turn_rate_radps: 0.7,
            turn_lasts_s: 0.5,
            speed_sigma_mps: 8.0,
            standing_mps: 0.8,
            heading_mps: 1.0,
            alike_mps: 3.0,
            moving_sigmas: 1.5,
            min_returns: 3,
            min_weight: 0.8,
            confirm_score: 3.0,
            end_score: -3.0,
            max_score: 8.0,
            seen_share: 0.8,
            missed_loss: 1.5,
            birth_hits: 3,
            birth_scans: 4,
            coast_s: 1.0,
        }
    }
}

/// A setting that is out of bounds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("objects.{key} is {value}, but must be {bounds}")]
pub struct ObjectsError {
    /// The setting.
    pub key: &'static str,
    /// The value.
    pub value: f64,
    /// Permitted values.
    pub bounds: &'static str,
}

impl ObjectsConfig {
    /// Returns whether objects are tracked.
    pub fn is_on(&self) -> bool {
        self.kind == ObjectsKind::Tracks
    }

    /// Checks the bounds of all settings.
    ///
    /// # Errors
    /// Returns the first setting that is out of bounds.
    pub fn validate(&self) -> Result<(), ObjectsError> {
        let positive = self
            .positive()
            .map(|(key, value)| (key, value, POSITIVE, "0.001 to 100"));
        let all = self
            .shares_and_counts()
            .into_iter()
            .chain(self.sizes_and_scores())
            .chain(positive);
        for (key, value, (low, high), bounds) in all {
            if !(low..=high).contains(&value) {
                return Err(ObjectsError { key, value, bounds });
            }
        }
        Ok(())
    }

    fn shares_and_counts(&self) -> [Setting; 13] {
        let hits = f64::from(self.birth_hits);
        [
            ("max_range_m", self.max_range_m, (5.0, 120.0), "5 to 120"),
            (
                "memory_scans",
                self.memory_scans.into(),
                (4.0, 64.0),
                "4 to 64",
            ),
            ("min_range_m", self.min_range_m, (0.0, 120.0), "0 to 120"),
            ("contrast", self.contrast, (0.0, 100.0), "0 to 100"),
            ("standing_share", self.standing_share, SHARE, "0.01 to 1"),
            ("own_share", self.own_share, SHARE, "0.01 to 1"),
            ("skirt_weight", self.skirt_weight, (0.0, 1.0), "0 to 1"),
            ("seen_share", self.seen_share, (0.01, 0.99), "0.01 to 0.99"),
            ("min_weight", self.min_weight, LARGE, "0 to 1000"),
            (
                "min_returns",
                self.min_returns as f64,
                (1.0, 1000.0),
                "1 to 1000",
            ),
            ("birth_hits", hits, (2.0, 32.0), "2 to 32"),
            (
                "birth_scans",
                self.birth_scans.into(),
                (hits, 32.0),
                "birth_hits to 32",
            ),
            ("coast_s", self.coast_s, (0.0, 30.0), "0 to 30"),
        ]
    }

    fn sizes_and_scores(&self) -> [Setting; 9] {
        let [usual, smallest, largest] =
            [self.usual_size_m, self.smallest_size_m, self.largest_size_m];
        let between = "from smallest_size_m to largest_size_m";
        let size = (0.1, 50.0);
        [
            (
                "smallest_size_m",
                smallest[0].min(smallest[1]),
                size,
                "0.1 to 50",
            ),
            ("usual_size_m", usual[0], (smallest[0], largest[0]), between),
            ("usual_size_m", usual[1], (smallest[1], largest[1]), between),
            (
                "largest_size_m",
                largest[0].max(largest[1]),
                size,
                "0.1 to 50",
            ),
            ("gate", self.gate, (0.1, 1000.0), "0.1 to 1000"),
            ("max_score", self.max_score, LARGE, "0 to 1000"),
            (
                "confirm_score",
                self.confirm_score,
                (0.0, self.max_score),
                "0 to max_score",
            ),
            ("end_score", self.end_score, (-1000.0, 0.0), "-1000 to 0"),
            ("missed_loss", self.missed_loss, LARGE, "0 to 1000"),
        ]
    }

    fn positive(&self) -> [(&'static str, f64); 15] {
        [
            ("max_gap_s", self.max_gap_s),
            ("cluster_along_m", self.cluster_along_m),
            ("cluster_across_m", self.cluster_across_m),
            ("margin_m", self.margin_m),
            ("edge_sigma_m", self.edge_sigma_m),
            ("unknown_edge_sigma_m", self.unknown_edge_sigma_m),
            ("acceleration_mps2", self.acceleration_mps2),
            ("lateral_acceleration_mps2", self.lateral_acceleration_mps2),
            ("turn_rate_radps", self.turn_rate_radps),
            ("turn_lasts_s", self.turn_lasts_s),
            ("speed_sigma_mps", self.speed_sigma_mps),
            ("standing_mps", self.standing_mps),
            ("heading_mps", self.heading_mps),
            ("alike_mps", self.alike_mps),
            ("moving_sigmas", self.moving_sigmas),
        ]
    }
}

/// A key, its value, its least and its largest value, and these in words.
type Setting = (&'static str, f64, (f64, f64), &'static str);

/// Bounds of what is above zero.
const POSITIVE: (f64, f64) = (1e-3, 100.0);
/// Bounds of what may be zero.
const LARGE: (f64, f64) = (0.0, 1000.0);
/// Bounds of a share of scans.
const SHARE: (f64, f64) = (0.01, 1.0);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_within_their_bounds_and_the_first_fault_is_named() {
        assert_eq!(ObjectsConfig::default().validate(), Ok(()));
        for (faulty, key) in [
            (
                ObjectsConfig {
                    memory_scans: 65,
                    ..ObjectsConfig::default()
                },
                "memory_scans",
            ),
            (
                ObjectsConfig {
                    coast_s: f64::NAN,
                    ..ObjectsConfig::default()
                },
                "coast_s",
            ),
            (
                ObjectsConfig {
                    birth_scans: 2,
                    ..ObjectsConfig::default()
                },
                "birth_scans",
            ),
        ] {
            assert_eq!(faulty.validate().map_err(|error| error.key), Err(key));
        }
    }
}
