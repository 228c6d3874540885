//! The options of localisation.

use gyre_estimation::places::PlaceOptions;

/// The options of localisation.
#[derive(Clone, Debug, PartialEq)]
pub struct LocaliserOptions {
    /// Recognition and verification of places. The correlation is that of a single scan with a submap of the map.
    pub places: PlaceOptions,
    /// Number of places that are verified for a first fix.
    pub candidates: usize,
    /// Distance along the map's path between them, m.
    pub apart_m: f64,
    /// Two fixes nearer than this, m, and than 5 degrees are the same.
    pub same_m: f64,
    /// Smallest correlation of a tracked scan with the map, 0 to 1.
    pub tracked_correlation: f64,
    /// Largest chi-square (3 degrees of freedom) between a registration and the prediction: 16.27 is passed by 99.9 %.
    pub gate: f64,
    /// Distance from the nearest keyframe of the map beyond which there is no fix, m.
    pub reach_m: f64,
    /// Time without a fix after which the localiser is lost, s.
    pub lost_after_s: f64,
}

impl Default for LocaliserOptions {
    fn default() -> Self {
        Self {
            places: PlaceOptions {
                min_correlation: 0.3,
                ..PlaceOptions::default()
            },
            candidates: 5,
            apart_m: 15.0,
            same_m: 2.0,
            tracked_correlation: 0.45,
            gate: 16.27,
            reach_m: 15.0,
            lost_after_s: 3.0,
        }
    }
}
