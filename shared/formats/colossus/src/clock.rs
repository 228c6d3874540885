//! The time of each azimuth, in a format that depends on the radar's software and network.

use std::{fmt, iter};

use crate::configuration::Configuration;
use crate::message::{Azimuth, KeptAzimuth, Powers};

const SECOND_NS: i64 = 1_000_000_000;
/// 2001-01-01 and 2101-01-01, s since 1970. A radar whose clock was never set counts from 1970 or
/// from 2000.
const YEARS_S: std::ops::Range<i64> = 978_307_200..4_133_980_800;
/// Azimuths for which the clock is looked for. Stamps may come in bursts of a packet.
const MAX_HELD: usize = 32;
/// The largest ratio of the time between azimuths to the time by the configured rotation. Units
/// differ by 1000.
const MAX_RATIO: f64 = 20.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    #[default]
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplitUnit {
    #[default]
    Nanoseconds,
    Microseconds,
}

impl SplitUnit {
    fn ns(self) -> i64 {
        match self {
            Self::Nanoseconds => 1,
            Self::Microseconds => 1_000,
        }
    }
}

/// The encoding of an azimuth's time. The default is what most radars send.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockFormat {
    pub order: ByteOrder,
    pub unit: SplitUnit,
}

impl fmt::Display for ClockFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.order, self.unit) {
            (ByteOrder::Little, SplitUnit::Nanoseconds) => "little-endian seconds and nanoseconds",
            (ByteOrder::Little, SplitUnit::Microseconds) => {
                "little-endian seconds and microseconds"
            }
            (ByteOrder::Big, SplitUnit::Nanoseconds) => "big-endian seconds and nanoseconds",
            (ByteOrder::Big, SplitUnit::Microseconds) => "big-endian seconds and microseconds",
        })
    }
}

impl ClockFormat {
    /// Returns [`Azimuth::seconds`] and [`Azimuth::split_seconds`] of a time in ns since 1970,
    /// which is rounded down to the unit.
    pub fn fields(self, stamp_ns: i64) -> ([u8; 4], [u8; 4]) {
        let seconds = stamp_ns.div_euclid(SECOND_NS).clamp(0, u32::MAX.into());
        let split = stamp_ns.rem_euclid(SECOND_NS) / self.unit.ns();
        let bytes = |number: i64| match self.order {
            ByteOrder::Little => (number as u32).to_le_bytes(),
            ByteOrder::Big => (number as u32).to_be_bytes(),
        };
        (bytes(seconds), bytes(split))
    }

    fn ns(self, azimuth: &Azimuth<'_>) -> i64 {
        let split = self.number(azimuth.split_seconds) * self.unit.ns();
        self.number(azimuth.seconds) * SECOND_NS + split
    }

    fn number(self, bytes: [u8; 4]) -> i64 {
        i64::from(match self.order {
            ByteOrder::Little => u32::from_le_bytes(bytes),
            ByteOrder::Big => u32::from_be_bytes(bytes),
        })
    }

    fn holds(self, azimuth: &Azimuth<'_>) -> bool {
        self.number(azimuth.split_seconds) * self.unit.ns() < SECOND_NS
    }

    fn is_unix(self, azimuth: &Azimuth<'_>) -> bool {
        YEARS_S.contains(&self.number(azimuth.seconds))
    }
}

/// The clock of a radar. Its `Display` is one sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoundClock {
    Unix(ClockFormat),
    /// The radar measures time from another start, such as its own. The host's time at the first
    /// azimuth is added.
    Uptime(ClockFormat),
    /// The radar's time does not advance as the radar turns. Azimuths have their times of arrival.
    Arrival,
}

impl fmt::Display for FoundClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unix(format) => write!(f, "The radar sends its time as {format}."),
            Self::Uptime(format) => write!(
                f,
                "The radar does not know the time: its {format} are counted from this host's time at the first azimuth."
            ),
            Self::Arrival => f.write_str(
                "The radar's time does not advance as it turns: azimuths have this host's time at which they arrive.",
            ),
        }
    }
}

/// Gives each azimuth its time. One clock per connection.
///
/// One azimuth does not determine the byte order and the unit of its time. The difference of two
/// does, because the configuration gives the time of the turn from one to the other. So the first
/// azimuth is held back until the second.
#[derive(Clone, Debug)]
pub struct RadarClock {
    radar: Configuration,
    found: Option<FoundClock>,
    /// Host's time minus radar's time; 0 if the radar has the time.
    offset_ns: i64,
    held: Vec<(KeptAzimuth, i64)>,
}

impl RadarClock {
    pub fn new(configuration: &Configuration) -> Self {
        Self {
            radar: *configuration,
            found: None,
            offset_ns: 0,
            held: Vec::new(),
        }
    }

    /// Returns the kind of clock; `None` until it is found. It changes from uptime to Unix if the
    /// radar learns the time.
    pub fn found(&self) -> Option<FoundClock> {
        self.found
    }

    /// Returns the azimuths that have a time now, in order, each with its time in ns since 1970. It
    /// is the azimuth given; none while it is held back; or those held back, and the one given.
    ///
    /// `arrived_ns` is the host's time, ns since 1970.
    pub fn stamp<'a>(
        &'a mut self,
        azimuth: Azimuth<'a>,
        arrived_ns: i64,
    ) -> impl Iterator<Item = (Azimuth<'a>, i64)> + 'a {
        match self.found {
            Some(_) => {
                // Those held back were returned when the clock was found.
                self.held.clear();
                self.learn(&azimuth);
            }
            None => self.find(&azimuth, arrived_ns),
        }
        let this: &Self = self;
        let held = this.held.iter().map(|(kept, ns)| (kept.azimuth(), *ns));
        let all = held.chain(iter::once((azimuth, arrived_ns)));
        this.found.into_iter().flat_map(move |found| {
            all.clone()
                .map(move |(azimuth, ns)| (azimuth, this.time_ns(found, &azimuth, ns)))
        })
    }

    fn time_ns(&self, found: FoundClock, azimuth: &Azimuth<'_>, arrived_ns: i64) -> i64 {
        match found {
            FoundClock::Unix(format) => format.ns(azimuth),
            FoundClock::Uptime(format) => format.ns(azimuth).saturating_add(self.offset_ns),
            FoundClock::Arrival => arrived_ns,
        }
    }

    /// A radar without the time may learn it. Its time then jumps, and must not be offset any more.
    fn learn(&mut self, azimuth: &Azimuth<'_>) {
        if let Some(FoundClock::Uptime(format)) = self.found
            && format.is_unix(azimuth)
        {
            self.found = Some(FoundClock::Unix(format));
        }
    }

    fn find(&mut self, azimuth: &Azimuth<'_>, arrived_ns: i64) {
        let of = |earlier: &KeptAzimuth| self.format(&earlier.azimuth(), azimuth, arrived_ns);
        let format = self.held.iter().find_map(|(earlier, _)| of(earlier));
        if let (Some(format), Some((first, first_arrived_ns))) = (format, self.held.first()) {
            self.offset_ns = first_arrived_ns.saturating_sub(format.ns(&first.azimuth()));
            self.found = Some(match format.is_unix(azimuth) {
                true => FoundClock::Unix(format),
                false => FoundClock::Uptime(format),
            });
        } else if self.held.len() == MAX_HELD {
            self.found = Some(FoundClock::Arrival);
        } else {
            let mut kept = KeptAzimuth::default();
            kept.keep(azimuth);
            self.held.push((kept, arrived_ns));
        }
    }

    /// Returns the format whose time between two azimuths is nearest to the time by the configured
    /// rotation; `None` if it is far from that in all.
    ///
    /// In the wrong byte order a fraction of a second advances at random, and in the wrong unit by
    /// 1000 times as much or as little. This is surer than whether the seconds are of these years:
    /// most numbers of 32 bits are, in either order.
    fn format(
        &self,
        earlier: &Azimuth<'_>,
        later: &Azimuth<'_>,
        arrived_ns: i64,
    ) -> Option<ClockFormat> {
        let counts = i32::from(later.encoder) - i32::from(earlier.encoder);
        let turn = i32::from(self.radar.encoder_size.max(1));
        let counts = f64::from(counts.rem_euclid(turn)).max(self.radar.step());
        let expected_ns = counts * self.radar.ns_per_count();
        let orders = [ByteOrder::Little, ByteOrder::Big];
        let units = [SplitUnit::Nanoseconds, SplitUnit::Microseconds];
        let formats = orders.map(|order| units.map(|unit| ClockFormat { order, unit }));
        let candidates = formats.into_iter().flatten().filter_map(|format| {
            let ns = format.ns(later) - format.ns(earlier);
            let apart = (ns as f64 / expected_ns).ln().abs();
            let fits = format.holds(earlier) && format.holds(later) && apart < MAX_RATIO.ln();
            // Where bytes are the same in both orders, the years decide, then the host's time.
            let from_host_ns = format.ns(later).abs_diff(arrived_ns);
            fits.then_some((apart, !format.is_unix(later), from_host_ns, format))
        });
        let nearest = candidates.min_by(|a, b| {
            let nearest = a.0.total_cmp(&b.0);
            nearest.then((a.1, a.2).cmp(&(b.1, b.2)))
        });
        nearest.map(|(.., format)| format)
    }
}

impl<'a> Azimuth<'a> {
    /// An azimuth with a byte per bin at this time, ns since 1970, in a radar's format.
    pub fn at(encoder: u16, stamp_ns: i64, format: ClockFormat, powers: &'a [u8]) -> Self {
        let (seconds, split_seconds) = format.fields(stamp_ns);
        Self {
            sweep_counter: 0,
            encoder,
            seconds,
            split_seconds,
            powers: Powers::Eight(powers),
        }
    }
}
