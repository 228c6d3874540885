//! `gyre radar-server`: plays a recording as a radar on the network, with injected faults where
//! asked for.

mod output;

use std::{
    f64::consts::TAU,
    io,
    net::{Ipv4Addr, SocketAddrV4},
    ops::Range,
    time::{Duration, Instant},
};

use clap::Args;
use gyre_client::Signals;
use gyre_colossus::{
    Azimuth, ByteOrder, ClockFormat, Configuration as Radar, Powers, write_azimuth,
};
use gyre_configuration::{
    Configuration, Played,
    terminal::{Failure, inputs::Inputs, print, seconds},
};
use gyre_contract::run::Rate;
use gyre_datasets::Dataset;
use gyre_geometry::{OwnedScan, PolarScan, SweepGeometry, scan::flag};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use output::{Output, sleep_until};

/// Encoder counts in a turn, unless a recording contains them.
const ENCODER_COUNTS: u16 = 5600;
/// The longest wait within a recording: longer gaps are shortened to it.
const MAX_WAIT: Duration = Duration::from_secs(2);
/// The azimuth before which garbage is sent, and its bytes.
const GARBLED: usize = 100;
const GARBAGE: &[u8] = b"not a message of a radar";

fn unserved(error: io::Error) -> String {
    format!("cannot serve as a radar: {error}")
}

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
    #[arg(
        long,
        value_name = "GROUP:PORT",
        conflicts_with_all = ["listen", "reset_every", "big_endian"],
    )]
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

/// Injected faults of a radar and of its connections, the same in each playback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Args)]
pub struct Faults {
    /// Lose this share of the azimuths.
    #[arg(long = "lose", default_value_t = 0.0, value_name = "SHARE")]
    pub lost: f64,
    /// Reset the connections in the middle of every Nth scan.
    #[arg(long, value_name = "N")]
    pub reset_every: Option<u64>,
    /// Send bytes that are no message in the middle of every Nth scan.
    #[arg(long, value_name = "N")]
    pub garbage_every: Option<u64>,
}

/// Plays a recording or a simulation as a radar, until it has ended or a signal arrives.
pub fn serve(arguments: &RadarServerArguments) -> Result<(), Failure> {
    let mut configuration = played(&arguments.inputs)?;
    // The angles of an encoder are sent as it counts them: who receives them corrects its
    // eccentricity.
    configuration.dataset.azimuth_eccentricity_rad = Some(0.0);
    let Played { mut dataset, .. } = gyre_configuration::open(&configuration)?;
    let dataset = dataset.as_mut();
    let scans = configuration.source.played(dataset.scans());
    if scans.is_empty() {
        return Err(format!("{} has no scan to play", configuration.data()).into());
    }
    let signals = Signals::install()?;
    let stop = || signals.sleep(Duration::ZERO).unwrap_or(true);
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(scans.start, scan.slot())?;
    let encoder_size = dataset.encoder_counts().unwrap_or(ENCODER_COUNTS);
    let radar = radar(dataset, &scan.geometry, encoder_size)?;
    let (output, address, is_public) = Output::open(arguments, &radar)?;
    let (count, data) = (scans.len(), configuration.data());
    print::note(format_args!(
        "gyre: playing {count} scans of {data} as a radar at {address}"
    ));
    if is_public {
        print::note(
            "gyre: whoever reaches this address receives the scans: Navtech's protocol has no token",
        );
    }
    let mut player = Player {
        output,
        radar,
        arguments,
        clock: ClockFormat {
            // Datagrams always have the network's order.
            order: match arguments.big_endian || arguments.udp.is_some() {
                true => ByteOrder::Big,
                false => ByteOrder::Little,
            },
            ..ClockFormat::default()
        },
        stop: &stop,
        message: Vec::new(),
        started: None,
        shift_ns: 0,
        sweep_counter: 0,
        scans: 0,
        lost_azimuths: 0,
        resets: 0,
    };
    player.play_all(dataset, scans, scan)?;
    let datagrams = match &player.output {
        Output::Clients(_) => 0,
        Output::Group(group) => group.lost,
    };
    let (scans, azimuths, resets) = (player.scans, player.lost_azimuths, player.resets);
    print::line(format_args!(
        "played {scans} scans, lost {azimuths} azimuths and {datagrams} datagrams, reset the connections {resets} times"
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

/// Returns the configuration message of a radar with these scans.
pub(crate) fn radar(
    dataset: &dyn Dataset,
    geometry: &SweepGeometry,
    encoder_size: u16,
) -> Result<Radar, Failure> {
    let (azimuths, bins) = (geometry.azimuths, geometry.bins);
    let small = |number: usize| {
        let too_large = |_| {
            format!(
                "scans of {azimuths} azimuths and {bins} range bins do not fit Navtech's protocol, which counts both in 16 bits"
            )
        };
        u16::try_from(number).map_err(too_large)
    };
    let rounded = |value: f64| value.round().min(f64::from(u16::MAX)) as u16;
    let (resolution_m, period_ns) = (
        geometry.range_resolution_m,
        dataset.period_ns().max(1) as f64,
    );
    Ok(Radar {
        azimuth_samples: small(azimuths)?,
        bin_size: rounded(f64::from(resolution_m) * 1e4),
        range_in_bins: small(bins)?,
        encoder_size,
        rotation_mhz: rounded(1e12 / period_ns),
        packet_rate: rounded(azimuths as f64 * 1e9 / period_ns),
        range_gain: 1.0,
        range_offset: 0.0,
        range_resolution_m: Some(resolution_m),
    })
}

struct Player<'a> {
    output: Output,
    radar: Radar,
    arguments: &'a RadarServerArguments,
    clock: ClockFormat,
    stop: &'a dyn Fn() -> bool,
    message: Vec<u8>,
    /// When the first azimuth was due, and its time in the recording, ns.
    started: Option<(Instant, i64)>,
    /// Added to the times of the recording, which is played again.
    shift_ns: i64,
    sweep_counter: u16,
    scans: u64,
    lost_azimuths: u64,
    resets: u64,
}

impl<'a> Player<'a> {
    /// Plays these scans until a request to stop.
    fn play_all(
        &mut self,
        dataset: &mut dyn Dataset,
        scans: Range<usize>,
        mut scan: OwnedScan,
    ) -> Result<(), Failure> {
        if !self.output.describe(&self.radar, self.stop) {
            return Ok(());
        }
        loop {
            let mut last_ns = 0;
            for index in scans.clone() {
                scan.geometry = dataset.read(index, scan.slot())?;
                if !self.play(scan.view()) {
                    return Ok(());
                }
                last_ns = scan.view().stamp_ns.last().copied().unwrap_or(last_ns);
            }
            if !self.arguments.repeat {
                self.output.close();
                return Ok(());
            }
            scan.geometry = dataset.read(scans.start, scan.slot())?;
            let first_ns = scan.stamp_ns.first().copied().unwrap_or_default();
            self.shift_ns +=
                last_ns - first_ns + dataset.period_ns() / scan.geometry.azimuths.max(1) as i64;
        }
    }

    /// Sends a scan azimuth by azimuth; false on a request to stop.
    fn play(&mut self, scan: PolarScan<'_>) -> bool {
        if !self.has_client() {
            return false;
        }
        let faults = self.arguments.faults;
        let number = self.scans;
        for row in 0..scan.geometry.azimuths {
            if !self.wait_until_due(scan.stamp_ns[row]) {
                return false;
            }
            self.sweep_counter = self.sweep_counter.wrapping_add(1);
            // A row that was not measured was not sent by the radar either.
            let is_measured = scan.flags[row] & flag::MEASURED != 0;
            let is_lost = uniform(number, row as u64) < faults.lost;
            if !is_measured || is_lost {
                self.lost_azimuths += 1;
                continue;
            }
            self.send(&scan, row);
            if let Output::Clients(clients) = &self.output
                && row == scan.geometry.azimuths / 2
                && is_nth(number, faults.reset_every)
            {
                self.resets += 1;
                clients.reset();
            }
        }
        self.scans += 1;
        !(self.stop)()
    }

    /// Waits for a first client; at the pace of the clients for one after each loss, too.
    fn has_client(&self) -> bool {
        let waits = self.started.is_none() || self.arguments.rate.factor().is_none();
        !waits || self.output.await_client(self.stop)
    }

    /// Waits until an azimuth is due; false on a request to stop.
    fn wait_until_due(&mut self, stamp_ns: i64) -> bool {
        let Some(rate) = self.arguments.rate.factor() else {
            self.started.get_or_insert((Instant::now(), stamp_ns));
            return true;
        };
        let stamp_ns = stamp_ns + self.shift_ns;
        let (start, first_ns) = *self.started.get_or_insert((Instant::now(), stamp_ns));
        let due_s = (stamp_ns - first_ns).max(0) as f64 * 1e-9 / rate;
        let due = start + Duration::try_from_secs_f64(due_s).unwrap_or(MAX_WAIT);
        let wait = due.saturating_duration_since(Instant::now());
        if wait > MAX_WAIT {
            self.started = Some((Instant::now() + MAX_WAIT, stamp_ns));
        }
        sleep_until(Instant::now() + wait.min(MAX_WAIT), self.stop)
    }

    fn send(&mut self, scan: &PolarScan<'_>, row: usize) {
        let faults = self.arguments.faults;
        let encoder_size = self.radar.encoder_size;
        let turns = f64::from(scan.azimuth_rad[row]) / TAU;
        let encoder = (turns * f64::from(encoder_size)).round() as u16 % encoder_size;
        let stamp_ns = scan.stamp_ns[row] + self.shift_ns;
        let (seconds, split_seconds) = self.clock.fields(stamp_ns);
        let azimuth = Azimuth {
            sweep_counter: self.sweep_counter,
            encoder,
            seconds,
            split_seconds,
            powers: Powers::Eight(scan.row(row)),
        };
        if row == GARBLED && is_nth(self.scans, faults.garbage_every) {
            self.output.send(GARBAGE);
        }
        match &mut self.output {
            Output::Clients(clients) => {
                self.message.clear();
                write_azimuth(&mut self.message, &azimuth);
                clients.send(&self.message);
            }
            Output::Group(group) => group.send(&self.radar, &azimuth),
        }
    }
}

fn is_nth(scan: u64, every: Option<u64>) -> bool {
    every.is_some_and(|every| (scan + 1).is_multiple_of(every.max(1)))
}

/// Returns a number from 0 to 1 that scan and row determine.
fn uniform(scan: u64, row: u64) -> f64 {
    ChaCha8Rng::seed_from_u64(scan << 16 | row).random()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_come_in_every_nth_scan() {
        let resets: Vec<_> = (0..9).filter(|scan| is_nth(*scan, Some(3))).collect();
        assert_eq!(resets, [2, 5, 8]);
        assert!(!is_nth(2, None));
    }
}
