//! `fixes.csv`: a row a scan.

use std::fmt::Write;

use gyre_geometry::{covariance, xy_yaw};
use gyre_slam::localisation::{Localisation, Map, Status};

use super::RegisteredScan;

pub const HEADER: &str = "scan,stamp_ns,status,x_m,y_m,yaw_rad,\
    cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,correlation,place\n";

/// Writes the row of a scan to `text`, in fixed decimals, so that equal fixes give equal bytes.
/// Unknown values are empty.
pub fn write_row(scan: &RegisteredScan<'_>, found: &Localisation, map: &Map, text: &mut String) {
    let (number, stamp_ns) = (scan.number, scan.observation.stamp_ns);
    let status = status_name(found.status);
    let _ = write!(text, "{number},{stamp_ns},{status},");
    let Some(fix) = &found.fix else {
        text.push_str(",,,,,,,,,,\n");
        return;
    };
    for value in xy_yaw(&fix.pose.motion) {
        let _ = write!(text, "{value:.6},");
    }
    for value in covariance::pack(&fix.pose.covariance) {
        let _ = write!(text, "{value:.12},");
    }
    let place = map.keyframes()[fix.keyframe].scan;
    let _ = match found.status {
        Status::Predicted | Status::Lost => writeln!(text, ",{place}"),
        Status::Found | Status::Tracked => writeln!(text, "{:.6},{place}", fix.correlation),
    };
}

/// The word for a status.
pub fn status_name(status: Status) -> &'static str {
    match status {
        Status::Lost => "lost",
        Status::Found => "found",
        Status::Tracked => "tracked",
        Status::Predicted => "predicted",
    }
}
