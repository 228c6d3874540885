//! The map for localising scans.

use std::path::Path;

use gyre_configuration::{Configuration, terminal::Failure};
use gyre_slam::localisation::{Localiser, Map};

use crate::maps::folder;

/// Opens the map in a folder, and plans localisation in it.
pub fn open(path: &Path, configuration: &Configuration) -> Result<Localiser, Failure> {
    folder::settle(path)?;
    let drawn = gyre_slam::mapping::Map::open(path)?;
    let map = Map::open(path)
        .map_err(|error| format!("{} cannot be localised in: {error}", path.display()))?;
    let (path, drawn, kept) = (path.display(), drawn.keyframes(), map.keyframes().len());
    if kept != drawn {
        return Err(format!("{path} was drawn from {drawn} keyframes and keeps {kept}: draw the map again with gyre map").into());
    }
    plan(map, configuration)
}

pub fn plan(map: Map, configuration: &Configuration) -> Result<Localiser, Failure> {
    let odometry = &configuration.odometry;
    let capacity = odometry.points.capacity;
    if capacity == 0 {
        return Err(
            "points.capacity is 0, but scans are localised by their points: it must be 1 or more"
                .into(),
        );
    }
    Ok(Localiser::new(map, &odometry.refinement, capacity)?)
}
