//! The map for localising scans.

use std::path::Path;

use gyre_configuration::Configuration;
use gyre_slam::localisation::{Localiser, Map};
use gyre_terminal::Failure;

use crate::maps::folder;

/// Opens the map in a folder, and plans localisation in it.
pub fn open(path: &Path, configuration: &Configuration) -> Result<Localiser, Failure> {
    folder::settle(path)?;
    let drawn = gyre_mapping::Map::open(path)?;
    let map = Map::open(path)
        .map_err(|error| format!("{} cannot be localised in: {error}", path.display()))?;
    if map.keyframes().len() != drawn.keyframes() {
        return Err(format!(
            "{} was drawn from {} keyframes and keeps {}: draw the map again with gyre map",
            path.display(),
            drawn.keyframes(),
            map.keyframes().len()
        )
        .into());
    }
    plan(map, configuration)
}

/// Plans localisation in a map.
pub fn plan(map: Map, configuration: &Configuration) -> Result<Localiser, Failure> {
    let odometry = &configuration.odometry;
    if odometry.points.capacity == 0 {
        return Err(
            "points.capacity is 0, but scans are localised by their points: it must be 1 or more"
                .into(),
        );
    }
    let capacity = odometry.points.capacity;
    Ok(Localiser::new(map, &odometry.refinement, capacity)?)
}
