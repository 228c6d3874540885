//! Plays a recording as a radar on the network, with the faults of one where asked for.

mod clients;
mod faults;
mod group;

use std::{
    f64::consts::TAU,
    io,
    net::{Ipv4Addr, SocketAddrV4, TcpListener},
    ops::Range,
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Azimuth, Configuration, Powers, write_azimuth};
use gyre_radar::{Dataset, OwnedScan, PolarScan, ReadError, scan::flag};
use thiserror::Error;

pub(crate) use clients::Clients;
pub use faults::Faults;
pub(crate) use group::Group;
pub use gyre_colossus::{ByteOrder, ClockFormat};

/// Encoder counts in a turn, where a recording does not say.
const ENCODER_COUNTS: u16 = 5600;
/// The longest wait within a recording: longer gaps are shortened to it.
const MAX_WAIT: Duration = Duration::from_secs(2);
/// The longest time without a look for a request to stop.
const SLICE: Duration = Duration::from_millis(50);
/// Time between two looks for a client.
const POLL: Duration = Duration::from_millis(5);
/// Time between two descriptions of a radar that sends no powers yet.
const DESCRIBE_PERIOD: Duration = Duration::from_millis(100);
/// What a garbled message is.
const GARBAGE: &[u8] = b"not a message of a radar";

/// To whom a recording is played.
#[derive(Debug)]
pub enum Audience {
    /// Who connects by TCP, from the first request for azimuths on.
    Clients(TcpListener),
    /// Who receives the datagrams, if anybody.
    Group {
        /// The group, or the address of one receiver.
        to: SocketAddrV4,
        /// The address of this machine from which they leave; unspecified: the system chooses.
        interface: Ipv4Addr,
        /// Time before the first scan, for which only the radar's description of itself is sent.
        wait: Duration,
    },
}

/// How to play.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Factor of the recorded pace; `None`: as fast as the clients read.
    pub rate: Option<f64>,
    /// Scans to play, by their index in the recording.
    pub scans: Range<usize>,
    /// Play the recording again and again, its times going on.
    pub repeats: bool,
    /// Faults to make.
    pub faults: Faults,
    /// How the times are written.
    pub clock: ClockFormat,
}

/// Why a recording cannot be played as a radar.
#[derive(Debug, Error)]
pub enum ServeError {
    /// A scan cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The network.
    #[error("cannot serve as a radar: {0}")]
    Network(#[from] io::Error),
    /// The recording does not fit the protocol.
    #[error(
        "scans of {azimuths} azimuths and {bins} range bins do not fit the protocol, which counts both in 16 bits"
    )]
    TooLarge {
        /// Azimuths of a scan.
        azimuths: usize,
        /// Range bins of an azimuth.
        bins: usize,
    },
}

/// What was played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Played {
    /// Scans.
    pub scans: u64,
    /// Azimuths that were left out.
    pub lost_azimuths: u64,
    /// Datagrams that were left out.
    pub lost_datagrams: u64,
    /// Connections that were reset.
    pub resets: u64,
    /// Stalls.
    pub stalls: u64,
}

/// Plays a recording until it has ended or `stop` says so.
///
/// # Errors
/// A scan that cannot be read, one that does not fit the protocol, or a failure of the network.
pub fn serve(
    audience: Audience,
    dataset: &mut dyn Dataset,
    playback: &Playback,
    stop: &dyn Fn() -> bool,
) -> Result<Played, ServeError> {
    let first = playback.scans.start;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(first, scan.slot())?;
    let radar = configuration(dataset, scan.view())?;
    let mut wait = Duration::ZERO;
    let output = match audience {
        Audience::Clients(listener) => Output::Clients(Clients::accept(listener, &radar)?),
        Audience::Group {
            to,
            interface,
            wait: before,
        } => {
            wait = before;
            Output::Group(Group::open(to, interface, playback.faults)?)
        }
    };
    let mut player = Player {
        output,
        radar,
        playback,
        stop,
        message: Vec::new(),
        started: None,
        shift_ns: 0,
        sweep_counter: 0,
        played: Played::default(),
    };
    if !player.describe(wait) {
        return Ok(player.ended());
    }
    loop {
        let mut last_ns = 0;
        for index in playback.scans.clone() {
            scan.geometry = dataset.read(index, scan.slot())?;
            if !player.play(scan.view()) {
                return Ok(player.ended());
            }
            last_ns = scan.view().stamp_ns.last().copied().unwrap_or(last_ns);
        }
        if !playback.repeats {
            player.close();
            return Ok(player.ended());
        }
        scan.geometry = dataset.read(first, scan.slot())?;
        let first_ns = scan.stamp_ns.first().copied().unwrap_or_default();
        player.shift_ns +=
            last_ns - first_ns + dataset.period_ns() / scan.geometry.azimuths.max(1) as i64;
    }
}

/// What the radar says of itself.
fn configuration(dataset: &dyn Dataset, scan: PolarScan<'_>) -> Result<Configuration, ServeError> {
    let geometry = scan.geometry;
    let (azimuths, bins) = (geometry.azimuths, geometry.bins);
    let small =
        |number: usize| u16::try_from(number).map_err(|_| ServeError::TooLarge { azimuths, bins });
    let resolution_m = f64::from(geometry.range_resolution_m);
    Ok(Configuration {
        azimuth_samples: small(azimuths)?,
        bin_size: (resolution_m * 1e4).round().min(f64::from(u16::MAX)) as u16,
        range_in_bins: small(bins)?,
        encoder_size: dataset.encoder_counts().unwrap_or(ENCODER_COUNTS),
        rotation_mhz: (1e12 / dataset.period_ns().max(1) as f64)
            .round()
            .min(f64::from(u16::MAX)) as u16,
        packet_rate: (azimuths as f64 * 1e9 / dataset.period_ns().max(1) as f64)
            .round()
            .min(f64::from(u16::MAX)) as u16,
        range_gain: 1.0,
        range_offset: 0.0,
        range_resolution_m: Some(geometry.range_resolution_m),
    })
}

/// Where messages go.
enum Output {
    Clients(Clients),
    Group(Group),
}

struct Player<'a> {
    output: Output,
    radar: Configuration,
    playback: &'a Playback,
    stop: &'a dyn Fn() -> bool,
    message: Vec<u8>,
    /// When the first azimuth was due, and its time in the recording, ns.
    started: Option<(Instant, i64)>,
    /// Added to the times of the recording, which is played again.
    shift_ns: i64,
    sweep_counter: u16,
    played: Played,
}

impl Player<'_> {
    /// Sends a scan azimuth by azimuth; false on a request to stop.
    fn play(&mut self, scan: PolarScan<'_>) -> bool {
        if !self.has_client() {
            return false;
        }
        let faults = self.playback.faults;
        if faults.stalls(self.played.scans) {
            self.played.stalls += 1;
            self.started = None;
            if !self.pause(Duration::from_secs_f64(faults.stall_s)) {
                return false;
            }
        }
        for row in 0..scan.geometry.azimuths {
            if !self.wait_until_due(scan.stamp_ns[row]) {
                return false;
            }
            self.sweep_counter = self.sweep_counter.wrapping_add(1);
            // A row that was not measured was not sent by the radar either.
            let is_measured = scan.flags[row] & flag::MEASURED != 0;
            let is_lost =
                matches!(self.output, Output::Clients(_)) && faults.loses(self.played.scans, row);
            if !is_measured || is_lost {
                self.played.lost_azimuths += 1;
                continue;
            }
            self.send(&scan, row);
            if let Output::Clients(clients) = &self.output
                && row == scan.geometry.azimuths / 2
                && faults.resets(self.played.scans)
            {
                self.played.resets += 1;
                clients.reset();
            }
        }
        self.played.scans += 1;
        !(self.stop)()
    }

    /// Sends only what the radar says of itself for some time, to a group; false on a request to stop.
    fn describe(&mut self, wait: Duration) -> bool {
        let end = Instant::now() + wait;
        while let Output::Group(group) = &mut self.output
            && Instant::now() < end
        {
            group.describe(&self.radar);
            if (self.stop)() {
                return false;
            }
            sleep(DESCRIBE_PERIOD);
        }
        true
    }

    /// Ends the connections when the clients have read all.
    fn close(&self) {
        if let Output::Clients(clients) = &self.output {
            clients.close();
        }
    }

    fn ended(self) -> Played {
        let lost_datagrams = match &self.output {
            Output::Clients(_) => 0,
            Output::Group(group) => group.lost,
        };
        Played {
            lost_datagrams,
            ..self.played
        }
    }

    /// Waits for a first client; one that plays as fast as it is read waits for one after each loss, too.
    fn has_client(&mut self) -> bool {
        let Output::Clients(clients) = &self.output else {
            return true;
        };
        let waits = self.started.is_none() || self.playback.rate.is_none();
        while waits && !clients.any_started() {
            if (self.stop)() {
                return false;
            }
            sleep(POLL);
        }
        true
    }

    /// Waits for a time; false on a request to stop.
    fn pause(&self, time: Duration) -> bool {
        let end = Instant::now() + time;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            // Between two azimuths there is no time to ask.
            if left > SLICE && (self.stop)() {
                return false;
            }
            sleep(left.min(SLICE));
        }
    }

    /// Waits until an azimuth is due; false on a request to stop.
    fn wait_until_due(&mut self, stamp_ns: i64) -> bool {
        let Some(rate) = self.playback.rate else {
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
        self.pause(wait.min(MAX_WAIT))
    }

    fn send(&mut self, scan: &PolarScan<'_>, row: usize) {
        let faults = self.playback.faults;
        let encoder_size = self.radar.encoder_size;
        let turns = f64::from(scan.azimuth_rad[row]) / TAU;
        let encoder = (turns * f64::from(encoder_size)).round() as u16 % encoder_size;
        let stamp_ns = scan.stamp_ns[row] + self.shift_ns;
        let (seconds, split_seconds) = self.playback.clock.fields(stamp_ns);
        let azimuth = Azimuth {
            sweep_counter: self.sweep_counter,
            encoder,
            seconds,
            split_seconds,
            powers: Powers::Eight(scan.row(row)),
        };
        let is_garbled = faults.garbles(self.played.scans, row);
        match &mut self.output {
            Output::Clients(clients) => {
                self.message.clear();
                if is_garbled {
                    self.message.extend_from_slice(GARBAGE);
                }
                write_azimuth(&mut self.message, &azimuth);
                clients.send(&self.message);
            }
            Output::Group(group) => {
                if is_garbled {
                    group.pass(GARBAGE);
                }
                group.send(&self.radar, &azimuth);
            }
        }
    }
}
