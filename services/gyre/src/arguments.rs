//! The arguments that several commands share, and the arguments of optional commands.

use std::{
    io::IsTerminal,
    path::{Path, PathBuf},
    time::Duration,
};

use clap::{Args, Subcommand};
use gyre_configuration::{
    Configuration, calibration,
    strict::path_value,
    terminal::{
        Failure,
        inputs::{Given, Inputs},
        print, seconds,
    },
};
use gyre_contract::run::{PlayedFrom, Rate};
use gyre_results::{Form, absolute};
use gyre_tools::{export::FrameArguments, operate::RunChoice};
use gyre_transport::run::end_with;
use rustix::process::Signal;

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
    /// The process that has started it, and whose end also ends it (what `gyre batch` and `gyre
    /// stress` start).
    #[arg(long, hide = true)]
    pub parent: Option<i32>,
}

impl RunOptions {
    /// Lets this process end when its parent ends; false if that has ended already.
    pub fn ends_with_parent(&self) -> Result<bool, Failure> {
        let parent = self.parent;
        Ok(parent.map_or(Ok(true), |parent| end_with(parent, Signal::TERM))?)
    }

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

pub fn results_folder(arguments: &RunArguments) -> Result<PathBuf, Failure> {
    if let Some(out) = &arguments.options.out {
        return Ok(out.clone());
    }
    let given = arguments.given()?;
    let data = given.data.and_then(|data| data.canonicalize().ok());
    let name = match &given.configuration {
        Some(file) => file.file_stem(),
        None if given.radar.is_some() || arguments.ros2.is_some() => Some("radar".as_ref()),
        None => data.as_deref().and_then(|data| {
            match gyre_recording::is_recording(data) || data.is_file() {
                true => data.file_stem(),
                false => data.file_name(),
            }
        }),
    };
    Ok(Path::new("out").join(name.unwrap_or_default()))
}

/// Returns the configuration of a run, with the overrides of the command line.
pub fn resolve(arguments: &RunArguments) -> Result<Configuration, Failure> {
    let given = arguments.given()?;
    let overrides = overrides(arguments, &given)?;
    let mut configuration = given.read(&overrides)?;
    if given.data.is_some() {
        configuration.simulation = None;
    }
    configuration.leave_other_side();
    if configuration.is_radar() {
        // A recording beside it, with its constants and its truth, is of another drive.
        configuration.source.data = PathBuf::new();
    }
    let source = &mut configuration.source;
    if gyre_recording::is_recording(&source.data) && source.from == PlayedFrom::Scan {
        // Scans keep their numbers, and a recording may begin in the middle of a drive.
        let dataset = gyre_recording::open(&source.data, &configuration.dataset)?;
        source.first = source.first.max(dataset.first());
    }
    if let Some(simulation) = &configuration.simulation {
        // The constants of a simulated radar are known.
        configuration.dataset = configuration.dataset.or(&simulation.dataset_options());
        configuration.source.data = PathBuf::new();
    }
    configuration.odometry.masking.resolve()?;
    if configuration.objects.is_on() {
        configuration.odometry.masking.resolve_library()?;
    }
    let idle = configuration.without_effect(&arguments.inputs.set)?;
    idle.iter()
        .for_each(|sentence| print::note(format_args!("gyre: {sentence}")));
    // The run's processes receive the path of the run.
    path_value(&absolute(&results_folder(arguments)?)?)?;
    Ok(configuration)
}

/// The overrides: the calibration, `--set`, the options; of two for one key the later one holds.
fn overrides(arguments: &RunArguments, given: &Given) -> Result<Vec<String>, Failure> {
    let options = &arguments.options;
    let mut overrides = match &arguments.calibration {
        Some(file) => calibration::overrides(file)?,
        None => Vec::new(),
    };
    overrides.extend(arguments.inputs.set.iter().cloned());
    // As values, which are quoted: a folder may be named 2019-01-10 or 7.
    let mut set = |key: &str, value: toml::Value| overrides.push(format!("{key}={value}"));
    if let Some(data) = &given.data {
        set("source.data", path_value(data)?);
        set("source.kind", "recording".into());
    }
    let (address, topic) = (&given.radar, &arguments.ros2);
    for (kind, key, of_radar) in [
        ("colossus", "source.address", address),
        ("ros2", "source.topic", topic),
    ] {
        if let Some(of_radar) = of_radar {
            set("source.kind", kind.into());
            set("run.mode", "live".into());
            set(key, of_radar.clone().into());
        }
    }
    if let Some(rate) = &options.rate {
        set("run.rate", rate.to_string().into());
    }
    if let Some(topic) = &arguments.from {
        set("source.from", topic.clone().into());
    }
    if let Some(file) = &options.record {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
        set("record.file", path_value(&file)?);
    }
    Ok(overrides)
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
    /// The namespace of the node and of its topics, but for those that begin with `/`.
    #[arg(long, value_name = "NAME", default_value = "/")]
    pub namespace: String,
    #[command(flatten)]
    pub frames: FrameArguments,
    /// Publish no transforms of odometry and map, where another program does, such as
    /// robot_localization. The radar's transform stays.
    #[arg(long)]
    pub no_tf: bool,
    /// Date the transform of the map ahead by this time, so that it is valid until the next pose
    /// (Nav2's transform_tolerance).
    #[arg(long, default_value = "0", value_name = "S", value_parser = seconds)]
    pub tf_ahead_s: Duration,
    /// Publish the time of a replay on /clock, with each pose, for nodes with use_sim_time.
    #[arg(long)]
    pub clock: bool,
    /// Be a managed node: publish only while its lifecycle is active. It begins unconfigured.
    #[arg(long)]
    pub managed: bool,
    /// Publish no map, which takes a tenth of a processor at most.
    #[arg(long)]
    pub no_map: bool,
    /// Wait for a run that has not started yet.
    #[arg(long)]
    pub wait: bool,
    /// The arguments that a launch file of ROS 2 passes: -r __node:=NAME, -r __ns:=NAMESPACE, and
    /// -p with base_frame, lidar_odom_frame, map_frame, radar_frame or publish_odom_tf.
    #[arg(
        long,
        num_args = 0..,
        allow_hyphen_values = true,
        value_terminator = "--",
        value_name = "ARGUMENT"
    )]
    pub ros_args: Vec<String>,
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
