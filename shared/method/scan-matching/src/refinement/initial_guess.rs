//! The initial guesses of alignments.

use gyre_geometry::Pose;

/// Yaw offsets from the prediction, tried if no other initial guess gives a plausible match.
const YAW_OFFSETS_RAD: [f64; 4] = [-0.1, 0.1, -0.2, 0.2];

/// The initial guess that an alignment started from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialGuess {
    Prediction,
    /// The motion that the search found; along walls also the mean of that and the prediction.
    Search,
    /// The prediction with a yaw offset, tried if nothing else gave a plausible match.
    YawOffset,
    /// The prediction, whose place along walls without structure stays: the radar does not see how
    /// far the vehicle has driven. The wheels or the motions before determine it.
    AlongWalls,
}

/// The prediction, the search's motion, and the prediction from the scan before in case the last
/// match was wrong.
pub(super) fn initial_guesses(predicted: [Pose; 2], searched: Pose) -> [(InitialGuess, Pose); 3] {
    let [from_last, from_second_last] = predicted;
    [
        (InitialGuess::Prediction, from_last),
        (InitialGuess::Search, searched),
        (InitialGuess::Prediction, from_second_last),
    ]
}

pub(super) fn yaw_offsets(predicted: Pose) -> [(InitialGuess, Pose); 4] {
    YAW_OFFSETS_RAD.map(|offset| (InitialGuess::YawOffset, predicted * Pose::rotation(offset)))
}
