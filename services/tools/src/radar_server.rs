//! `gyre radar-server`: plays a recording as a radar on the network.

mod server;

use std::{
    net::{Ipv4Addr, SocketAddrV4},
    time::Duration,
};

use clap::Args;
use gyre_client::Signals;
use gyre_configuration::{
    Configuration, Played,
    terminal::{Failure, inputs::Inputs, print, seconds},
};
use gyre_contract::run::Rate;
use server::Faults;

pub(crate) use server::configuration;

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

/// Plays a recording or a simulation as a radar, until it has ended or a signal arrives.
pub fn serve(arguments: &RadarServerArguments) -> Result<(), Failure> {
    let mut configuration = played(&arguments.inputs)?;
    // The angles of an encoder are sent as it counts them: who receives them corrects its
    // eccentricity.
    configuration.dataset.azimuth_eccentricity_rad = Some(0.0);
    let Played { mut dataset, .. } = gyre_configuration::open(&configuration)?;
    let mut scans = configuration.source.played(dataset.scans());
    if let Some(count) = arguments.scans {
        scans.end = scans.end.min(scans.start.saturating_add(count));
    }
    if scans.is_empty() {
        return Err(format!("{} has no scan to play", configuration.data()).into());
    }
    let signals = Signals::install()?;
    let stop = || signals.sleep(Duration::ZERO).unwrap_or(true);
    let what = format!("{} scans of {}", scans.len(), configuration.data());
    let played = server::serve(&what, dataset.as_mut(), scans, arguments, &stop)?;
    let (scans, azimuths, datagrams) = (played.scans, played.lost_azimuths, played.lost_datagrams);
    let (resets, stalls) = (played.resets, played.stalls);
    print::line(format_args!(
        "played {scans} scans, lost {azimuths} azimuths and {datagrams} datagrams, reset the connections {resets} times, stalled {stalls} times"
    ))
}

/// Returns the configuration whose scans are played. A recording is sent as it is: without a
/// configuration nothing is measured in it.
fn played(inputs: &Inputs) -> Result<Configuration, Failure> {
    let given = inputs.given_recording()?;
    let named = given.configuration.as_deref();
    let configuration = gyre_configuration::terminal::inputs::configuration(named, &inputs.set)?;
    Ok(configuration.streaming(given.data.as_deref()))
}
