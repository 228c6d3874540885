//! The place of a run on the earth, from its results.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_slam::mapping::Origin;
use gyre_storage as storage;
use serde_json::Value;

use crate::out::SUMMARY;

/// Returns the place on the earth of the frame of `trajectory_slam.tum` in the results of a run;
/// `None` if GNSS does not determine it.
pub fn georeference(run: &Path) -> Result<Option<Origin>, Failure> {
    let path = run.join(SUMMARY);
    if !path.is_file() {
        return Ok(None);
    }
    let text = storage::read_text(&path, storage::SETTINGS)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let origin = serde_json::from_str(&text).and_then(|summary: Value| {
        let origin = summary.pointer("/gnss/origin").cloned();
        serde_json::from_value(origin.unwrap_or_default())
    });
    let no_summary = |error| format!("{} is no summary of a run: {error}", path.display());
    Ok(origin.map_err(no_summary)?)
}
