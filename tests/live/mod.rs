//! Live runs: a radar does not wait.

mod gyro;
mod load;
pub mod radar;
mod radar_faults;
