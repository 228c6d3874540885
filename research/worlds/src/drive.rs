//! The path of the vehicle: the section `[simulation.drive]`.

use std::path::PathBuf;

use gyre_geometry::Pose;
use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::lanes::DrivingSide;
use crate::limits::require_within;
use crate::path::recorded::{self, Excerpt};
use crate::path::{BlockLoop, Path, TownDrive};

/// The kind of a drive.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum DriveKind {
    /// Laps of a rectangular block of houses, without end.
    #[default]
    Block,
    /// A random drive through a town.
    Town,
    /// A recorded trajectory.
    File,
}

/// The path of the vehicle and its speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// `block`, `town` or `file`. Keys of the other kinds have no effect.
    pub kind: DriveKind,
    /// The side of the road on which vehicles drive: `left` or `right`.
    pub keep: DrivingSide,
    /// `block`: length from street centre to street centre along x, metres.
    pub block_length_m: f64,
    /// `block`: width along y, metres.
    pub block_width_m: f64,
    /// `block` and `town`: speed on straights, metres a second; in a town on its fastest streets.
    pub speed_mps: f64,
    /// `block` and `town`: lateral acceleration in bends, metres a second squared, which limits the
    /// speed there. Default: 5 round a block, 2.2 in a town.
    pub lateral_acceleration_mps2: Option<f64>,
    /// `town`: length of the drive, metres.
    pub length_m: f64,
    /// `file`: the trajectory, in any format that [`gyre_datasets::read_trajectory`] knows.
    pub file: Option<PathBuf>,
    /// `file`: start, seconds after the first pose.
    pub from_s: f64,
    /// `file`: maximum duration, seconds. Default: to the end.
    pub for_s: Option<f64>,
    /// `file`: poses a second in a file without times (KITTI's format).
    pub rate_hz: f64,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            kind: DriveKind::Block,
            keep: DrivingSide::Left,
            block_length_m: 40.0,
            block_width_m: 32.0,
            speed_mps: 9.5,
            lateral_acceleration_mps2: None,
            length_m: 1000.0,
            file: None,
            from_s: 0.0,
            for_s: None,
            rate_hz: 4.0,
        }
    }
}

impl DriveConfig {
    /// The drive along a recorded trajectory.
    pub fn along_file(file: PathBuf) -> Self {
        Self {
            kind: DriveKind::File,
            file: Some(file),
            ..Self::default()
        }
    }

    /// A drive like the first experiment of Checchin et al., "Radar scan matching SLAM using the
    /// Fourier-Mellin transform" (2010): 1135 m of campus at 0 to 25 km/h.
    pub fn campus() -> Self {
        Self {
            kind: DriveKind::Town,
            keep: DrivingSide::Right,
            speed_mps: 25.0 / 3.6,
            length_m: 1135.0,
            ..Self::default()
        }
    }

    /// Checks that all values can be driven.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("drive.block_length_m", self.block_length_m, 30.0, 400.0)?;
        require_within("drive.block_width_m", self.block_width_m, 30.0, 400.0)?;
        require_within("drive.speed_mps", self.speed_mps, 0.5, 40.0)?;
        require_within(
            "drive.lateral_acceleration_mps2",
            self.lateral_acceleration_mps2.unwrap_or(1.0),
            0.1,
            20.0,
        )?;
        require_within("drive.length_m", self.length_m, 300.0, 100_000.0)?;
        require_within("drive.from_s", self.from_s, 0.0, 1e6)?;
        require_within("drive.for_s", self.for_s.unwrap_or(1.0), 1.0, 1e6)?;
        require_within("drive.rate_hz", self.rate_hz, 0.1, 100.0)?;
        if self.kind == DriveKind::File && self.file.is_none() {
            let expected = "the path of a trajectory where `drive.kind` is \"file\"".to_owned();
            return Err(SimulatorError::Config {
                key: "drive.file",
                value: "missing".to_owned(),
                expected,
            });
        }
        Ok(())
    }

    /// Builds the path; all its randomness comes from `seed`. The poses of a file are those in the
    /// frame `world` of the file; without one in that of the first pose that is driven.
    ///
    /// # Errors
    /// [`SimulatorError::Trajectory`] if the file cannot be read, [`SimulatorError::Drive`] if no
    /// vehicle can drive along its poses.
    pub fn path(&self, seed: u64, world: Option<Pose>) -> Result<Box<dyn Path>, SimulatorError> {
        let lateral_acceleration_mps2 = |default| self.lateral_acceleration_mps2.unwrap_or(default);
        Ok(match (self.kind, &self.file) {
            (DriveKind::File, Some(file)) => {
                let for_s = self.for_s.unwrap_or(f64::INFINITY);
                Box::new(recorded::read_in(
                    file,
                    Excerpt {
                        from_s: self.from_s,
                        for_s,
                        rate_hz: self.rate_hz,
                    },
                    world,
                )?)
            }
            (DriveKind::Town, _) => Box::new(
                TownDrive {
                    length_m: self.length_m,
                    speed_mps: self.speed_mps,
                    lateral_acceleration_mps2: lateral_acceleration_mps2(2.2),
                    driving_side: self.keep,
                }
                .path(seed),
            ),
            (DriveKind::Block | DriveKind::File, _) => Box::new(BlockLoop::new(
                self.block_length_m,
                self.block_width_m,
                self.speed_mps,
                lateral_acceleration_mps2(5.0),
            )),
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_missing_file_is_named_in_the_error() {
        let none = DriveConfig {
            kind: DriveKind::File,
            ..DriveConfig::default()
        };
        assert!(
            none.validate()
                .unwrap_err()
                .to_string()
                .contains("`drive.file` is missing")
        );
        let missing = DriveConfig::along_file("nowhere/poses.tum".into());
        missing.validate().unwrap();
        let error = missing.path(1, None).err().unwrap().to_string();
        assert!(error.contains("nowhere/poses.tum"), "{error}");
    }

    #[test]
    fn kinds_are_read_from_a_configuration() {
        let config: DriveConfig =
            toml::from_str("kind = \"town\"\nlength_m = 500.0\nkeep = \"right\"").unwrap();
        assert_eq!(
            (config.kind, config.keep),
            (DriveKind::Town, DrivingSide::Right)
        );
        let drive = config.path(1, None).unwrap();
        assert!(
            (30.0..400.0).contains(&drive.duration_s()),
            "{} s",
            drive.duration_s()
        );
        assert_eq!(drive.pose(20.0), config.path(1, None).unwrap().pose(20.0));
        assert_ne!(drive.pose(20.0), config.path(2, None).unwrap().pose(20.0));
        assert!(toml::from_str::<DriveConfig>("kind = \"boat\"").is_err());
    }
}
