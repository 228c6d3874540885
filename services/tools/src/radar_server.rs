//! `gyre radar-server`: plays a recording as a radar on the network.

mod arguments;
pub mod capture;
pub mod server;

use std::{net::TcpListener, path::Path, process::ExitCode, time::Duration};

use gyre_colossus::Address;
use gyre_configuration::{Configuration, Played};
use gyre_stage::wake::Signals;
use gyre_terminal::{Failure, inputs::Inputs, print};

pub use arguments::RadarServerArguments;
use capture::{Capture, Captured};
use server::{Clients, Faults, Group, Output};

/// Plays a recording or a simulation as a radar, until it has ended or a signal arrives.
pub fn serve(arguments: &RadarServerArguments) -> Result<ExitCode, Failure> {
    if let (Some(file), Some(radar)) = (&arguments.capture, &arguments.radar) {
        return record(file, radar, arguments);
    }
    for word in &arguments.inputs.what {
        if let Some(capture) = Capture::open(word)? {
            return play(word, capture, arguments);
        }
    }
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
    let stop = stop()?;
    let scans_of = format!("{} scans of {}", scans.len(), configuration.data());
    let output = announced(&scans_of, arguments, arguments.faults)?;
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

/// Returns a function that returns whether a signal has asked for the end.
fn stop() -> Result<impl Fn() -> bool, Failure> {
    let signals = Signals::install()?;
    Ok(move || signals.sleep(Duration::ZERO).unwrap_or(true))
}

fn record(file: &Path, radar: &str, arguments: &RadarServerArguments) -> Result<ExitCode, Failure> {
    let interface = match radar.starts_with("udp://") {
        true => arguments.interface.to_string(),
        false => String::new(),
    };
    let (address, stop) = (Address::parse(radar, &interface)?, stop()?);
    let path = file.display();
    print::note(format_args!(
        "gyre: capturing the radar at {address} into {path}"
    ));
    let Captured { records, bytes } = capture::record(&address, file, &stop)?;
    print::line(format_args!("captured {bytes} bytes in {records} records"))?;
    Ok(ExitCode::SUCCESS)
}

fn play(
    data: &Path,
    capture: Capture,
    arguments: &RadarServerArguments,
) -> Result<ExitCode, Failure> {
    let stop = stop()?;
    let output = announced(&data.display().to_string(), arguments, Faults::default())?;
    let played = capture::play(output, capture, arguments.rate.factor(), &stop)?;
    let Captured { records, bytes } = played;
    print::line(format_args!("played {bytes} bytes in {records} records"))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the receivers, with faults on their way, and prints where the radar is received.
fn announced(
    what: &str,
    arguments: &RadarServerArguments,
    faults: Faults,
) -> Result<Output, Failure> {
    let (output, address, is_public) = output(arguments, faults)?;
    print::note(format_args!("gyre: playing {what} as a radar at {address}"));
    if is_public {
        print::note(
            "gyre: whoever reaches this address receives the scans: Navtech's protocol has no token",
        );
    }
    Ok(output)
}

/// Returns the receivers, the address for receiving the radar, and whether other machines reach it.
fn output(
    arguments: &RadarServerArguments,
    faults: Faults,
) -> Result<(Output, String, bool), Failure> {
    if let Some(to) = arguments.udp {
        if arguments.rate.factor().is_none() {
            return Err("--rate max has no meaning with --udp: nobody says how fast datagrams are read; give a factor".into());
        }
        let wait = Duration::try_from_secs_f64(arguments.wait_s)
            .map_err(|error| format!("--wait-s is {}: {error}", arguments.wait_s))?;
        let group = Group::open(to, arguments.interface, faults)?;
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
