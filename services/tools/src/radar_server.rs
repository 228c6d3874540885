//! `gyre radar-server`: plays a recording as a radar on the network.

mod arguments;
pub mod capture;
pub mod server;

use std::{net::TcpListener, ops::Range, path::Path, process::ExitCode, time::Duration};

use gyre_colossus::Address;
use gyre_configuration::{Configuration, Played};
use gyre_stage::wake::Signals;
use gyre_terminal::{Failure, inputs::Inputs, print};

pub use arguments::RadarServerArguments;
use capture::Capture;
use server::{Audience, ByteOrder, ClockFormat, Faults, Playback};

/// Plays a recording or a simulation as a radar, until it has ended or a signal arrives.
pub fn serve(arguments: &RadarServerArguments) -> Result<ExitCode, Failure> {
    if let (Some(file), Some(radar)) = (&arguments.capture, &arguments.radar) {
        return record(file, radar, arguments);
    }
    if let Some(data) = &arguments.inputs.data
        && let Some(capture) = Capture::open(data)?
    {
        return play(data, capture, arguments);
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
    let audience = announced(&scans_of, arguments)?;
    let playback = playback(arguments, scans);
    let played = server::serve(audience, dataset.as_mut(), &playback, &stop)?;
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
    print::note(format_args!(
        "gyre: capturing the radar at {address} into {}",
        file.display()
    ));
    let captured = capture::record(&address, file, &stop)?;
    print::line(format_args!(
        "captured {} bytes in {} records",
        captured.bytes, captured.records
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn play(
    data: &Path,
    capture: Capture,
    arguments: &RadarServerArguments,
) -> Result<ExitCode, Failure> {
    let stop = stop()?;
    let audience = announced(&data.display().to_string(), arguments)?;
    let played = capture::play(audience, capture, arguments.rate.factor(), &stop)?;
    print::line(format_args!(
        "played {} bytes in {} records",
        played.bytes, played.records
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn announced(what: &str, arguments: &RadarServerArguments) -> Result<Audience, Failure> {
    let (audience, address, is_public) = audience(arguments)?;
    print::note(format_args!("gyre: playing {what} as a radar at {address}"));
    if is_public {
        print::note(
            "gyre: whoever reaches this address receives the scans: Navtech's protocol has no token",
        );
    }
    Ok(audience)
}

/// Returns the audience, the address for receiving the radar, and whether other machines reach it.
fn audience(arguments: &RadarServerArguments) -> Result<(Audience, String, bool), Failure> {
    if let Some(to) = arguments.udp {
        if arguments.rate.factor().is_none() {
            return Err("--rate max has no meaning with --udp: nobody says how fast datagrams are read; give a factor".into());
        }
        let wait = Duration::try_from_secs_f64(arguments.wait_s)
            .map_err(|error| format!("--wait-s is {}: {error}", arguments.wait_s))?;
        let interface = arguments.interface;
        let is_public = !interface.is_loopback();
        let audience = Audience::Group {
            to,
            interface,
            wait,
        };
        return Ok((audience, format!("udp://{to}"), is_public));
    }
    let listen = &arguments.listen;
    let listener = TcpListener::bind(listen)
        .map_err(|error| format!("cannot serve at {listen}: {error}; choose another --listen"))?;
    let address = listener.local_addr()?;
    let is_public = !address.ip().is_loopback();
    Ok((Audience::Clients(listener), address.to_string(), is_public))
}

fn playback(arguments: &RadarServerArguments, scans: Range<usize>) -> Playback {
    Playback {
        rate: arguments.rate.factor(),
        scans,
        repeats: arguments.repeat,
        faults: Faults {
            stall_s: arguments.faults.stall_s.clamp(0.0, 3600.0),
            ..arguments.faults
        },
        clock: ClockFormat {
            // Datagrams always have the network's order.
            order: match arguments.big_endian || arguments.udp.is_some() {
                true => ByteOrder::Big,
                false => ByteOrder::Little,
            },
            ..ClockFormat::default()
        },
    }
}
