//! `objects.csv`, from the log of the follower that tracks the objects.

use std::fmt::{self, Write};
use std::path::Path;

use gyre_journal::objects::LoggedObjects;
use gyre_objects::Object;
use gyre_slam::RecordReader;
use gyre_terminal::Failure;

/// The header line of `objects.csv`.
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
    let [length_m, width_m] = [object.length_m, object.width_m];
    for value in [
        at.x,
        at.y,
        object.yaw_rad,
        velocity.x,
        velocity.y,
        length_m,
        width_m,
    ] {
        write!(rows, ",{value:.4}")?;
    }
    write!(rows, ",{},{}", u8::from(object.moving), object.age)?;
    let (position, velocity) = (object.position_covariance, object.velocity_covariance);
    for value in [
        position.m11,
        position.m12,
        position.m22,
        velocity.m11,
        velocity.m12,
        velocity.m22,
    ] {
        write!(rows, ",{value:.6}")?;
    }
    writeln!(rows)
}
