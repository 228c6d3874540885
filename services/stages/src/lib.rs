//! The stages of the pipeline, a module for each.

use gyre_contract::Masked;
use gyre_geometry::{SparsePoint, samples::SensorConfigs};
use gyre_stage::Launch;
use gyre_storage::LogError;
use gyre_transport::{RunError, reader::Received};

pub mod estimates;
pub mod followers;
pub mod live_radar;
pub mod masking;
pub mod pose_integration;
pub mod radar_replay;
pub mod refinement;
pub mod search;

/// The error for a file of the run: a process that was killed, and is not gone yet, may have it.
fn unusable(error: LogError) -> RunError {
    match error {
        LogError::Busy(_) => RunError::Transient(format!("cannot open a file of the run: {error}")),
        _ => RunError::input(error),
    }
}

fn sensors(launch: &Launch) -> Result<SensorConfigs, RunError> {
    Ok(SensorConfigs {
        gyro: launch.section("gyro")?,
        wheels: launch.section("wheels")?,
        doppler: launch.section("doppler")?,
    })
}

fn points(scan: &Received<Masked>) -> Result<&[SparsePoint], RunError> {
    let points = scan.header().points(scan.values());
    points.ok_or_else(|| scan.malformed("its points do not fit its header"))
}
