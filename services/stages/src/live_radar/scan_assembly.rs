//! The assembly of azimuths to scans, for one connection to a radar.

use std::time::Duration;

use gyre_colossus::{
    Azimuth, BadConfiguration, Configuration, FoundClock, RadarClock, SweepAssembler,
};
use gyre_contract::{ScanHeader, control::LastScan};
use gyre_datasets::DatasetOptions;
use gyre_transport::clock;

use crate::live_radar::{read_delay::ReadDelay, turn_counter::TurnCounter};

/// The most azimuths that are read at once. The buffers of sockets hold many more.
const BATCH: f64 = 10.0;
/// The part of the azimuths up to the end of a turn: the radar may turn faster than configured.
const BATCH_SHARE: f64 = 0.5;

pub struct Complete {
    /// Azimuths that are missing from the scan.
    pub missing: usize,
    /// The time of completion by the radar's clock, `CLOCK_MONOTONIC`, ns, where that is known.
    pub due_ns: Option<i64>,
    /// The stamp of its last azimuth, ns; `None` if the radar has no clock, or one of a different
    /// pace than this host's.
    pub stamp_ns: Option<i64>,
}

pub struct ScanAssembly {
    radar: Configuration,
    clock: RadarClock,
    pub assembler: SweepAssembler,
    delay: ReadDelay,
    is_clock_logged: bool,
    is_delay_logged: bool,
}

impl ScanAssembly {
    pub fn new(radar: Configuration, constants: DatasetOptions) -> Result<Self, BadConfiguration> {
        Ok(Self {
            clock: RadarClock::new(&radar),
            assembler: SweepAssembler::new(&radar, constants)?,
            delay: ReadDelay::default(),
            radar,
            is_clock_logged: false,
            is_delay_logged: false,
        })
    }

    /// Adds an azimuth with its time of arrival, ns since 1970; returns whether a scan is complete.
    pub fn add(
        &mut self,
        azimuth: Azimuth<'_>,
        arrival_ns: i64,
        turns: &mut TurnCounter,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Option<Complete> {
        let at_ns = clock::now_ns();
        let mut complete = None;
        for (azimuth, stamp_ns) in self.clock.stamp(azimuth, arrival_ns) {
            let fraction = f64::from(azimuth.encoder) / f64::from(self.radar.encoder_size);
            let is_start = self.assembler.is_first(azimuth.encoder);
            turns.note(LastScan { stamp_ns, at_ns }, fraction.fract(), is_start);
            complete = self
                .assembler
                .add(&azimuth, stamp_ns, &mut header.slot(bytes));
            if complete.is_some() {
                break;
            }
        }
        self.log_clock();
        let sweep = complete?;
        header.set_geometry(&sweep.geometry);
        let last_ns = header.slot(bytes).stamp_ns[sweep.geometry.azimuths - 1];
        let due_ns = self.due_ns(last_ns, at_ns);
        // A clock that was set back in the middle of a sweep: no later stage accepts such times.
        if let Some(Err(error)) = header.view(bytes).map(|scan| scan.check_times()) {
            tracing::warn!("a scan is left out: {error}");
            return None;
        }
        turns.add(LastScan {
            stamp_ns: sweep.geometry.stamp_ns,
            at_ns,
        });
        Some(Complete {
            missing: sweep.missing,
            due_ns,
            stamp_ns: due_ns.map(|_| last_ns),
        })
    }

    fn due_ns(&mut self, last_ns: i64, at_ns: i64) -> Option<i64> {
        if self.clock.found() == Some(FoundClock::Arrival) {
            return None;
        }
        let due_ns = self.delay.add(last_ns, at_ns);
        if let (None, false, Some(pace)) = (due_ns, self.is_delay_logged, self.delay.pace()) {
            self.is_delay_logged = true;
            tracing::info!(
                "The radar's clock advances {:.2} times as fast as this host's: latencies are those from the reading of a scan.",
                1.0 / pace
            );
        }
        due_ns
    }

    fn log_clock(&mut self) {
        if let (false, Some(found)) = (self.is_clock_logged, self.clock.found()) {
            self.is_clock_logged = true;
            tracing::info!("{found}");
            if found == FoundClock::Arrival {
                tracing::info!(
                    "When a scan was complete is not known: latencies are those from its reading."
                );
            }
        }
    }

    /// Returns the pause until a scan can be complete, if only a few azimuths are missing.
    pub fn pause(&self) -> Option<Duration> {
        // Where stamps are the times of arrival, each azimuth is read when it arrives.
        self.clock.found().filter(|it| *it != FoundClock::Arrival)?;
        let azimuths = (self.assembler.azimuths_left()? * BATCH_SHARE).min(BATCH);
        let per_azimuth_ns = self.radar.period_ns() as f64 / f64::from(self.radar.azimuth_samples);
        (azimuths >= 2.0).then(|| Duration::from_nanos((azimuths * per_azimuth_ns) as u64))
    }

    pub fn is_of(&self, radar: &Configuration) -> bool {
        let scans = |of: &Configuration| {
            let counts = [
                of.azimuth_samples,
                of.range_in_bins,
                of.encoder_size,
                of.rotation_mhz,
            ];
            (counts, of.range_resolution_m().to_bits())
        };
        scans(&self.radar) == scans(radar)
    }
}

#[cfg(test)]
mod tests {
    use gyre_colossus::ClockFormat;

    use super::*;

    const START_NS: i64 = 1_700_000_000_000_000_000;
    const AZIMUTHS: u16 = 400;

    struct Source {
        scans: ScanAssembly,
        turns: TurnCounter,
        header: ScanHeader,
        bytes: Vec<u8>,
    }

    impl Source {
        fn new() -> Self {
            let radar = Configuration::usual(AZIMUTHS, 16);
            let mut turns = TurnCounter::resume(None, 0);
            turns.configure(250_000_000);
            Self {
                scans: ScanAssembly::new(radar, DatasetOptions::default()).unwrap(),
                turns,
                header: ScanHeader::default(),
                bytes: vec![0; 400 * 16],
            }
        }

        /// Adds an azimuth with this time; returns the missing ones of the scan that it completes.
        fn add(&mut self, row: u16, stamp_ns: i64) -> Option<usize> {
            let azimuth = Azimuth::at(row * 14, stamp_ns, ClockFormat::default(), &[7; 16]);
            let (header, bytes) = (&mut self.header, &mut self.bytes);
            let scan = (self.scans).add(azimuth, stamp_ns, &mut self.turns, header, bytes);
            scan.map(|it| it.missing)
        }

        /// Adds a turn, in whose middle the clock is set by `step_ns`.
        fn turn(&mut self, start_ns: i64, step_ns: i64) -> Option<usize> {
            let mut complete = None;
            for row in 0..AZIMUTHS {
                let set_ns = if row < AZIMUTHS / 2 { 0 } else { step_ns };
                let stamp_ns = start_ns + i64::from(row) * 625_000 + set_ns;
                complete = self.add(row, stamp_ns).or(complete);
            }
            complete
        }
    }

    #[test]
    fn a_scan_in_which_the_clock_is_set_back_is_left_out_and_counted() {
        let mut source = Source::new();
        let mut turn = |start_ns, step_ns| {
            let missing = source.turn(start_ns, step_ns);
            (
                missing,
                source.turns.left_out(source.scans.assembler.is_open()),
            )
        };
        assert_eq!(turn(START_NS, 0), (Some(0), 0));
        assert_eq!(turn(START_NS + 250_000_000, -20_000_000), (None, 1));
        assert_eq!(turn(START_NS + 480_000_000, 0), (Some(0), 1));
    }

    #[test]
    fn the_source_sleeps_at_most_half_of_the_time_to_the_end_of_a_scan() {
        let mut source = Source::new();
        assert_eq!(source.turn(START_NS, 0), Some(0));
        let mut pauses = 0;
        for row in 0..AZIMUTHS {
            let stamp_ns = START_NS + 250_000_000 + i64::from(row) * 625_000;
            source.add(row, stamp_ns);
            let left = Duration::from_micros(625) * u32::from(AZIMUTHS - row);
            if let Some(pause) = source.scans.pause() {
                assert!(2 * pause <= left && pause <= Duration::from_micros(6250));
                pauses += 1;
            }
        }
        assert_eq!(pauses, AZIMUTHS - 3, "the last ones are awaited");
    }

    #[test]
    fn a_configuration_that_differs_in_unused_numbers_is_the_same() {
        let scans = Source::new().scans;
        let radar = scans.radar;
        let unused = Configuration {
            range_gain: f32::NAN,
            packet_rate: 9,
            ..radar
        };
        assert!(scans.is_of(&unused));
        let other = Configuration {
            range_in_bins: 17,
            ..radar
        };
        assert!(!scans.is_of(&other));
    }
}
