//! The true road users beside a dataset of any format: `objects.csv`.

use std::fmt::Write as _;

use gyre_geometry::xy_yaw;

use crate::simulator::Simulator;
use crate::traffic::RoadUser;

/// The file beside the scans.
pub(crate) const FILE: &str = "objects.csv";
/// The first row of the file. Poses and velocities are in the world of `ground_truth.tum`.
const HEADER: &str =
    "scan,stamp_ns,object,kind,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,visible,counts";

/// `objects.csv` as bytes: the road users within 100 m at the time of each scan.
pub(crate) fn csv(simulator: &Simulator, stamps_ns: impl Iterator<Item = i64>) -> Vec<u8> {
    let mut text = format!("{HEADER}\n");
    for (scan, stamp_ns) in stamps_ns.enumerate() {
        for user in simulator.road_users_at(scan, stamp_ns) {
            write_row(&mut text, scan, stamp_ns, &user);
        }
    }
    text.into_bytes()
}

fn write_row(text: &mut String, scan: usize, stamp_ns: i64, user: &RoadUser) {
    let [x, y, yaw] = xy_yaw(&user.pose);
    let (velocity, [length, width]) = (user.velocity, user.size_m);
    // Writing to memory cannot fail.
    let _ = write!(
        text,
        "{scan},{stamp_ns},{},{},{x:.4},{y:.4},{yaw:.6},",
        user.object, user.kind
    );
    let _ = write!(
        text,
        "{:.4},{:.4},{length:.2},{width:.2},",
        velocity.x, velocity.y
    );
    let _ = writeln!(text, "{:.4},{:.1}", user.visible, user.counts);
}
