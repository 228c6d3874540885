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
        for object in &scan.objects {
            let (at, velocity) = (object.position, object.velocity);
            let (length_m, width_m) = (object.length_m, object.width_m);
            write!(rows, "{},{},{}", scan.scan, scan.stamp_ns, object.id)?;
            let place = [at.x, at.y, object.yaw_rad, velocity.x, velocity.y];
            odometry::add(&mut rows, &place, 4);
            odometry::add(&mut rows, &[length_m, width_m], 4);
            write!(rows, ",{},{}", u8::from(object.moving), object.age)?;
            for covariance in [object.position_covariance, object.velocity_covariance] {
                let packed = [covariance.m11, covariance.m12, covariance.m22];
                odometry::add(&mut rows, &packed, 6);
            }
            rows.push('\n');
        }
    }
    Ok(rows)
}
