//! A radar that turns.

use gyre_colossus::{
    Azimuth, ClockFormat, Configuration, Counters, Event, Parser, RadarClock, Sweep, SweepAssembler,
};
use gyre_datasets::DatasetOptions;
use gyre_geometry::OwnedScan;

/// 2019-01-10 14:37:26 UTC, ns.
pub const START_NS: i64 = 1_547_131_046_353_776_001;

/// A small radar with the encoder of Oxford's or FoMo's.
pub fn configuration(encoder_size: u16, bins: u16) -> Configuration {
    Configuration {
        encoder_size,
        ..Configuration::usual(400, bins)
    }
}

/// An azimuth that owns its powers.
#[derive(Clone, Debug, PartialEq)]
pub struct SentAzimuth {
    pub encoder: u16,
    pub stamp_ns: i64,
    pub powers: Vec<u8>,
}

impl SentAzimuth {
    pub fn azimuth(&self, format: ClockFormat) -> Azimuth<'_> {
        Azimuth::at(self.encoder, self.stamp_ns, format, &self.powers)
    }
}

/// The azimuths of whole turns. Rows step by 14 counts, and are 0.625 ms apart.
pub fn turns(
    configuration: &Configuration,
    first: u16,
    start_ns: i64,
    turns: usize,
) -> Vec<SentAzimuth> {
    let samples = usize::from(configuration.azimuth_samples);
    let row = |k: usize| SentAzimuth {
        encoder: first + 14 * (k % samples) as u16,
        stamp_ns: start_ns + 625_000 * k as i64 + (k as i64 * 37) % 11,
        powers: (0..usize::from(configuration.range_in_bins))
            .map(|bin| (k * 31 + bin * 7 + k * bin / 5) as u8)
            .collect(),
    };
    (0..turns * samples).map(row).collect()
}

/// Scans from azimuths.
pub struct Assembly {
    pub assembler: SweepAssembler,
    slot: OwnedScan,
    pub sweeps: Vec<(Sweep, OwnedScan)>,
}

impl Assembly {
    pub fn new(configuration: &Configuration) -> Self {
        let none = DatasetOptions::default();
        let assembler = SweepAssembler::new(configuration, none).unwrap();
        let mut slot = OwnedScan::with_limits(assembler.limits());
        // Earlier content of a slot must not show.
        slot.bytes.fill(0xaa);
        slot.flags.fill(0xaa);
        let sweeps = Vec::new();
        Self {
            assembler,
            slot,
            sweeps,
        }
    }

    /// Adds an azimuth, and returns whether it completes a sweep.
    pub fn add(&mut self, azimuth: &Azimuth<'_>, stamp_ns: i64) -> bool {
        let sweep = self.assembler.add(azimuth, stamp_ns, &mut self.slot.slot());
        if let Some(sweep) = sweep {
            self.slot.geometry = sweep.geometry;
            let scan = self.slot.view();
            assert_eq!(scan.check(), Ok(()));
            let increases = scan.azimuth_rad.windows(2).all(|pair| pair[0] < pair[1]);
            assert!(increases, "{:?}", scan.azimuth_rad);
            self.sweeps.push((sweep, self.slot.clone()));
        }
        sweep.is_some()
    }

    pub fn add_rows<'a>(&mut self, rows: impl IntoIterator<Item = &'a SentAzimuth>) {
        for row in rows {
            self.add(&row.azimuth(ClockFormat::default()), row.stamp_ns);
        }
    }

    pub fn counters(&self) -> Counters {
        self.assembler.counters()
    }
}

/// Adds rows to the scans of a radar.
pub fn assembled<'a>(
    radar: &Configuration,
    rows: impl IntoIterator<Item = &'a SentAzimuth>,
) -> Assembly {
    let mut assembly = Assembly::new(radar);
    assembly.add_rows(rows);
    assembly
}

/// Appends bytes to a parser in pieces of at most `piece` bytes, and calls back with each event.
pub fn feed(parser: &mut Parser, bytes: &[u8], piece: usize, mut each: impl FnMut(Event<'_>)) {
    for piece in bytes.chunks(piece) {
        let mut rest = piece;
        while !rest.is_empty() {
            let space = parser.space(rest.len());
            let n = space.len().min(rest.len());
            space[..n].copy_from_slice(&rest[..n]);
            parser.filled(n);
            rest = &rest[n..];
            while let Some(event) = parser.next() {
                each(event);
            }
        }
    }
}

/// Gives all azimuths of `rows` their times. The host is a day late, and receives all at once.
pub fn stamped(
    clock: &mut RadarClock,
    rows: &[SentAzimuth],
    format: ClockFormat,
) -> Vec<SentAzimuth> {
    let mut stamped = Vec::new();
    for row in rows {
        for (azimuth, stamp_ns) in clock.stamp(row.azimuth(format), START_NS + 86_400_000_000_000) {
            stamped.push(SentAzimuth {
                encoder: azimuth.encoder,
                stamp_ns,
                powers: azimuth.powers.bytes().to_vec(),
            });
        }
    }
    stamped
}
