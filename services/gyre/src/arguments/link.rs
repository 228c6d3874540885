//! The arguments of `gyre link`.

use std::{path::PathBuf, time::Duration};

use clap::{Args, Subcommand};
use gyre_configuration::terminal::seconds;

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
