//! Messages. Each is a header of 22 bytes (signature, version, id, payload size) and a payload.
//! Numbers are big-endian, but for the time of an azimuth, whose byte order depends on the radar's
//! software.

use crate::clock::ClockFormat;
use crate::configuration::{self, Configuration};
use crate::health::{self, Health};
use crate::malformed::{Malformed, head};

pub const PORT: u16 = 6317;
/// The largest payload, bytes.
pub const MAX_PAYLOAD_BYTES: usize = 1 << 20;

pub(crate) const SIGNATURE: [u8; 16] = [
    0x00, 0x01, 0x03, 0x03, 0x07, 0x07, 0x0f, 0x0f, 0x1f, 0x1f, 0x3f, 0x3f, 0x7f, 0x7f, 0xfe, 0xfe,
];
pub(crate) const VERSION: u8 = 1;
/// Signature, version, id, payload size.
pub(crate) const HEADER_BYTES: usize = 22;
/// Bytes before the powers of an azimuth, at least.
pub(crate) const AZIMUTH_BYTES: usize = 14;

pub(crate) mod id {
    pub(crate) const KEEP_ALIVE: u8 = 1;
    pub(crate) const CONFIGURATION: u8 = 10;
    pub(crate) const AZIMUTH: u8 = 30;
    pub(crate) const AZIMUTH_16_BIT: u8 = 31;
    pub(crate) const HEALTH: u8 = 40;
}

/// A message of a radar or of a client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message<'a> {
    KeepAlive,
    /// The radar's description of itself: id 10.
    Configuration(Configuration),
    Azimuth(Azimuth<'a>),
    Request(Request),
    /// The radar's health: id 40.
    Health(Health),
    Other {
        id: u8,
        payload: &'a [u8],
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Request {
    RequestConfiguration = 20,
    StartFft = 21,
    StopFft = 22,
    /// Send the health every 10 s.
    StartHealth = 23,
    StopHealth = 24,
    StartNonContourFft = 140,
}

impl Request {
    pub const ALL: [Self; 6] = [
        Self::RequestConfiguration,
        Self::StartFft,
        Self::StopFft,
        Self::StartHealth,
        Self::StopHealth,
        Self::StartNonContourFft,
    ];

    pub fn id(self) -> u8 {
        self as u8
    }
}

/// The powers of one azimuth, as received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Azimuth<'a> {
    /// Number of the azimuth, incremented with each one; wraps.
    pub sweep_counter: u16,
    /// Encoder count of the antenna, clockwise from straight ahead.
    pub encoder: u16,
    /// Seconds, in a byte order that [`RadarClock`](crate::RadarClock) finds.
    pub seconds: [u8; 4],
    /// Nanoseconds or microseconds of the second, in the same byte order.
    pub split_seconds: [u8; 4],
    /// The powers, nearest bin first.
    pub powers: Powers<'a>,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Powers<'a> {
    /// One byte per bin.
    Eight(&'a [u8]),
    /// Two bytes per bin. Their order is not documented; [`SweepAssembler`](crate::SweepAssembler)
    /// finds it.
    Sixteen(&'a [u8]),
}

impl<'a> Powers<'a> {
    pub fn bins(self) -> usize {
        match self {
            Self::Eight(bytes) => bytes.len(),
            Self::Sixteen(bytes) => bytes.len() / 2,
        }
    }

    pub fn bytes(self) -> &'a [u8] {
        match self {
            Self::Eight(bytes) | Self::Sixteen(bytes) => bytes,
        }
    }
}

pub fn decode(id: u8, payload: &[u8]) -> Result<Message<'_>, Malformed> {
    if let Some(request) = Request::ALL.into_iter().find(|r| r.id() == id) {
        return Ok(Message::Request(request));
    }
    Ok(match id {
        id::KEEP_ALIVE => Message::KeepAlive,
        id::CONFIGURATION => Message::Configuration(configuration::decode(payload)?),
        id::AZIMUTH => Message::Azimuth(azimuth(payload, Powers::Eight)?),
        id::AZIMUTH_16_BIT => {
            let azimuth = azimuth(payload, Powers::Sixteen)?;
            let bytes = azimuth.powers.bytes().len();
            if bytes % 2 != 0 {
                return Err(Malformed::new(format!(
                    "an azimuth of 16-bit powers has {bytes} bytes of powers, an odd number"
                )));
            }
            Message::Azimuth(azimuth)
        }
        id::HEALTH => Message::Health(health::decode(payload)?),
        id => Message::Other { id, payload },
    })
}

fn azimuth<'a>(
    payload: &'a [u8],
    powers: impl Fn(&'a [u8]) -> Powers<'a>,
) -> Result<Azimuth<'a>, Malformed> {
    let head: [u8; AZIMUTH_BYTES] = head("an azimuth", payload)?;
    let [o0, o1, c0, c1, e0, e1, s0, s1, s2, s3, p0, p1, p2, p3] = head;
    let offset = u16::from_be_bytes([o0, o1]);
    let bytes = payload.get(offset.into()..);
    let bytes = bytes.filter(|_| usize::from(offset) >= AZIMUTH_BYTES);
    let bytes = bytes.ok_or_else(|| {
        let all = payload.len();
        Malformed::new(format!(
            "the powers of an azimuth begin at byte {offset} of a payload of {all} bytes, expected {AZIMUTH_BYTES} or more"
        ))
    })?;
    Ok(Azimuth {
        sweep_counter: u16::from_be_bytes([c0, c1]),
        encoder: u16::from_be_bytes([e0, e1]),
        seconds: [s0, s1, s2, s3],
        split_seconds: [p0, p1, p2, p3],
        powers: powers(bytes),
    })
}

/// An azimuth that outlives the buffer it was received in.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeptAzimuth {
    sweep_counter: u16,
    encoder: u16,
    seconds: [u8; 4],
    split_seconds: [u8; 4],
    sixteen: bool,
    powers: Vec<u8>,
}

impl KeptAzimuth {
    pub(crate) fn keep(&mut self, azimuth: &Azimuth<'_>) {
        self.sweep_counter = azimuth.sweep_counter;
        self.encoder = azimuth.encoder;
        self.seconds = azimuth.seconds;
        self.split_seconds = azimuth.split_seconds;
        self.sixteen = matches!(azimuth.powers, Powers::Sixteen(_));
        self.powers.clear();
        self.powers.extend_from_slice(azimuth.powers.bytes());
    }

    pub(crate) fn azimuth(&self) -> Azimuth<'_> {
        Azimuth {
            sweep_counter: self.sweep_counter,
            encoder: self.encoder,
            seconds: self.seconds,
            split_seconds: self.split_seconds,
            powers: match self.sixteen {
                true => Powers::Sixteen(&self.powers),
                false => Powers::Eight(&self.powers),
            },
        }
    }
}
