//! The options of localisation.

#[derive(Clone, Debug, PartialEq)]
pub struct LocaliserOptions {
    /// Number of places and headings that are searched first for a first fix; if none of them is
    /// accepted, [`Self::candidates`] are.
    pub first_candidates: usize,
    /// Largest number of places and headings that are searched for a first fix.
    pub candidates: usize,
    /// Number of headings for comparing a place.
    pub angles: usize,
    /// Two candidates are of different places if they are farther apart, m.
    pub apart_m: f64,
    /// Largest distance of a scan from the keyframe of its place, along each axis, m.
    pub search_reach_m: f64,
    /// Smallest correlation of a first fix with the map, 0 to 1. It compares a single scan with a
    /// submap of many.
    pub min_correlation: f64,
    /// Smallest difference of the correlations of a first fix and of any other pose that was tried.
    pub min_margin: f64,
    /// Two poses nearer than this, m, and than 5 degrees are the same.
    pub same_m: f64,
    /// Smallest correlation of a tracked scan with the map, 0 to 1.
    pub tracked_correlation: f64,
    /// Largest chi-square (3 degrees of freedom) between a registration and the prediction: 16.27
    /// is passed by 99.9 %.
    pub gate: f64,
    /// Factor of the covariance of a registration with the map over a registration with the scans
    /// just before.
    pub variance_scale: f64,
    /// Distance from the nearest keyframe of the map beyond which there is no fix, m.
    pub reach_m: f64,
    /// Time without a fix after which the localiser is lost, s.
    pub lost_after_s: f64,
}

impl Default for LocaliserOptions {
    fn default() -> Self {
        Self {
            first_candidates: 8,
            candidates: 150,
            angles: 3,
            apart_m: 10.0,
            search_reach_m: 25.0,
            min_correlation: 0.4,
            min_margin: 0.125,
            same_m: 2.0,
            tracked_correlation: 0.35,
            gate: 16.27,
            variance_scale: 2.0,
            reach_m: 15.0,
            lost_after_s: 3.0,
        }
    }
}
