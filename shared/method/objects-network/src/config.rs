//! The settings of the tracking.

use gyre_objects::ObjectsConfig;

/// The tracking of moving objects by a network.
///
/// The constants are those of road vehicles, and of radars that turn four times a second; those of
/// the score were chosen on simulated drives.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkConfig {
    /// The motion of objects: of these settings the accelerations, turn rates, speeds of what
    /// stands and of a heading, and the largest gap.
    pub motion: ObjectsConfig,
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
    /// Time for which an object that is not seen keeps its identity, s. Default 8: then it may be
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
    /// Standard deviations by which the speed must exceed `motion.standing_mps` for an object to be
    /// moving. Default 1.
    pub moving_sigmas: f64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            motion: ObjectsConfig::default(),
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
            moving_sigmas: 1.0,
        }
    }
}
