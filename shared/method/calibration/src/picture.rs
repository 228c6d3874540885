//! `calibration.svg`: a place seen twice, before and after.

use std::fmt::Write;

use gyre_geometry::Pose;

use crate::{Calibration, Drive, Track};

/// Side of a panel, px, and its reach, m.
const SIDE: f64 = 560.0;
const REACH_M: f64 = 60.0;
const HEADER: f64 = 56.0;
/// Scans to each side of the two that are drawn with them.
const AROUND: usize = 2;
const MIN_WEIGHT: f32 = 0.3;

pub fn svg(drive: &Drive, calibration: &Calibration) -> String {
    let (earlier, later) = scans(calibration);
    let (width, height) = (2.0 * SIDE + 48.0, SIDE + HEADER + 16.0);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"16\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n\
         <text x=\"16\" y=\"22\" fill=\"#22262c\">Scans around {} (blue) and around {} (orange), by odometry; {:.0} m a side</text>\n",
        drive.sweeps[earlier].number,
        drive.sweeps[later].number,
        2.0 * REACH_M
    );
    let found = match calibration.proposed.is_empty() {
        true => "nothing is proposed: as configured",
        false => "as proposed",
    };
    let panels = [
        ("as configured", &calibration.before),
        (found, &calibration.after),
    ];
    for (k, (name, track)) in panels.into_iter().enumerate() {
        let left = 16.0 + k as f64 * (SIDE + 16.0);
        let base = track.poses[earlier];
        let _ = writeln!(
            text,
            "<text x=\"{left}\" y=\"46\" fill=\"#60666e\">{name}</text>\n<svg x=\"{left}\" y=\"{HEADER}\" width=\"{SIDE}\" height=\"{SIDE}\" viewBox=\"{:.0} {:.0} {:.0} {:.0}\">\
             <rect x=\"-1000\" y=\"-1000\" width=\"2000\" height=\"2000\" fill=\"#f6f7f8\"/>",
            -REACH_M,
            -REACH_M,
            2.0 * REACH_M,
            2.0 * REACH_M
        );
        for (scan, colour) in [(earlier, "#0062b2"), (later, "#d55e00")] {
            let path = points(drive, track, &base, scan);
            let _ = writeln!(
                text,
                "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"0.3\" stroke-linecap=\"round\" stroke-opacity=\"0.5\"/>"
            );
        }
        text.push_str("</svg>\n");
    }
    text.push_str("</svg>\n");
    text
}

/// The revisit with the longest way between, or the two scans of the drive 20 scans apart in its
/// middle.
fn scans(calibration: &Calibration) -> (usize, usize) {
    let longest = calibration
        .revisits
        .iter()
        .max_by_key(|revisit| revisit.later - revisit.earlier);
    let middle = calibration.after.poses.len() / 2;
    longest.map_or((middle.saturating_sub(10), middle + 10), |revisit| {
        (revisit.earlier, revisit.later)
    })
}

fn points(drive: &Drive, track: &Track, base: &Pose, scan: usize) -> String {
    let mut path = String::new();
    let last = track.poses.len() - 1;
    for scan in scan.saturating_sub(AROUND)..=(scan + AROUND).min(last) {
        let (pose, twist) = (base.inv_mul(&track.poses[scan]), &track.twists[scan]);
        for point in drive
            .points(scan, &track.change)
            .iter()
            .filter(|point| point.weight > MIN_WEIGHT)
        {
            let at = pose * point.deskewed(twist);
            if at.x.abs() < REACH_M && at.y.abs() < REACH_M {
                let _ = write!(path, "M{:.2} {:.2}h0", -at.y, -at.x);
            }
        }
    }
    path
}
