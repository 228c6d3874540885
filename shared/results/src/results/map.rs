//! `map.png`: the keyframes at their corrected poses, with the trajectory and its loops.

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_geometry::Pose;
use gyre_slam::{
    Keyframe, RecordReader,
    mapping::{Drawing, MapError, MapOptions, legible},
};

use super::Slam;
use crate::out::Out;

/// Returns the picture as a PNG file; `None`, with a note, where the drive is too long for one.
///
/// Data that does not fit into memory is stored in an unnamed file in `out`.
pub fn map_png(
    configuration: &Configuration,
    out: &Out,
    slam: &Slam,
    trajectory: &[Pose],
) -> Result<Option<Vec<u8>>, Failure> {
    let options = legible(map_options(configuration), slam.poses());
    let png = match Drawing::new(&options, out.path()) {
        Ok(mut drawing) => {
            let mut keyframes = RecordReader::<Keyframe>::open(out.path())?;
            for (index, pose) in slam.poses().iter().enumerate() {
                drawing.draw(&keyframes.read(index)?, pose)?;
            }
            drawing.png(trajectory, &slam.loops())
        }
        Err(error) => Err(error),
    };
    match png {
        Err(reason @ (MapError::Option(_) | MapError::TooLarge { .. })) => {
            print::note(format_args!("no map.png: {reason}"));
            Ok(None)
        }
        png => Ok(Some(png?)),
    }
}

/// Returns the options of the map of a run: keyframes see as far as the run has extracted points.
pub fn map_options(configuration: &Configuration) -> MapOptions {
    let points = &configuration.odometry.points;
    MapOptions {
        near_m: points.min_range_m.into(),
        reach_m: points.max_range_m.into(),
        ..MapOptions::default()
    }
}
