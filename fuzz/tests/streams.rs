//! The stream of a radar: a client receives a stream of Colossus, or datagrams of CAT-240.

use bolero::{TypeGenerator, check};
use gyre_colossus::{
    Azimuth, BadConfiguration, ByteOrder, ClockFormat, Configuration, Damage, Datagrams, Event,
    Message, Parser, Powers, RadarClock, SweepAssembler, asterix, write_azimuth,
    write_configuration, write_keep_alive, write_other,
};
use gyre_datasets::DatasetOptions;
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, Number, edit_bytes},
};
use gyre_geometry::OwnedScan;

const AZIMUTHS: u16 = 16;
const BINS: u16 = 40;
/// Bins that do not fit into one datagram.
const WIDE_BINS: u16 = 1500;
const COUNTS: u16 = 5600;
/// 2019-01-10 14:37:26 UTC, ns.
const START_NS: i64 = 1_547_131_046_000_000_000;
/// Scans up to this size are assembled.
const LARGEST_BYTES: usize = 4 << 20;

/// An edit of a radar.
#[derive(Clone, Debug, TypeGenerator)]
pub enum Edit {
    /// A number of the configuration.
    Configuration(u8, Number),
    /// The encoder count of an azimuth.
    Encoder(u8, u16),
    /// The time of all azimuths from this one on, shifted.
    TimeFrom(u8, Number),
    /// The bytes of an azimuth's time.
    Time(u8, [u8; 8]),
    /// An azimuth of 16-bit powers.
    Wide(u8),
    /// An azimuth that does not arrive.
    Lost(u8),
}

struct Row {
    encoder: u16,
    stamp_ns: i64,
    time: Option<[u8; 8]>,
    wide: bool,
    lost: bool,
}

fn edit_radar(configuration: &mut Configuration, rows: &mut [Row], edits: &[Edit]) {
    let count = rows.len();
    let place = |index: u8| usize::from(index) % count;
    for edit in edits {
        match *edit {
            Edit::Configuration(field, number) => {
                let short = number.bits() as u16;
                match field % 7 {
                    0 => configuration.azimuth_samples = short,
                    1 => configuration.bin_size = short,
                    2 => configuration.range_in_bins = short,
                    3 => configuration.encoder_size = short,
                    4 => configuration.rotation_mhz = short,
                    5 => configuration.range_resolution_m = None,
                    _ => configuration.range_resolution_m = Some(number.f64() as f32),
                }
            }
            Edit::Encoder(index, encoder) => rows[place(index)].encoder = encoder,
            Edit::TimeFrom(index, number) => rows[place(index)..].iter_mut().for_each(|row| {
                row.stamp_ns = row.stamp_ns.wrapping_add(number.bits() as i64);
            }),
            Edit::Time(index, time) => rows[place(index)].time = Some(time),
            Edit::Wide(index) => rows[place(index)].wide = true,
            Edit::Lost(index) => rows[place(index)].lost = true,
        }
    }
}

/// A radar's health: a temperature of 36.5 that is healthy, transmitting, three errors of the
/// encoder.
const HEALTH: [u8; 13] = [0x0a, 7, 0x1d, 0, 0, 0x12, 0x42, 0x28, 3, 0x40, 1, 0x60, 3];

/// The stream of a radar that turns four times.
pub fn stream(edits: &[Edit]) -> Vec<u8> {
    let mut configuration = Configuration::usual(AZIMUTHS, BINS);
    let row = |k: u16| Row {
        encoder: k % AZIMUTHS * (COUNTS / AZIMUTHS),
        stamp_ns: START_NS + i64::from(k) * 15_625_000,
        time: None,
        wide: false,
        lost: false,
    };
    let mut rows: Vec<Row> = (0..4 * AZIMUTHS).map(row).collect();
    edit_radar(&mut configuration, &mut rows, edits);
    let powers: Vec<u8> = (0..BINS).map(|bin| (bin * 7) as u8).collect();
    let mut bytes = Vec::new();
    write_configuration(&mut bytes, &configuration);
    for row in rows.iter().filter(|row| !row.lost) {
        let mut azimuth = Azimuth::at(row.encoder, row.stamp_ns, ClockFormat::default(), &powers);
        if let Some([s0, s1, s2, s3, p0, p1, p2, p3]) = row.time {
            (azimuth.seconds, azimuth.split_seconds) = ([s0, s1, s2, s3], [p0, p1, p2, p3]);
        }
        if row.wide {
            azimuth.powers = Powers::Sixteen(&powers);
        }
        write_azimuth(&mut bytes, &azimuth);
        write_keep_alive(&mut bytes);
        write_other(&mut bytes, 40, &HEALTH);
    }
    bytes
}

/// A client: the clock, the assembler and the memory of a scan.
struct Client {
    clock: RadarClock,
    assembler: SweepAssembler,
    scan: OwnedScan,
    sweeps: usize,
}

impl Client {
    fn new(configuration: &Configuration) -> Result<Option<Self>, BadConfiguration> {
        let assembler = SweepAssembler::new(configuration, DatasetOptions::default())?;
        let limits = assembler.limits();
        Ok((limits.bytes <= LARGEST_BYTES).then(|| Self {
            clock: RadarClock::new(configuration),
            assembler,
            scan: OwnedScan::with_limits(limits),
            sweeps: 0,
        }))
    }

    fn add(&mut self, azimuth: Azimuth<'_>) -> Result<(), Failure> {
        for (azimuth, stamp_ns) in self.clock.stamp(azimuth, START_NS) {
            let sweep = self
                .assembler
                .add(&azimuth, stamp_ns, &mut self.scan.slot());
            if let Some(sweep) = sweep {
                self.sweeps += 1;
                self.scan.geometry = sweep.geometry;
                // Its layout is always right; its times are the radar's.
                self.scan.view().check().unwrap();
                self.scan.view().check_times()?;
            }
        }
        Ok(())
    }
}

/// The scans of a stream, and its last damage.
#[derive(Default)]
struct Received {
    client: Option<Client>,
    damage: Option<Damage>,
}

impl Received {
    fn take(&mut self, event: Event<'_>) -> Result<(), Failure> {
        match event {
            Event::Message(Message::Configuration(new)) => self.client = Client::new(&new)?,
            Event::Message(Message::Azimuth(azimuth)) => {
                let mut client = self.client.iter_mut();
                client.try_for_each(|client| client.add(azimuth))?;
            }
            Event::Message(Message::Health(health)) => assert!(health.readings().count() <= 8),
            Event::Message(_) => {}
            Event::Damaged { reason, .. } => self.damage = Some(reason),
        }
        Ok(())
    }

    /// Returns the number of scans.
    fn scans(self) -> Result<usize, Failure> {
        match self.damage {
            Some(damage) => Err(damage.into()),
            None => Ok(self.client.map_or(0, |client| client.sweeps)),
        }
    }
}

/// Receives a stream in pieces, and returns the number of scans.
fn receive(bytes: &[u8], piece: usize) -> Result<usize, Failure> {
    let (mut parser, mut received) = (Parser::new(), Received::default());
    for piece in bytes.chunks(piece) {
        parser.space(piece.len())[..piece.len()].copy_from_slice(piece);
        parser.filled(piece.len());
        while let Some(event) = parser.next() {
            received.take(event)?;
        }
    }
    received.scans()
}

#[test]
fn streams() {
    let target = Target::new(32);
    check!()
        .with_type::<(Vec<Edit>, Vec<ByteEdit>, u16)>()
        .for_each(|(radar, edits, piece)| {
            let mut bytes = stream(radar);
            edit_bytes(&mut bytes, edits);
            target.run(|| receive(&bytes, 1 + usize::from(*piece)).map(|_| ()));
        });
}

/// The datagrams of a radar that turns four times.
pub fn datagrams() -> Vec<Vec<u8>> {
    let radar = Configuration::usual(AZIMUTHS, WIDE_BINS);
    let format = ClockFormat {
        order: ByteOrder::Big,
        ..ClockFormat::default()
    };
    let powers: Vec<u8> = (0..WIDE_BINS).map(|bin| (bin * 7) as u8).collect();
    let (mut number, mut sent) = (0, Vec::new());
    for k in 0..4 * AZIMUTHS {
        let encoder = k % AZIMUTHS * (COUNTS / AZIMUTHS);
        let stamp_ns = START_NS + i64::from(k) * 15_625_000;
        let azimuth = Azimuth::at(encoder, stamp_ns, format, &powers);
        let mut send = |datagram: &[u8]| sent.push(datagram.to_vec());
        asterix::write_azimuth(&radar, &azimuth, &mut number, &mut send);
    }
    sent
}

/// Receives datagrams, and returns the number of scans.
fn receive_datagrams<'a>(sent: impl IntoIterator<Item = &'a Vec<u8>>) -> Result<usize, Failure> {
    let (mut parser, mut received) = (Datagrams::new(COUNTS), Received::default());
    for datagram in sent {
        let bytes = datagram.len().min(parser.space().len());
        parser.space()[..bytes].copy_from_slice(&datagram[..bytes]);
        parser.filled(bytes);
        while let Some(event) = parser.next() {
            received.take(event)?;
        }
    }
    received.scans()
}

#[test]
fn edited_datagrams() {
    let target = Target::new(32);
    // Which of them is edited, and how; and which ones are exchanged.
    check!()
        .with_type::<(Vec<(u8, Vec<ByteEdit>)>, Vec<(u8, u8)>)>()
        .for_each(|(edits, swaps)| {
            let mut sent = datagrams();
            let count = sent.len();
            for (index, edits) in edits {
                edit_bytes(&mut sent[usize::from(*index) % count], edits);
            }
            for (one, other) in swaps {
                sent.swap(usize::from(*one) % count, usize::from(*other) % count);
            }
            target.run(|| receive_datagrams(&sent).map(|_| ()));
        });
}

#[test]
fn datagrams_and_a_stream_without_edits_are_received() {
    assert_eq!(receive_datagrams(&datagrams()).unwrap(), 4);
    assert_eq!(receive(&stream(&[]), 100).unwrap(), 4);
}
