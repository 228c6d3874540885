//! Live runs: a radar does not wait.

pub mod gnss;
pub mod gyro;
mod load;
pub mod radar;
mod radar_faults;
