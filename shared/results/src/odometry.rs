//! `odometry.csv`, from the journal.

mod read;

use std::fmt::Write;

use crate::evaluation::TimedMotion;
use gyre_contract::{PoseHeader, flag, initial_guess, outcome};

pub use read::read;

pub const HEADER: &str = "seq,scan,previous_scan,stamp_ns,interval_ns,x_m,y_m,yaw_rad,\
    cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,score,runner_up_score,\
    rotation_rad,rotation_variance_rad2,rotation_score,rotation_runner_up_rad,rotation_runner_up_score,\
    searched_x_m,searched_y_m,searched_yaw_rad,outcome,hypothesis,overlap,support,stationary,drift_share,scale_sigma\n";

/// Writes the row of a motion to `text`, in fixed decimals, so that equal motions give equal bytes.
/// The start of the chain has no row.
pub fn write_row(pose: &PoseHeader, text: &mut String) {
    if pose.item.is(flag::BREAK) {
        return;
    }
    let (item, motion, rotation) = (&pose.item, &pose.motion, &pose.motion.rotation);
    let _ = write!(text, "{},{},{}", item.seq, item.scan, item.previous_scan);
    let _ = write!(text, ",{},{}", item.stamp_ns, motion.interval_ns);
    add(text, &[motion.x_m, motion.y_m, motion.yaw_rad], 9);
    add(text, &motion.covariance, 12);
    add(text, &[motion.score, motion.runner_up_score], 9);
    add(text, &[rotation.angle_rad], 9);
    add(text, &[rotation.variance_rad2], 12);
    add(text, &[rotation.score, rotation.runner_up_rad], 9);
    add(text, &[rotation.runner_up_score], 9);
    add(text, &motion.searched, 9);
    let refinement = &motion.refinement;
    let outcome = outcome::name(refinement.outcome);
    let guess = initial_guess::name(refinement.initial_guess);
    let _ = write!(text, ",{outcome},{guess}");
    add(text, &[refinement.overlap, refinement.support], 9);
    let _ = write!(text, ",{}", u8::from(refinement.is_stationary()));
    add(text, &[motion.drift_share, motion.scale_sigma], 9);
    text.push('\n');
}

/// Writes values with so many decimals, a comma before each.
pub(crate) fn add(text: &mut String, values: &[f64], decimals: usize) {
    for value in values {
        let _ = write!(text, ",{value:.decimals$}");
    }
}

/// Returns the motion of a pose with its times and covariance; `None` for the start of the chain.
pub fn motion(pose: &PoseHeader) -> Option<TimedMotion> {
    let to_ns = pose.item.stamp_ns;
    let motion = TimedMotion {
        from_ns: to_ns.saturating_sub(pose.motion.interval_ns),
        to_ns,
        estimate: pose.motion.motion(),
    };
    (!pose.item.is(flag::BREAK)).then_some(motion)
}
