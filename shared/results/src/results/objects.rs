//! `objects.csv`, from the log of the follower that tracks the objects.

use std::{
    fmt::{self, Write},
    path::Path,
};

use gyre_configuration::terminal::Failure;
use gyre_journal::objects::LoggedObjects;
use gyre_objects::Object;
use gyre_slam::RecordReader;

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
            write!(rows, "{},{},", scan.scan, scan.stamp_ns)?;
            write_object(&mut rows, object)?;
        }
    }
    Ok(rows)
}

fn write_object(rows: &mut String, object: &Object) -> fmt::Result {
    write!(rows, "{}", object.id)?;
    let (at, velocity) = (object.position, object.velocity);
    let size = [object.length_m, object.width_m];
    let place = [at.x, at.y, object.yaw_rad, velocity.x, velocity.y];
    for value in place.into_iter().chain(size) {
        write!(rows, ",{value:.4}")?;
    }
    write!(rows, ",{},{}", u8::from(object.moving), object.age)?;
    for covariance in [object.position_covariance, object.velocity_covariance] {
        let (xx, xy, yy) = (covariance.m11, covariance.m12, covariance.m22);
        write!(rows, ",{xx:.6},{xy:.6},{yy:.6}")?;
    }
    writeln!(rows)
}
