//! `gyre radar-server`: plays a recording as a radar on the network.

mod arguments;
mod server;

use std::{net::TcpListener, process::ExitCode, time::Duration};

use gyre_configuration::{Configuration, Played};
use gyre_stage::wake::Signals;
use gyre_terminal::{Failure, inputs::Inputs, print};

pub use arguments::RadarServerArguments;
use server::{Clients, Group, Output};

/// Plays a recording or a simulation as a radar, until it has ended or a signal arrives.
pub fn serve(arguments: &RadarServerArguments) -> Result<ExitCode, Failure> {
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
    let (output, address, is_public) = output(arguments)?;
    let (count, data) = (scans.len(), configuration.data());
    print::note(format_args!(
        "gyre: playing {count} scans of {data} as a radar at {address}"
    ));
    if is_public {
        print::note(
            "gyre: whoever reaches this address receives the scans: Navtech's protocol has no token",
        );
    }
    let played = server::serve(output, dataset.as_mut(), scans, arguments, &stop)?;
    let (scans, azimuths, datagrams) = (played.scans, played.lost_azimuths, played.lost_datagrams);
    let (resets, stalls) = (played.resets, played.stalls);
    print::line(format_args!(
        "played {scans} scans, lost {azimuths} azimuths and {datagrams} datagrams, reset the connections {resets} times, stalled {stalls} times"
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the configuration whose scans are played. A recording is sent as it is: without a
/// configuration nothing is measured in it.
fn played(inputs: &Inputs) -> Result<Configuration, Failure> {
    let given = inputs.given_recording()?;
    let configuration = match &given.configuration {
        Some(named) => gyre_terminal::inputs::configuration(named, &inputs.set)?,
        None => Configuration::of_overrides(&inputs.set)?,
    };
    Ok(configuration.streaming(given.data.as_deref()))
}

/// Returns the receivers, the address for receiving the radar, and whether other machines reach it.
fn output(arguments: &RadarServerArguments) -> Result<(Output, String, bool), Failure> {
    if let Some(to) = arguments.udp {
        if arguments.rate.factor().is_none() {
            return Err("--rate max has no meaning with --udp: nobody says how fast datagrams are read; give a factor".into());
        }
        let wait = Duration::try_from_secs_f64(arguments.wait_s)
            .map_err(|error| format!("--wait-s is {}: {error}", arguments.wait_s))?;
        let group = Group::open(to, arguments.interface, arguments.faults)?;
        let (output, address) = (Output::Group { group, wait }, format!("udp://{to}"));
        return Ok((output, address, !arguments.interface.is_loopback()));
    }
    let listen = &arguments.listen;
    let listener = TcpListener::bind(listen)
        .map_err(|error| format!("cannot serve at {listen}: {error}; choose another --listen"))?;
    let address = listener.local_addr()?;
    let (clients, is_public) = (Clients::of(listener), !address.ip().is_loopback());
    Ok((Output::Clients(clients), address.to_string(), is_public))
}
