//! `poses.csv`, from the journal.

use std::fmt::Write;

use gyre_contract::PoseHeader;

use crate::odometry;

pub const HEADER: &str =
    "scan,stamp_ns,x_m,y_m,yaw_rad,cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw\n";

/// Writes the row of a pose to `text`, in fixed decimals, so that equal poses give equal bytes.
pub fn write_row(pose: &PoseHeader, text: &mut String) {
    let _ = write!(text, "{},{}", pose.item.scan, pose.item.stamp_ns);
    odometry::add(text, &[pose.x_m, pose.y_m, pose.yaw_rad], 9);
    odometry::add(text, &pose.covariance, 12);
    text.push('\n');
}
