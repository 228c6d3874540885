//! Results of the searches and of the refinement as the wire types of [`gyre_contract`].

use gyre_contract::{
    MotionEstimate, RefinementRecord, RotationEstimate, WitnessRecord, initial_guess, outcome,
    verdict,
};
use gyre_geometry::{covariance, xy_yaw};
use gyre_matching::{
    InitialGuess, MotionMatch, Outcome, Refined, RotationMatch, Verdict, Witnessed,
};

pub fn rotation(found: &RotationMatch) -> RotationEstimate {
    let runner_up = found.runner_up;
    RotationEstimate {
        angle_rad: found.angle_rad,
        variance_rad2: found.variance_rad2,
        score: found.score,
        runner_up_rad: runner_up.map_or(0.0, |runner_up| runner_up.angle_rad),
        runner_up_score: runner_up.map_or(0.0, |runner_up| runner_up.score),
    }
}

/// Converts without the runner-up, which no search needs.
pub fn rotation_match(rotation: &RotationEstimate) -> RotationMatch {
    RotationMatch {
        angle_rad: rotation.angle_rad,
        variance_rad2: rotation.variance_rad2,
        score: rotation.score,
        runner_up: None,
    }
}

pub fn searched(
    found: &MotionMatch,
    rotation: RotationEstimate,
    interval_ns: i64,
) -> MotionEstimate {
    MotionEstimate {
        x_m: found.x_m,
        y_m: found.y_m,
        yaw_rad: found.yaw_rad,
        covariance: covariance::pack(&found.covariance),
        drift_share: 1.0,
        scale_sigma: 0.0,
        interval_ns,
        score: found.score,
        runner_up_score: found.runner_up.map_or(0.0, |runner_up| runner_up.score),
        rotation,
        searched: [found.x_m, found.y_m, found.yaw_rad],
        refinement: RefinementRecord::default(),
    }
}

/// Returns the motion after refinement. The searched motion stays beside it.
pub fn refined(searched: &MotionEstimate, refined: &Refined) -> MotionEstimate {
    let motion = &refined.motion;
    let [x_m, y_m, yaw_rad] = xy_yaw(&motion.motion);
    MotionEstimate {
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&motion.covariance),
        drift_share: motion.drift_share,
        scale_sigma: motion.scale_sigma,
        refinement: record(refined),
        ..*searched
    }
}

fn record(refined: &Refined) -> RefinementRecord {
    RefinementRecord {
        outcome: match refined.outcome {
            Outcome::Refined => outcome::REFINED,
            Outcome::Weak => outcome::WEAK,
            Outcome::Predicted => outcome::PREDICTED,
        },
        initial_guess: match refined.guess {
            InitialGuess::Prediction => initial_guess::PREDICTION,
            InitialGuess::Search => initial_guess::SEARCH,
            InitialGuess::YawOffset => initial_guess::YAW_OFFSET,
            InitialGuess::AlongWalls => initial_guess::ALONG_WALLS,
        },
        overlap: refined.overlap,
        support: refined.support,
        stationary: refined.stationary.into(),
        witnesses: refined.witnesses.map(witness),
    }
}

fn witness(witnessed: Option<Witnessed>) -> WitnessRecord {
    let Some(of) = witnessed else {
        return WitnessRecord::default();
    };
    WitnessRecord {
        verdict: match of.verdict {
            Verdict::Agrees => verdict::USED,
            Verdict::Doubted => verdict::DOUBTED,
            Verdict::Refused => verdict::REFUSED,
        },
        measured: of.measured,
        registered: of.registered,
        scale: of.scale,
        scale_sigma: of.scale_sigma,
        bias: of.bias,
        bias_sigma: of.bias_sigma,
    }
}
