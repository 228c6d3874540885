//! Options of place recognition.

use serde::{Deserialize, Serialize};

/// Options of place recognition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlaceOptions {
    /// Distance from the last keyframe that makes a scan a keyframe, m.
    pub keyframe_distance_m: f64,
    /// Rotation from the last keyframe that makes a scan a keyframe, degrees.
    pub keyframe_angle_deg: f64,
    /// Length of the path to each side of a keyframe whose keyframes make its submap, m.
    pub submap_reach_m: f64,
    /// Largest translation between two places that are verified, along each axis, m.
    pub reach_m: f64,
    /// Smallest correlation of a loop that is accepted, 0 to 1.
    pub min_correlation: f64,
    /// Smallest difference of the correlations of an accepted loop and of any other motion between
    /// the two places.
    pub min_margin: f64,
}

/// An option that is out of its bounds.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{option} = {actual}: expected {expected}")]
pub struct PlaceOptionError {
    pub option: &'static str,
    pub actual: f64,
    pub expected: &'static str,
}

impl Default for PlaceOptions {
    fn default() -> Self {
        Self {
            keyframe_distance_m: 2.0,
            keyframe_angle_deg: 15.0,
            submap_reach_m: 10.0,
            reach_m: 25.0,
            min_correlation: 0.65,
            min_margin: 0.1,
        }
    }
}

impl PlaceOptions {
    pub fn validate(&self) -> Result<(), PlaceOptionError> {
        let check = |fits: bool, option, actual, expected| match fits {
            true => Ok(()),
            false => Err(PlaceOptionError {
                option,
                actual,
                expected,
            }),
        };
        let distance = self.keyframe_distance_m;
        check(
            (0.1..=100.0).contains(&distance),
            "keyframe_distance_m",
            distance,
            "0.1 to 100 m",
        )?;
        let angle = self.keyframe_angle_deg;
        check(
            (1.0..=180.0).contains(&angle),
            "keyframe_angle_deg",
            angle,
            "1 to 180 degrees",
        )?;
        let submap = self.submap_reach_m;
        check(
            (0.0..=50.0).contains(&submap),
            "submap_reach_m",
            submap,
            "0 to 50 m",
        )?;
        let reach = self.reach_m;
        check((1.0..=80.0).contains(&reach), "reach_m", reach, "1 to 80 m")?;
        let share = 0.0..=1.0;
        let (correlation, margin) = (self.min_correlation, self.min_margin);
        check(
            share.contains(&correlation),
            "min_correlation",
            correlation,
            "0 to 1",
        )?;
        check(share.contains(&margin), "min_margin", margin, "0 to 1")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_out_of_its_bounds_names_itself_and_the_bounds() {
        assert_eq!(PlaceOptions::default().validate(), Ok(()));
        let options = PlaceOptions {
            min_margin: f64::NAN,
            ..PlaceOptions::default()
        };
        let error = options.validate().map_err(|error| error.to_string());
        assert_eq!(error, Err("min_margin = NaN: expected 0 to 1".to_owned()));
    }
}
