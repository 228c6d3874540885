//! The message of a build without `--features full` about a missing feature.

use gyre_stage::StageError;

#[derive(Debug, thiserror::Error)]
#[error(
    "this gyre was built without {0}: build it with `cargo run --release --locked --features full -- ...`, or install its package or container"
)]
pub struct Absent(pub &'static str);

impl From<Absent> for StageError {
    fn from(absent: Absent) -> Self {
        Self::Configuration(absent.to_string())
    }
}
