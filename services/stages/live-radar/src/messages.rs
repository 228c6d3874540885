//! What a radar has sent, whether as a stream or as datagrams.

use gyre_colossus::{Datagrams, Event, Parser};

use crate::{Address, Settings};

/// Bytes to read of a stream at once: some ten azimuths.
const CHUNK: usize = 1 << 16;

/// The parser of a stream, or of datagrams.
#[derive(Debug)]
pub enum Messages {
    Stream(Parser),
    Datagrams(Datagrams),
}

impl Messages {
    /// A parser at the start of what a radar sends.
    pub fn new(settings: &Settings) -> Self {
        match settings.address {
            Address::Tcp(_) => Self::Stream(Parser::default()),
            Address::Udp { .. } => Self::Datagrams(Datagrams::new(settings.encoder_counts)),
        }
    }

    /// Memory to read into.
    pub fn space(&mut self) -> &mut [u8] {
        match self {
            Self::Stream(parser) => parser.space(CHUNK),
            Self::Datagrams(parser) => parser.space(),
        }
    }

    /// Adds what has been read: bytes, or one datagram.
    pub fn filled(&mut self, bytes: usize) {
        match self {
            Self::Stream(parser) => parser.filled(bytes),
            Self::Datagrams(parser) => parser.filled(bytes),
        }
    }

    /// The next message or fault.
    pub fn next(&mut self) -> Option<Event<'_>> {
        match self {
            Self::Stream(parser) => parser.next(),
            Self::Datagrams(parser) => parser.next(),
        }
    }

    /// Passes over the description of the radar that was returned last, and the datagram that has it.
    pub fn refuse_description(&mut self) {
        match self {
            Self::Stream(_) => {}
            Self::Datagrams(parser) => parser.refuse_description(),
        }
    }

    /// Whether a part of the radar's azimuths has come in a datagram since the last call.
    pub fn take_part(&mut self) -> bool {
        match self {
            Self::Stream(_) => false,
            Self::Datagrams(parser) => parser.take_part(),
        }
    }

    /// Bytes since the last event that are no message: they grow while a stream is not Colossus.
    pub fn skipped_bytes(&self) -> usize {
        match self {
            Self::Stream(parser) => parser.skipped_bytes(),
            Self::Datagrams(_) => 0,
        }
    }
}
