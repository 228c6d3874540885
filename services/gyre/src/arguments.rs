//! The arguments that several commands share, and the arguments of optional commands.

use std::{io::IsTerminal, path::PathBuf, time::Duration};

use clap::{Args, Subcommand};
use gyre_configuration::terminal::{
    Failure,
    inputs::{Given, Inputs},
    seconds,
};
use gyre_contract::run::Rate;
use gyre_results::Form;
use gyre_tools::{export::FrameArguments, operate::RunChoice};

#[derive(Default, Debug, Args)]
pub struct RunArguments {
    #[command(flatten)]
    pub inputs: Inputs,
    /// Play a recording from this topic on, without the stages before it: masked, rotation, motion
    /// or refined (source.from).
    #[arg(long, value_name = "TOPIC")]
    pub from: Option<String>,
    /// The topic of ROS 2 on which Navtech's driver publishes azimuths, as in /radar_data/fft_data:
    /// run live (source.kind, source.topic, run.mode).
    #[arg(long, value_name = "TOPIC")]
    pub ros2: Option<String>,
    /// The constants of the radar, of `gyre calibrate`, which override the configuration.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    #[command(flatten)]
    pub options: RunOptions,
}

#[derive(Default, Debug, Args)]
pub struct RunOptions {
    /// The folder of the results. Default: `out/NAME`, NAME being the configuration's, or without
    /// one the dataset's.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Pace of the source: realtime, max, or a factor (run.rate).
    #[arg(long)]
    pub rate: Option<Rate>,
    /// Record the run to this file, NAME.mcap (record.file).
    #[arg(long, value_name = "FILE", value_parser = crate::record::recording)]
    pub record: Option<PathBuf>,
    /// Print all figures at the end, as where the output is no terminal.
    #[arg(short, long)]
    pub verbose: bool,
    /// Print the figures as JSON, as in summary.json.
    #[arg(long, conflicts_with = "verbose")]
    pub json: bool,
    /// Start from the first scan: discard an unfinished run in --out, replace the results of
    /// another or of a live run.
    #[arg(long)]
    pub fresh: bool,
}

impl RunOptions {
    pub fn form(&self) -> Form {
        match (self.json, self.verbose || !std::io::stdout().is_terminal()) {
            (true, _) => Form::Json,
            (false, true) => Form::Table,
            (false, false) => Form::Brief,
        }
    }
}

impl RunArguments {
    pub fn given(&self) -> Result<Given, Failure> {
        let given = self.inputs.given()?;
        let has_source = given.data.is_some() || given.radar.is_some();
        match self.ros2.is_some() && has_source {
            true => Err("--ros2 names a radar, and another source is named too: name one".into()),
            false => Ok(given),
        }
    }
}

/// The arguments of `gyre ros2`.
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

/// The ends of a link.
#[derive(Debug, Subcommand)]
pub enum LinkEnd {
    /// Let other machines look on at a running run. It changes neither a result nor a latency.
    Send(SendArguments),
    /// Observe a run of another machine: its messages form a run here, for `gyre watch`, `echo` and
    /// `record`.
    Receive(ReceiveArguments),
}

#[derive(Debug, Args)]
pub struct SendArguments {
    /// The folder of the run's results, its --out.
    pub out: PathBuf,
    /// The topics that are sent: scan, masked, rotation, motion, refined, pose, loop, correction,
    /// fix. Default: all of these in the run except scan, masked and rotation.
    #[arg(long, value_delimiter = ',')]
    pub topics: Vec<String>,
    /// Time to wait, after the end of the run, for receivers that have not everything yet, s.
    #[arg(long, default_value = "60", value_name = "S", value_parser = seconds)]
    pub linger_s: Duration,
    #[command(flatten)]
    pub network: NetworkArguments,
}

#[derive(Debug, Args)]
pub struct ReceiveArguments {
    /// The folder of the run that is made of it.
    pub out: PathBuf,
    /// The topics that are received of those that are sent. Default: all.
    #[arg(long, value_delimiter = ',')]
    pub topics: Vec<String>,
    #[command(flatten)]
    pub network: NetworkArguments,
}

#[derive(Debug, Args)]
pub struct NetworkArguments {
    /// Wait for the other end here, as in tls/0.0.0.0:7447; tcp/ is for loopback addresses.
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Connect to the other end, or to a router, as in tls/robot.example:7447.
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// The name of the link, equal at both ends, and different for each robot.
    #[arg(long, default_value = "gyre")]
    pub name: String,
    /// Certificate of the authority that has signed the certificates of both ends, PEM.
    #[arg(long, value_name = "FILE")]
    pub ca: Option<PathBuf>,
    /// Certificate of this end, PEM.
    #[arg(long, value_name = "FILE")]
    pub certificate: Option<PathBuf>,
    /// Private key of the certificate, PEM.
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
}
