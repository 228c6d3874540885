//! `objects.csv`, from the log of the follower that tracks the objects.

use std::{fmt::Write, path::Path};

use gyre_configuration::terminal::Failure;
use gyre_journal::objects::LoggedObjects;
use gyre_slam::RecordReader;

use crate::odometry;

const HEADER: &str = "scan,stamp_ns,object,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,moving,age,\
    cov_xx,cov_xy,cov_yy,cov_vxvx,cov_vxvy,cov_vyvy\n";

/// Returns `objects.csv`: a row for each object and scan, in fixed decimals, so that equal objects
/// give equal bytes. For an unfinished run, the objects so far.
pub fn csv(out: &Path) -> Result<String, Failure> {
    let mut logged = RecordReader::<LoggedObjects>::open(out)?;
    let mut rows = HEADER.to_owned();
    for index in 0..logged.len() {
        let scan = logged.read(index)?;
        for it in &scan.objects {
            write!(rows, "{},{},{}", scan.scan, scan.stamp_ns, it.id)?;
            let place = [it.x_m, it.y_m, it.yaw_rad, it.vx_mps, it.vy_mps];
            odometry::add(&mut rows, &place, 4);
            odometry::add(&mut rows, &[it.length_m, it.width_m], 4);
            write!(rows, ",{},{}", it.moving, it.age)?;
            for covariance in [it.position_covariance, it.velocity_covariance] {
                odometry::add(&mut rows, &covariance, 6);
            }
            rows.push('\n');
        }
    }
    Ok(rows)
}
