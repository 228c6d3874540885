//! The arguments of `gyre radar-server`.

use std::{
    net::{Ipv4Addr, SocketAddrV4},
    time::Duration,
};

use clap::Args;
use gyre_configuration::terminal::{inputs::Inputs, seconds};
use gyre_contract::run::Rate;

use crate::radar_server::server::Faults;

#[derive(Debug, Args)]
pub struct RadarServerArguments {
    /// The scans; of the configuration the sections `[simulation]`, `[source]` and `[dataset]`.
    #[command(flatten)]
    pub inputs: Inputs,
    /// The address to serve at. At another than the loopback's the whole network can read the
    /// scans: the protocol has no token.
    #[arg(long, default_value = "127.0.0.1:6317", value_name = "ADDRESS")]
    pub listen: String,
    /// Send the scans by UDP, as ASTERIX CAT-240, to this group or receiver, instead of serving
    /// them by TCP: 239.192.43.78:4378.
    #[arg(long, value_name = "GROUP:PORT", conflicts_with_all = ["listen", "reset_every", "big_endian"])]
    pub udp: Option<SocketAddrV4>,
    /// The address of this machine for sending datagrams; 0.0.0.0: the system chooses.
    #[arg(long, default_value = "127.0.0.1", value_name = "ADDRESS")]
    pub interface: Ipv4Addr,
    /// Time before the first scan for which only the radar's description of itself is sent by UDP,
    /// s.
    #[arg(long, default_value = "0", value_name = "S", value_parser = seconds, requires = "udp")]
    pub wait_s: Duration,
    /// Pace: realtime, max (as fast as it is read), or a factor.
    #[arg(long, default_value = "realtime")]
    pub rate: Rate,
    /// Scans to play. Default: all.
    #[arg(long)]
    pub scans: Option<usize>,
    /// Play again and again, with times that advance.
    #[arg(long)]
    pub repeat: bool,
    /// Faults to make.
    #[command(flatten)]
    pub faults: Faults,
    /// Write the times big-endian, as some clients expect.
    #[arg(long)]
    pub big_endian: bool,
}
