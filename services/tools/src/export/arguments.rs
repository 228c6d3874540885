//! The arguments of `gyre export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use gyre_ros2_messages::{Vehicle, frames::Frames};

#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The source: the folder of a run's results, a recording of a run, NAME.mcap, or a dataset.
    pub source: PathBuf,
    /// The bag to write: a folder, or one file if its name ends in .mcap.
    #[arg(long, value_name = "BAG", required_unless_present = "format")]
    pub mcap: Option<PathBuf>,
    /// Write the scans of a run in the form of its dataset instead, with each azimuth that was lost
    /// put back where the run has found it missing.
    #[arg(long, value_parser = ["radiate"], requires = "out", conflicts_with_all = ["mcap", "scans", "frames", "mounting"])]
    pub format: Option<String>,
    /// The folder to write such a dataset to: a new or an empty one.
    #[arg(long, value_name = "FOLDER", requires = "format")]
    pub out: Option<PathBuf>,
    /// The form of the scans: as whole turns, azimuth by azimuth as the radar sends them, both, or
    /// not.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "b-scan")]
    pub scans: Vec<ScanForm>,
    #[command(flatten)]
    pub frames: FrameArguments,
}

#[derive(Debug, Args)]
pub struct FrameArguments {
    /// Names of the frames: of the map, of odometry, of the vehicle and of the radar.
    #[arg(
        long,
        value_name = "MAP,ODOM,BASE,RADAR",
        default_value = "map,odom,base_link,radar"
    )]
    pub frames: Frames,
    /// Where the radar is on the vehicle: m forward, m to the left, degrees counter-clockwise.
    #[arg(
        long,
        value_name = "X,Y,YAW",
        default_value = "0,0,0",
        allow_hyphen_values = true
    )]
    pub mounting: String,
}

impl FrameArguments {
    pub fn vehicle(&self) -> Result<Vehicle, String> {
        Ok(Vehicle {
            frames: self.frames.clone(),
            mounting: self.mounting.parse()?,
        })
    }
}

/// The form of the scans in the bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScanForm {
    /// A message a turn: navtech_msgs/msg/RadarBScanMsg.
    BScan,
    /// A message an azimuth: navtech_msgs/msg/RadarFftDataMsg.
    Fft,
    /// No scans.
    None,
}
