//! Where the azimuths of each scan are.

use std::mem;

use gyre_colossus::{Counters, FoundClock, RadarClock, SweepAssembler};
use gyre_radar::{OwnedScan, ScanLimits};

use crate::{
    BagError,
    azimuths::{Described, azimuths},
    bag::Bag,
    reading::Message,
    topics::{Kind, Topics},
};

/// Place of an azimuth in a bag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    pub span: u32,
    /// Number of the message in its span, of those with scans.
    pub message: u32,
    /// Number of the azimuth in its message.
    pub row: u32,
}

/// A scan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// The azimuth before its first one, from which the assembler sees where it begins.
    pub start: Place,
    /// The azimuth that completes it.
    pub end: Place,
    pub stamp_ns: i64,
    pub logged_ns: i64,
    /// A whole turn in a message that cannot be decoded.
    pub is_damaged: bool,
}

/// The scans of a bag, in order.
pub(super) struct Index {
    pub entries: Vec<Entry>,
    pub limits: ScanLimits,
    /// The clock from a scan on.
    clocks: Vec<(usize, RadarClock)>,
    counters: Counters,
    /// Messages that cannot be decoded, and spans that cannot be read.
    damaged_messages: u64,
    damaged_spans: u64,
    /// Why the first of these messages cannot be decoded.
    first_damage: Option<String>,
    /// Azimuths in those that can be.
    azimuths: u64,
}

impl Index {
    /// Reads a bag from beginning to end, and keeps where each scan is.
    pub fn of(
        bag: &mut Bag,
        topics: &Topics,
        described: &Described,
        assembler: SweepAssembler,
    ) -> Result<Self, BagError> {
        let mut indexing = Indexing::new(topics.scans.kind, described, assembler);
        for span in 0..bag.spans.len() {
            match bag.read(span, |channel| channel.topic == topics.scans.name) {
                Ok(messages) => indexing.add(span as u32, &messages),
                Err(BagError::Damaged { .. }) => indexing.index.damaged_spans += 1,
                Err(error) => return Err(error),
            }
        }
        Ok(indexing.finish())
    }

    /// Returns the clock as it was at the beginning of a scan.
    pub fn clock(&self, index: usize) -> RadarClock {
        let later = self.clocks.partition_point(|(first, _)| *first <= index);
        let (_, clock) = &self.clocks[later.saturating_sub(1)];
        clock.clone()
    }

    /// Returns why no scan on a topic can be read; `None` if one can be.
    pub fn why_none_can_be_read(&self, topic: &str) -> Option<String> {
        if self.entries.iter().any(|entry| !entry.is_damaged) {
            return None;
        }
        let (lost, azimuths) = (&self.counters, self.azimuths);
        let broken = lost.broken_sweeps;
        Some(match &self.first_damage {
            Some(reason) if azimuths == 0 => {
                format!("has messages on {topic}, of which none can be decoded: {reason}")
            }
            _ if azimuths == 0 => format!("has no messages on {topic} that can be read"),
            _ if broken > 0 => format!(
                "has {azimuths} azimuths on {topic}, but their times do not advance as the radar turns, by its encoder and its rotation"
            ),
            _ if lost.invalid_azimuths > 0 => format!(
                "has {azimuths} azimuths on {topic}, of which {} have encoder values beyond a turn: set dataset.encoder_counts",
                lost.invalid_azimuths
            ),
            _ => format!(
                "has no complete turn of the radar on {topic}: {azimuths} azimuths, {} turns of which more than half is missing",
                lost.incomplete_sweeps
            ),
        })
    }

    /// Returns what was found of the times, and what is missing: whole sentences.
    pub fn notes(&self) -> Vec<String> {
        let found = self.clocks.iter().filter_map(|(_, clock)| clock.found());
        let mut notes: Vec<String> = found.map(|found| found.to_string()).collect();
        let lost = &self.counters;
        let damaged = format!(
            "messages with scans cannot be decoded, and are skipped (the first: {}).",
            self.first_damage.as_deref().unwrap_or_default()
        );
        let losses: [(u64, &str); 6] = [
            (
                self.damaged_spans,
                "damaged parts of the bag are skipped, with all that is in them.",
            ),
            (self.damaged_messages, &damaged),
            (
                lost.missing_azimuths,
                "azimuths are missing; their powers are zero.",
            ),
            (
                lost.incomplete_sweeps + lost.broken_sweeps,
                "turns are left out: more than half of their azimuths are missing, or the radar's clock was set.",
            ),
            (
                lost.repeated_azimuths + lost.invalid_azimuths + lost.surplus_azimuths,
                "azimuths are left out: they have the encoder value of the one before, or one beyond a turn, or are more than the radar has.",
            ),
            (
                lost.cut_rows,
                "azimuths have more bins than the radar says, and are cut.",
            ),
        ];
        for (count, what) in losses {
            if count > 0 {
                notes.push(format!("{count} {what}"));
            }
        }
        notes
    }
}

/// An index that is being made.
struct Indexing {
    kind: Kind,
    described: Described,
    clock: RadarClock,
    found: Option<FoundClock>,
    assembler: SweepAssembler,
    scan: OwnedScan,
    /// Azimuths that the clock holds back.
    held: Vec<Place>,
    previous: Option<Place>,
    /// The start of the next scan.
    start: Option<Place>,
    index: Index,
}

impl Indexing {
    fn new(kind: Kind, described: &Described, assembler: SweepAssembler) -> Self {
        let (limits, clock) = (assembler.limits(), RadarClock::new(&described.radar));
        Self {
            kind,
            described: *described,
            found: None,
            scan: OwnedScan::with_limits(limits),
            assembler,
            held: Vec::new(),
            previous: None,
            start: None,
            index: Index {
                entries: Vec::new(),
                limits,
                clocks: vec![(0, clock.clone())],
                counters: Counters::default(),
                damaged_messages: 0,
                damaged_spans: 0,
                first_damage: None,
                azimuths: 0,
            },
            clock,
        }
    }

    fn add(&mut self, span: u32, messages: &[Message]) {
        for (number, message) in messages.iter().enumerate() {
            let mut place = Place {
                span,
                message: number as u32,
                row: 0,
            };
            let described = self.described;
            let added = azimuths(self.kind, message, &described, |azimuth, received_ns| {
                self.add_azimuth(place, azimuth, received_ns, message.log_ns);
                place.row += 1;
            });
            if let Err(reason) = added {
                self.index.first_damage.get_or_insert(reason);
                self.add_damaged(place, message.log_ns);
            }
        }
    }

    fn add_azimuth(
        &mut self,
        place: Place,
        azimuth: gyre_colossus::Azimuth<'_>,
        received_ns: i64,
        logged_ns: i64,
    ) {
        self.index.azimuths += 1;
        self.held.push(place);
        let mut released = self.held.iter();
        for (azimuth, stamp_ns) in self.clock.stamp(azimuth, received_ns) {
            let Some(here) = released.next().copied() else {
                break;
            };
            let start = *self.start.get_or_insert(here);
            let invalid = self.assembler.counters().invalid_azimuths;
            if let Some(sweep) = self.assembler.add(&azimuth, stamp_ns, self.scan.slot()) {
                self.index.entries.push(Entry {
                    start,
                    end: here,
                    stamp_ns: sweep.geometry.stamp_ns,
                    logged_ns,
                    is_damaged: false,
                });
                self.start = Some(self.previous.unwrap_or(here));
            }
            // From one without a place in a turn nothing is seen of where the next one begins.
            if self.assembler.counters().invalid_azimuths == invalid {
                self.previous = Some(here);
            }
        }
        if self.clock.found().is_some() {
            self.held.clear();
        }
        self.keep_clock();
    }

    /// Keeps the clock where it has changed.
    fn keep_clock(&mut self) {
        if self.clock.found() == self.found {
            return;
        }
        let before = mem::replace(&mut self.found, self.clock.found());
        match (before, self.index.entries.len()) {
            (None, 0) => self.index.clocks = vec![(0, self.clock.clone())],
            // The scan that has begun is read with the clock before, which changes in it again.
            (_, scans) => self.index.clocks.push((scans + 1, self.clock.clone())),
        }
    }

    /// A message that is a whole turn is a scan that cannot be read.
    fn add_damaged(&mut self, place: Place, logged_ns: i64) {
        self.index.damaged_messages += 1;
        if matches!(self.kind, Kind::BScans | Kind::Images) {
            self.index.entries.push(Entry {
                start: place,
                end: place,
                stamp_ns: logged_ns,
                logged_ns,
                is_damaged: true,
            });
        }
    }

    fn finish(mut self) -> Index {
        self.index.counters = self.assembler.counters();
        self.index
    }
}
