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
    /// Default 70.
    pub max_range_m: f64,
    /// Minimum range of a new object, m: nearer, the vehicle sees itself. Default 8.
    pub min_range_m: f64,
    /// Weight of a return over the mean weight of the range cells around it from which on it
    /// stands out: what does not is taken for the reverberation of a strong echo. Default 2.
    pub contrast: f64,
    /// Scans that are remembered, at most 64. A vehicle of 4.5 m at walking pace leaves its place
    /// within them. Default 20: five seconds.
    pub memory_scans: u32,
    /// Expected share of the scans with a return at a place, from which on it belongs to what
    /// stands; what has never been in view has 0.5. Default 0.4: three scans that saw a place free
    /// make it 0.08, and a vehicle that has just passed 0.1 to 0.3.
    pub standing_share: f64,
    /// Standard deviation of a cluster's range, m: three range cells of 0.17 m, and scatterers that
    /// come and go. Default 0.5.
    pub range_sigma_m: f64,
    /// Standard deviation of its bearing, degrees: half of an azimuth of 0.9 and of the noise in
    /// which azimuth of a beam is the strongest. Default 0.6.
    pub bearing_sigma_deg: f64,
    /// Standard deviation of an object's acceleration along its way, m/s²: vehicles brake and
    /// accelerate with 1 to 3. It is up to four times that while the object is not where it is
    /// predicted, as is the next. Default 1.5.
    pub acceleration_mps2: f64,
    /// Standard deviation of its acceleration across its way, m/s²: bends are driven with up to
    /// 2 to 3. Default 1.5.
    pub lateral_acceleration_mps2: f64,
    /// Standard deviation of a new object's velocity, each component, m/s: two of it are 60 km/h.
    /// Default 8.
    pub speed_sigma_mps: f64,
    /// Speed up to which an object counts as standing, m/s: the odometry's own error, and what
    /// wind moves. Default 0.8.
    pub standing_mps: f64,
    /// Standard deviations by which the speed must exceed `standing_mps` for an object to be
    /// moving. Default 1.5: the score tells what stands as well.
    pub moving_sigmas: f64,
    /// Returns of a cluster that begins a track, at least. Default 3.
    pub min_returns: usize,
    /// Sum of their weights, at least; that of a return 30 dB above the threshold of the masks is
    /// 1. Default 0.8.
    pub min_weight: f64,
    /// The score from which on a track is an object: the logarithm of the likelihood of an object
    /// over that of clutter. More finds less, and less that is false. Default 2.
    pub confirm_score: f64,
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
            max_range_m: 70.0,
            min_range_m: 8.0,
            contrast: 2.0,
            memory_scans: 20,
            standing_share: 0.4,
            range_sigma_m: 0.5,
            bearing_sigma_deg: 0.6,
            acceleration_mps2: 1.5,
            lateral_acceleration_mps2: 1.5,
            speed_sigma_mps: 8.0,
            standing_mps: 0.8,
            moving_sigmas: 1.5,
            min_returns: 3,
            min_weight: 0.8,
            confirm_score: 2.0,
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
        let setting = |key, value: f64, (low, high): (f64, f64), bounds| match value >= low
            && value <= high
        {
            true => Ok(()),
            false => Err(ObjectsError { key, value, bounds }),
        };
        let sigma = (1e-3, 100.0);
        setting("max_range_m", self.max_range_m, (5.0, 120.0), "5 to 120")?;
        setting(
            "memory_scans",
            self.memory_scans.into(),
            (4.0, 64.0),
            "4 to 64",
        )?;
        setting("min_range_m", self.min_range_m, (0.0, 120.0), "0 to 120")?;
        setting("contrast", self.contrast, (0.0, 100.0), "0 to 100")?;
        setting(
            "standing_share",
            self.standing_share,
            (0.01, 1.0),
            "0.01 to 1",
        )?;
        for (key, value) in [
            ("range_sigma_m", self.range_sigma_m),
            ("bearing_sigma_deg", self.bearing_sigma_deg),
            ("acceleration_mps2", self.acceleration_mps2),
            ("lateral_acceleration_mps2", self.lateral_acceleration_mps2),
            ("speed_sigma_mps", self.speed_sigma_mps),
            ("standing_mps", self.standing_mps),
            ("moving_sigmas", self.moving_sigmas),
        ] {
            setting(key, value, sigma, "0.001 to 100")?;
        }
        let returns = self.min_returns as f64;
        setting("min_returns", returns, (1.0, 1000.0), "1 to 1000")?;
        setting("min_weight", self.min_weight, (0.0, 1000.0), "0 to 1000")?;
        setting("confirm_score", self.confirm_score, (0.0, 8.0), "0 to 8")?;
        setting("birth_hits", self.birth_hits.into(), (2.0, 32.0), "2 to 32")?;
        let scans = f64::from(self.birth_scans);
        let hits = f64::from(self.birth_hits);
        setting("birth_scans", scans, (hits, 32.0), "birth_hits to 32")?;
        setting("coast_s", self.coast_s, (0.0, 30.0), "0 to 30")
    }
}

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
