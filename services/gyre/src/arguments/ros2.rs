//! The arguments of `gyre ros2`.

use clap::Args;
use gyre_tools::{export::FrameArguments, operate::RunChoice};

#[derive(Debug, Args)]
pub struct Ros2Arguments {
    #[command(flatten)]
    pub run: RunChoice,
    /// The domain of ROS 2. Default: ROS_DOMAIN_ID, or 0.
    #[arg(long, value_name = "NUMBER")]
    pub domain: Option<u16>,
    /// Use only the network on which this machine has this address: 127.0.0.1 for this computer
    /// alone. Default: all networks, or as in ROS_LOCALHOST_ONLY and ROS_AUTOMATIC_DISCOVERY_RANGE.
    #[arg(long, value_name = "ADDRESS")]
    pub interface: Option<String>,
    /// The namespace of the topics odom, map, objects and object_markers.
    #[arg(long, value_name = "NAME", default_value = "/")]
    pub namespace: String,
    #[command(flatten)]
    pub frames: FrameArguments,
    /// Publish no transforms of odometry and map, where another program does, such as
    /// robot_localization. The radar's transform stays.
    #[arg(long)]
    pub no_tf: bool,
    /// Publish no map, which takes a tenth of a processor at most.
    #[arg(long)]
    pub no_map: bool,
    /// Wait for a run that has not started yet.
    #[arg(long)]
    pub wait: bool,
}
