//! The settings of the tracking.

use serde::Deserialize;

/// The tracking of moving objects by a network.
///
/// The constants are those of road vehicles, and of radars that turn four times a second; those of
/// the score were chosen on simulated drives.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkConfig {
    /// Time between two scans beyond which all tracks end, s. Default 2: by then a car at walking
    /// pace is elsewhere.
    pub max_gap_s: f64,
    /// Likelihood, by the network, from which on a place counts as one of a vehicle that moves.
    /// Default 0.1: what is less likely keeps no track alive.
    pub least_likely: f64,
    /// Likelihood at which the network is as often wrong as right. Default 0.35: it was trained to
    /// miss rather than to invent.
    pub even_likely: f64,
    /// The score from which on a track is an object: the sum of the logarithms of how much likelier
    /// an object is than none. More finds less, and less that is false. Default 2.
    pub confirm_score: f64,
    /// The score from which on an object that a scan shows is reported. Default 0.
    pub keep_score: f64,
    /// The score below which a track ends. Default -2.
    pub end_score: f64,
    /// The largest score, so that an object that has gone ends soon. Default 4.
    pub max_score: f64,
    /// Loss of the score by a scan that does not show the object. Default 1.
    pub missed_loss: f64,
    /// Scans that show a track before it is an object. Default 2.
    pub birth_hits: u32,
    /// Time that a track is continued without being seen, s: a car that passes hides another for
    /// about one. Default 1.
    pub coast_s: f64,
    /// Time for which an object that is not seen keeps its identity, s. Default 5: then it may be
    /// anywhere.
    pub lost_s: f64,
    /// The same of one that had stopped, s. Default 60: a red light.
    pub stopped_s: f64,
    /// Speed below which an object that is lost has stopped, m/s. Default 2.
    pub stopping_mps: f64,
    /// Squared Mahalanobis distance, by place and velocity, between what a scan shows and a
    /// prediction, up to which the two can be one object. Default 30: more than its own noise, so
    /// that one that brakes hard or turns off is within it.
    pub gate: f64,
    /// Factor of the standard deviation that the network gives of a place. Default 1.
    pub place_sigmas: f64,
    /// Factor of the standard deviation that it gives of a velocity: five of six scans that it sees
    /// are those that it saw before, and so is most of the error. Default 2.
    pub velocity_sigmas: f64,
    /// Standard deviation of the heading that the network gives, rad. Default 0.2.
    pub heading_sigma_rad: f64,
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
    /// Speed up to which an object counts as standing, m/s: the odometry's own error, and what
    /// wind moves. Default 0.8.
    pub standing_mps: f64,
    /// Speed above which its direction is the heading, m/s. Default 1: below, noise turns it.
    pub heading_mps: f64,
    /// Standard deviations by which the speed must exceed `standing_mps` for an object to be
    /// moving. Default 1.
    pub moving_sigmas: f64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            max_gap_s: 2.0,
            least_likely: 0.1,
            even_likely: 0.35,
            confirm_score: 2.0,
            keep_score: 0.0,
            end_score: -2.0,
            max_score: 4.0,
            missed_loss: 1.0,
            birth_hits: 2,
            coast_s: 1.0,
            lost_s: 8.0,
            stopped_s: 60.0,
            stopping_mps: 2.0,
            gate: 30.0,
            place_sigmas: 1.0,
            velocity_sigmas: 2.0,
            heading_sigma_rad: 0.2,
            acceleration_mps2: 1.5,
            lateral_acceleration_mps2: 1.0,
            turn_rate_radps: 0.7,
            turn_lasts_s: 0.5,
            standing_mps: 0.8,
            heading_mps: 1.0,
            moving_sigmas: 1.0,
        }
    }
}
