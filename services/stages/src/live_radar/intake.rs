//! Azimuths and configurations of a live source to scans, with counts, whatever the transport.

use std::{fmt::Display, time::Duration};

use gyre_colossus::{Azimuth, BadConfiguration, Configuration};
use gyre_contract::{ScanHeader, control::Received};
use gyre_datasets::DatasetOptions;
use thiserror::Error;

use crate::live_radar::{
    clock_watch::ClockWatch,
    scan_assembly::{Complete, ScanAssembly},
    turn_counter::TurnCounter,
};

pub struct Intake {
    constants: DatasetOptions,
    /// `None` until the radar has sent its configuration.
    scans: Option<ScanAssembly>,
    turns: TurnCounter,
    clock: ClockWatch,
    /// The counts since the start of the run, without the counts of turns and connections.
    counts: Received,
    due_ns: Option<i64>,
}

/// A configuration whose scans do not fit into this run.
#[derive(Debug, Error)]
pub enum NoScans {
    #[error(transparent)]
    Bad(#[from] BadConfiguration),
    #[error(
        "the scans of the radar have {bytes} bytes now, {room} at the start of the run: start the run again"
    )]
    TooLarge { bytes: usize, room: usize },
}

impl Intake {
    pub fn new(constants: DatasetOptions) -> Self {
        Self {
            constants,
            scans: None,
            turns: TurnCounter::resume(None, 0),
            clock: ClockWatch::default(),
            counts: Received::default(),
            due_ns: None,
        }
    }

    /// Begins the scans of a configuration of at most `room` bytes; false if it is not new.
    pub fn configure(&mut self, radar: Configuration, room: usize) -> Result<bool, NoScans> {
        if self.scans.as_ref().is_some_and(|scans| scans.is_of(&radar)) {
            return Ok(false);
        }
        let new = ScanAssembly::new(radar, self.constants)?;
        let bytes = new.assembler.limits().bytes;
        if bytes > room {
            return Err(NoScans::TooLarge { bytes, room });
        }
        self.turns.configure(radar.period_ns());
        self.scans = Some(new);
        Ok(true)
    }

    pub fn is_configured(&self) -> bool {
        self.scans.is_some()
    }

    pub fn restart(&mut self) {
        self.scans = None;
    }

    /// Adds an azimuth that arrived at `arrival_ns` (since 1970); true if a scan is complete.
    /// Without a configuration it is dropped.
    pub fn add(
        &mut self,
        azimuth: Azimuth<'_>,
        arrival_ns: i64,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> bool {
        let scans = self.scans.as_mut();
        let scan =
            scans.and_then(|scans| scans.add(azimuth, arrival_ns, &mut self.turns, header, bytes));
        if let Some(Complete {
            missing,
            due_ns,
            stamp_ns,
        }) = scan
        {
            self.counts.missing_azimuths += missing as u64;
            self.due_ns = due_ns;
            if let Some(stamp_ns) = stamp_ns {
                self.clock.add(stamp_ns, arrival_ns);
            }
        }
        scan.is_some()
    }

    pub fn damaged(&mut self, reason: impl Display, skipped_bytes: usize) {
        self.counts.damaged_messages += 1;
        let so_far = self.counts.damaged_messages;
        // There may be thousands in a second.
        if so_far.is_power_of_two() {
            tracing::warn!(
                skipped_bytes,
                so_far,
                "the radar's messages are damaged: {reason}"
            );
        }
    }

    pub fn pause(&self) -> Option<Duration> {
        self.scans.as_ref().and_then(ScanAssembly::pause)
    }

    /// Returns the time when the last scan was complete by the radar's clock, in `CLOCK_MONOTONIC`,
    /// ns; `None`: not known.
    pub fn due_ns(&self) -> Option<i64> {
        self.due_ns
    }

    pub fn resume(&mut self, before: Received) {
        self.turns = TurnCounter::resume(before.last_scan, before.scans_left_out);
        self.clock = ClockWatch::resume(before.clock);
        self.counts = before;
    }

    pub fn received(&self) -> Received {
        // Whether the turn of the newest azimuth can still become a scan.
        let scans = self.scans.as_ref();
        let is_open = scans.is_some_and(|scans| scans.assembler.is_open());
        Received {
            scans_left_out: self.turns.left_out(is_open),
            last_scan: self.turns.last(),
            clock: self.clock.state(),
            ..self.counts
        }
    }
}

#[cfg(test)]
mod tests {
    use gyre_colossus::{
        ByteOrder, ClockFormat, Datagrams, Event, Message, asterix::write_azimuth,
    };

    use super::*;

    const START_NS: i64 = 1_700_000_000_000_000_000;
    const AZIMUTHS: u16 = 400;
    /// In two datagrams.
    const BINS: u16 = 2000;
    const ENCODER: u16 = 5600;
    const ROOM: usize = AZIMUTHS as usize * BINS as usize;

    /// The datagrams of each turn of a radar, two for each azimuth.
    fn turns(count: u16) -> Vec<Vec<Vec<u8>>> {
        let radar = Configuration::usual(AZIMUTHS, BINS);
        let clock = ClockFormat {
            order: ByteOrder::Big,
            ..ClockFormat::default()
        };
        let (mut number, mut stamp_ns) = (0, START_NS);
        let mut turns = vec![Vec::new(); usize::from(count)];
        for sent in &mut turns {
            for row in 0..AZIMUTHS {
                let azimuth = Azimuth::at(row * 14, stamp_ns, clock, &[7; BINS as usize]);
                let mut send = |datagram: &[u8]| sent.push(datagram.to_vec());
                write_azimuth(&radar, &azimuth, &mut number, &mut send);
                stamp_ns += 625_000;
            }
        }
        turns
    }

    /// Returns the number of scans of these datagrams, and the counts.
    fn received(sent: &[Vec<u8>]) -> (usize, Received) {
        let mut parser = Datagrams::new(ENCODER);
        let mut intake = Intake::new(DatasetOptions::default());
        let (mut header, mut bytes) = (ScanHeader::default(), vec![0; ROOM]);
        let mut scans = 0;
        for datagram in sent {
            parser.space()[..datagram.len()].copy_from_slice(datagram);
            parser.filled(datagram.len());
            while let Some(event) = parser.next() {
                match event {
                    Event::Message(Message::Azimuth(azimuth)) => {
                        let is_scan = intake.add(azimuth, START_NS, &mut header, &mut bytes);
                        scans += usize::from(is_scan);
                    }
                    Event::Message(Message::Configuration(radar)) => {
                        assert!(intake.configure(radar, ROOM).unwrap());
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
        (scans, intake.received())
    }

    #[test]
    fn lost_datagrams_are_counted_by_their_azimuths_and_turns_and_doubled_ones_are_not() {
        let mut turns = turns(5);
        assert!(turns.iter().all(|sent| sent.len() == 800));
        // Doubled right away, and after an azimuth.
        for at in [700, 301] {
            let again = turns[2][at].clone();
            turns[2].insert(at + 1, again.clone());
            turns[2].insert(at + 5, again);
        }
        let (scans, whole) = received(&turns.concat());
        assert_eq!((scans, whole.missing_azimuths), (5, 0));
        assert_eq!((whole.scans_left_out, whole.damaged_messages), (0, 0));
        // The first part of an azimuth, the second one of another, both of a third.
        for at in [601, 600, 401, 20] {
            turns[1].remove(at);
        }
        turns[3].clear();
        let (scans, lossy) = received(&turns.concat());
        assert_eq!((scans, lossy.missing_azimuths), (4, 3));
        assert_eq!((lossy.scans_left_out, lossy.damaged_messages), (1, 0));
    }
}
