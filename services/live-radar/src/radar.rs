//! A radar as the source of a run.

use std::{
    mem,
    os::fd::BorrowedFd,
    time::{Duration, SystemTime},
};

use gyre_colossus::{
    Azimuth, BadConfiguration, Configuration, Event, FoundClock, Message, RadarClock,
    SweepAssembler,
};
use gyre_messages::{ScanHeader, StageId};
use gyre_stage::{
    StageCounters, StageError,
    source::{Arrival, Sensor},
};

use crate::{
    Settings,
    connection::{Connection, Received},
    messages::Messages,
};

/// Reads after which the process looks for signals and new readers, however much there is to read.
const MAX_READS: usize = 64;
/// Bytes without a message after which what is connected to is no radar.
const MAX_SKIPPED_BYTES: usize = 1 << 22;
/// Azimuths for which the connection need not wake, at most. The buffers of sockets hold many more.
const BATCH: f64 = 10.0;
/// The part of the azimuths up to the end of a turn, for the radar may turn faster than it says.
const BATCH_SHARE: f64 = 0.5;

/// A radar on the network.
pub struct Radar {
    settings: Settings,
    connection: Connection,
    messages: Messages,
    /// `None` until the radar has sent its configuration.
    sweeps: Option<Sweeps>,
    missing: u64,
    damaged: u64,
    /// Scans that were left out by earlier connections.
    left_out: u64,
}

/// The scans of one connection.
struct Sweeps {
    radar: Configuration,
    clock: RadarClock,
    assembler: SweepAssembler,
    /// What was found out of the clock has been logged.
    described: bool,
    /// Scans whose times do not increase.
    refused: u64,
}

impl Sweeps {
    fn new(radar: Configuration, settings: &Settings) -> Result<Self, BadConfiguration> {
        Ok(Self {
            clock: RadarClock::new(&radar),
            assembler: SweepAssembler::new(&radar, settings.constants)?,
            radar,
            described: false,
            refused: 0,
        })
    }

    /// Adds an azimuth; returns the number of azimuths that are missing from the sweep that it completes.
    fn add(
        &mut self,
        azimuth: Azimuth<'_>,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Option<usize> {
        let mut complete = None;
        for (azimuth, stamp_ns) in self.clock.stamp(azimuth, now_ns()) {
            if let Some(sweep) = self.assembler.add(&azimuth, stamp_ns, header.slot(bytes)) {
                header.set_geometry(&sweep.geometry);
                complete = Some(sweep.missing);
                break;
            }
        }
        if let (false, Some(found)) = (self.described, self.clock.found()) {
            self.described = true;
            tracing::info!("{found}");
        }
        // A clock that was set back in the middle of a sweep gives times that no later stage accepts.
        let checked = header.view(bytes).map(|scan| scan.check_times());
        if let (Some(_), Some(Err(error))) = (complete, checked) {
            tracing::warn!("a scan is left out: {error}");
            self.refused += 1;
            return None;
        }
        complete
    }

    /// The time for which no scan can be complete, if it is that of a few azimuths: so many are then read at once.
    fn pause(&self) -> Option<Duration> {
        match self.clock.found() {
            // Each azimuth is to be received when it arrives.
            None | Some(FoundClock::Arrival) => return None,
            Some(_) => {}
        }
        let azimuths = (self.assembler.azimuths_left()? * BATCH_SHARE).min(BATCH);
        let per_azimuth_ns = self.radar.period_ns() as f64 / f64::from(self.radar.azimuth_samples);
        (azimuths >= 2.0).then(|| Duration::from_nanos((azimuths * per_azimuth_ns) as u64))
    }

    /// The scans that were left out.
    fn left_out(&self) -> u64 {
        let counters = self.assembler.counters();
        self.refused + counters.incomplete_sweeps + counters.broken_sweeps
    }
}

impl Radar {
    /// A radar that is connected to when it is first asked.
    pub fn new(settings: Settings) -> Self {
        Self {
            connection: Connection::new(&settings),
            messages: Messages::new(&settings),
            settings,
            sweeps: None,
            missing: 0,
            damaged: 0,
            left_out: 0,
        }
    }

    /// Begins the scans of a configuration, unless it is the one so far. One that makes no scans is passed over.
    fn configure(&mut self, radar: Configuration, room: usize) -> Result<(), StageError> {
        if self
            .sweeps
            .as_ref()
            .is_some_and(|sweeps| is_same(&sweeps.radar, &radar))
        {
            return Ok(());
        }
        let new = match Sweeps::new(radar, &self.settings) {
            Ok(new) => new,
            Err(error) => {
                tracing::warn!("the radar's configuration is passed over: {error}");
                return Ok(());
            }
        };
        let bytes = new.assembler.limits().bytes;
        if bytes > room {
            return Err(StageError::Input(format!(
                "the scans of the radar have {bytes} bytes now, {room} at the start of the run: start the run again"
            )));
        }
        self.replace(Some(new));
        Ok(())
    }

    /// How to wait for more: after a pause that is shorter than the time to the end of the scan, if the radar sends at all.
    fn wait(&self, limit: Duration, has_received: bool) -> Arrival {
        let pause = self.sweeps.as_ref().filter(|_| has_received);
        match pause.and_then(Sweeps::pause) {
            Some(pause) if pause < limit => Arrival::Later(pause),
            _ => Arrival::Nothing(limit),
        }
    }

    fn replace(&mut self, new: Option<Sweeps>) {
        if let Some(old) = mem::replace(&mut self.sweeps, new) {
            self.left_out += old.left_out();
        }
    }

    /// Handles what is in the parser up to the next complete scan; true if there is one.
    fn parse(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<bool, StageError> {
        while let Some(event) = self.messages.next() {
            match event {
                Event::Message(Message::Azimuth(azimuth)) => {
                    let sweeps = self.sweeps.as_mut();
                    let missing = sweeps.and_then(|sweeps| sweeps.add(azimuth, header, bytes));
                    if let Some(missing) = missing {
                        self.missing += missing as u64;
                        return Ok(true);
                    }
                }
                Event::Message(Message::Configuration(radar)) => {
                    self.configure(radar, bytes.len())?
                }
                Event::Message(_) => {}
                Event::Damaged {
                    reason,
                    skipped_bytes,
                } => {
                    self.damaged += 1;
                    // There may be thousands in a second.
                    if self.damaged.is_power_of_two() {
                        let so_far = self.damaged;
                        tracing::warn!(
                            skipped_bytes,
                            so_far,
                            "the radar's messages are damaged: {reason}"
                        );
                    }
                }
            }
        }
        Ok(false)
    }
}

impl Sensor for Radar {
    const HOP: StageId = StageId::RadarReplay;

    fn connection(&self) -> Option<BorrowedFd<'_>> {
        self.connection.socket()
    }

    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, StageError> {
        let mut has_received = false;
        for _ in 0..MAX_READS {
            if self.parse(header, bytes)? {
                return Ok(Arrival::Scan);
            }
            if self.messages.skipped_bytes() > MAX_SKIPPED_BYTES {
                self.connection.close("it does not speak Colossus");
            }
            match self.connection.receive(&mut self.messages) {
                Received::Bytes => has_received = true,
                Received::Opened => {
                    self.messages = Messages::new(&self.settings);
                    self.replace(None);
                }
                Received::Nothing(limit) => return Ok(self.wait(limit, has_received)),
            }
        }
        Ok(Arrival::Nothing(Duration::ZERO))
    }

    fn count(&self, counters: &mut StageCounters) {
        counters.missing_azimuths = self.missing;
        let left_out = self.sweeps.as_ref().map_or(0, Sweeps::left_out);
        counters.scans_left_out = self.left_out + left_out;
        counters.damaged_messages = self.damaged;
        counters.reconnections = self.connection.opened.saturating_sub(1);
    }
}

/// Returns whether two configurations make the same scans.
fn is_same(one: &Configuration, other: &Configuration) -> bool {
    let scans = |of: &Configuration| {
        let counts = [
            of.azimuth_samples,
            of.range_in_bins,
            of.encoder_size,
            of.rotation_mhz,
        ];
        (counts, of.range_resolution_m().to_bits())
    };
    scans(one) == scans(other)
}

/// The host's clock, ns since 1970.
fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.unwrap_or(Duration::ZERO).as_nanos() as i64
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_colossus::{ClockFormat, Constants, Powers};

    use super::*;
    use crate::Address;

    const START_NS: i64 = 1_700_000_000_000_000_000;
    const AZIMUTHS: u16 = 400;

    fn sweeps() -> Sweeps {
        let radar = Configuration {
            azimuth_samples: AZIMUTHS,
            bin_size: 438,
            range_in_bins: 16,
            encoder_size: 5600,
            rotation_mhz: 4000,
            ..Configuration::default()
        };
        let settings = Settings {
            address: Address::Tcp(String::new()),
            encoder_counts: 5600,
            silence: Duration::MAX,
            scans: None,
            constants: Constants::default(),
        };
        Sweeps::new(radar, &settings).unwrap()
    }

    /// Adds the azimuths of a turn, whose clock is set by `step_ns` in its middle; returns the missing azimuths of a complete scan.
    fn turn(sweeps: &mut Sweeps, start_ns: i64, step_ns: i64) -> Option<usize> {
        let (mut header, mut bytes) = (ScanHeader::default(), vec![0; 400 * 16]);
        let mut complete = None;
        for row in 0..AZIMUTHS {
            let set_ns = if row < AZIMUTHS / 2 { 0 } else { step_ns };
            let stamp_ns = start_ns + i64::from(row) * 625_000 + set_ns;
            let (seconds, split_seconds) = ClockFormat::default().fields(stamp_ns);
            let azimuth = Azimuth {
                sweep_counter: row,
                encoder: row * 14,
                seconds,
                split_seconds,
                powers: Powers::Eight(&[7; 16]),
            };
            complete = sweeps.add(azimuth, &mut header, &mut bytes).or(complete);
        }
        complete
    }

    #[test]
    fn a_scan_in_which_the_clock_is_set_back_is_left_out_and_counted() {
        let mut sweeps = sweeps();
        assert_eq!(turn(&mut sweeps, START_NS, 0), Some(0));
        assert_eq!(turn(&mut sweeps, START_NS + 250_000_000, -20_000_000), None);
        assert_eq!(sweeps.left_out(), 1);
        let later_ns = START_NS + 480_000_000;
        assert_eq!(turn(&mut sweeps, later_ns, 0), Some(0));
    }

    #[test]
    fn the_source_sleeps_at_most_half_of_the_time_to_the_end_of_a_scan() {
        let mut sweeps = sweeps();
        assert_eq!(turn(&mut sweeps, START_NS, 0), Some(0));
        let (mut header, mut bytes) = (ScanHeader::default(), vec![0; 400 * 16]);
        let mut pauses = 0;
        for row in 0..AZIMUTHS {
            let stamp_ns = START_NS + 250_000_000 + i64::from(row) * 625_000;
            let (seconds, split_seconds) = ClockFormat::default().fields(stamp_ns);
            let azimuth = Azimuth {
                sweep_counter: row,
                encoder: row * 14,
                seconds,
                split_seconds,
                powers: Powers::Eight(&[7; 16]),
            };
            sweeps.add(azimuth, &mut header, &mut bytes);
            let left = Duration::from_micros(625) * u32::from(AZIMUTHS - row);
            if let Some(pause) = sweeps.pause() {
                assert!(2 * pause <= left && pause <= Duration::from_micros(6250));
                pauses += 1;
            }
        }
        assert_eq!(pauses, AZIMUTHS - 3, "the last ones are awaited");
    }

    #[test]
    fn a_configuration_that_differs_in_unused_numbers_is_the_same() {
        let radar = sweeps().radar;
        let unused = Configuration {
            range_gain: f32::NAN,
            packet_rate: 9,
            ..radar
        };
        assert!(is_same(&radar, &unused));
        let other = Configuration {
            range_in_bins: 17,
            ..radar
        };
        assert!(!is_same(&radar, &other));
    }
}
