//! The place of a run on the earth, from its results.

use std::path::Path;

use gyre_mapping::Origin;
use gyre_storage as storage;
use gyre_terminal::Failure;
use serde::Deserialize;

use crate::out::SUMMARY;

/// The origin of a run in a summary.
#[derive(Deserialize)]
struct Georeferenced {
    gnss: Option<Placed>,
}

#[derive(Deserialize)]
struct Placed {
    origin: Option<Origin>,
}

/// Returns the place on the earth of the frame of `trajectory_slam.tum` in the results of a run;
/// `None` if GNSS does not determine it.
pub fn georeference(run: &Path) -> Result<Option<Origin>, Failure> {
    let path = run.join(SUMMARY);
    if !path.is_file() {
        return Ok(None);
    }
    let text = storage::read_text(&path, storage::SETTINGS)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let summary: Georeferenced = serde_json::from_str(&text)
        .map_err(|error| format!("{} is no summary of a run: {error}", path.display()))?;
    Ok(summary.gnss.and_then(|gnss| gnss.origin))
}
