//! Where the azimuths of each scan are.

use std::{
    collections::{BTreeSet, VecDeque},
    hash::{DefaultHasher, Hash, Hasher},
    mem,
    ops::RangeInclusive,
};

use gyre_colossus::{Azimuth, Counters, FoundClock, RadarClock, SweepAssembler};
use gyre_geometry::{OwnedScan, ScanLimits};
use gyre_ros2_messages::radar::DescribedRadar;

use crate::bags::{
    Message, RecordingError,
    bag::{Bag, Key},
    topics::{Kind, Topics, azimuths},
};

/// Turns among which one of the same time is looked for.
const RECENT: usize = 8;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    pub message: Key,
    /// Number of the azimuth in its message.
    pub row: u32,
}

#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// The azimuth before its first one, which shows the assembler where the scan begins.
    pub start: Place,
    /// The azimuth that completes it.
    pub end: Place,
    pub spans: RangeInclusive<u32>,
    pub stamp_ns: i64,
    pub logged_ns: i64,
    /// Why the message of a whole turn cannot be decoded.
    pub damage: Option<String>,
}

pub(super) struct Index {
    pub entries: Vec<Entry>,
    pub limits: ScanLimits,
    /// The clock from a scan on.
    clocks: Vec<(usize, RadarClock)>,
    counters: Counters,
    /// Messages of turns that others have too.
    pub repeated: BTreeSet<Key>,
    damaged_messages: u64,
    first_damage: Option<String>,
    /// Azimuths in those that can be.
    azimuths: u64,
}

impl Index {
    /// Reads a bag from beginning to end, and keeps where each scan is.
    pub fn of(
        bag: &mut Bag,
        topics: &Topics,
        described: &DescribedRadar,
        assembler: SweepAssembler,
    ) -> Result<Self, RecordingError> {
        let mut indexing = Indexing::new(topics.scans.kind, described, assembler);
        let add = |_: &Bag, key: Key, message: &Message| {
            indexing.add(key, message);
            true
        };
        bag.read_in_order(|channel| channel.topic == topics.scans.name, add)?;
        indexing.index.counters = indexing.assembler.counters();
        Ok(indexing.index)
    }

    /// Returns the clock as it was at the beginning of a scan.
    pub fn clock(&self, index: usize) -> RadarClock {
        let later = self.clocks.partition_point(|(first, _)| *first <= index);
        let (_, clock) = &self.clocks[later.saturating_sub(1)];
        clock.clone()
    }

    /// Returns why no scan on a topic can be read; `None` if one can be.
    pub fn why_none_can_be_read(&self, topic: &str) -> Option<String> {
        if self.entries.iter().any(|entry| entry.damage.is_none()) {
            return None;
        }
        let (azimuths, notes) = (self.azimuths, self.notes());
        let notes = notes.iter().map(|note| note.trim_end_matches('.'));
        let why: String = notes.map(|note| format!("; {note}")).collect();
        Some(format!(
            "has no complete turn of the radar on {topic} that can be read, and {azimuths} azimuths{why}"
        ))
    }

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
                self.repeated.len() as u64,
                "scans are left out: the bag has each of them twice, with one time.",
            ),
            (self.damaged_messages, &damaged),
            (
                lost.missing_azimuths,
                "azimuths are missing; their powers are zero.",
            ),
            (
                lost.incomplete_sweeps + lost.broken_sweeps,
                "turns are left out: more than half of their azimuths are missing, or their times do not advance as the radar turns, as where its clock was set.",
            ),
            (
                lost.repeated_azimuths + lost.invalid_azimuths + lost.surplus_azimuths,
                "azimuths are left out: they have the encoder value of the one before, or one beyond a turn (dataset.encoder_counts), or are more than the radar has.",
            ),
            (
                lost.cut_rows,
                "azimuths have more bins than the radar says, and are cut.",
            ),
        ];
        let losses = losses.into_iter().filter(|(count, _)| *count > 0);
        notes.extend(losses.map(|(count, what)| format!("{count} {what}")));
        notes
    }
}

struct Indexing {
    kind: Kind,
    described: DescribedRadar,
    clock: RadarClock,
    found: Option<FoundClock>,
    assembler: SweepAssembler,
    scan: OwnedScan,
    /// Azimuths that the clock holds back.
    held: Vec<Place>,
    previous: Option<Place>,
    start: Option<Place>,
    /// The spans of its azimuths so far.
    spans: RangeInclusive<u32>,
    recent: VecDeque<u64>,
    index: Index,
}

impl Indexing {
    fn new(kind: Kind, described: &DescribedRadar, assembler: SweepAssembler) -> Self {
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
            spans: 0..=0,
            recent: VecDeque::new(),
            index: Index {
                entries: Vec::new(),
                limits,
                clocks: vec![(0, clock.clone())],
                counters: Counters::default(),
                repeated: BTreeSet::new(),
                damaged_messages: 0,
                first_damage: None,
                azimuths: 0,
            },
            clock,
        }
    }

    fn add(&mut self, key: Key, message: &Message) {
        let mut place = Place {
            message: key,
            row: 0,
        };
        let (described, mut is_repeated) = (self.described, None);
        let added = azimuths(self.kind, message, &described, |azimuth, received_ns| {
            if *is_repeated.get_or_insert_with(|| self.is_repeated(key, message, &azimuth)) {
                return;
            }
            self.add_azimuth(place, azimuth, received_ns, message.log_ns);
            place.row += 1;
        });
        if let Err(reason) = added {
            let first = &mut self.index.first_damage;
            first.get_or_insert_with(|| reason.clone());
            self.add_damaged(place, message.log_ns, reason);
        }
    }

    /// Returns whether the turn that begins with this azimuth has the time of one before, or its
    /// bytes if the radar has no clock.
    fn is_repeated(&mut self, key: Key, message: &Message, first: &Azimuth<'_>) -> bool {
        if matches!(self.kind, Kind::Azimuths(_)) {
            return false;
        }
        let mut turn = DefaultHasher::new();
        match (first.seconds, first.split_seconds) {
            ([0, 0, 0, 0], [0, 0, 0, 0]) => message.data.hash(&mut turn),
            time => (time, first.encoder).hash(&mut turn),
        }
        let turn = turn.finish();
        if self.recent.contains(&turn) {
            return self.index.repeated.insert(key);
        }
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(turn);
        false
    }

    fn add_azimuth(
        &mut self,
        place: Place,
        azimuth: Azimuth<'_>,
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
            let start = *self.start.get_or_insert_with(|| {
                self.spans = only(here);
                here
            });
            self.spans = joined(&self.spans, here);
            let invalid = self.assembler.counters().invalid_azimuths;
            if let Some(sweep) = self
                .assembler
                .add(&azimuth, stamp_ns, &mut self.scan.slot())
            {
                self.index.entries.push(Entry {
                    start,
                    end: here,
                    spans: self.spans.clone(),
                    stamp_ns: sweep.geometry.stamp_ns,
                    logged_ns,
                    damage: None,
                });
                let start = self.previous.unwrap_or(here);
                (self.start, self.spans) = (Some(start), joined(&only(start), here));
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
    fn add_damaged(&mut self, place: Place, logged_ns: i64, reason: String) {
        self.index.damaged_messages += 1;
        if matches!(self.kind, Kind::BScans | Kind::Images) {
            self.index.entries.push(Entry {
                start: place,
                end: place,
                spans: only(place),
                stamp_ns: logged_ns,
                logged_ns,
                damage: Some(reason),
            });
        }
    }
}

fn only(place: Place) -> RangeInclusive<u32> {
    place.message.span..=place.message.span
}

fn joined(spans: &RangeInclusive<u32>, place: Place) -> RangeInclusive<u32> {
    let span = place.message.span;
    span.min(*spans.start())..=span.max(*spans.end())
}
