//! `gyre radar-server`: plays a recording as a radar on the network.

mod arguments;
mod server;

use std::time::Duration;

use gyre_client::Signals;
use gyre_configuration::{
    Configuration, Played,
    terminal::{Failure, inputs::Inputs, print},
};

pub use arguments::RadarServerArguments;
pub(crate) use server::configuration;

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
