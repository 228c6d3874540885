//! The parser of a radar's messages, from a TCP stream or from datagrams.

use gyre_colossus::{Datagrams, Event, Parser};

/// Bytes to read of a stream at once: some ten azimuths.
const CHUNK: usize = 1 << 16;

#[derive(Debug)]
pub enum RadarParser {
    Stream(Parser),
    Datagrams(Datagrams),
}

impl RadarParser {
    pub fn space(&mut self) -> &mut [u8] {
        match self {
            Self::Stream(parser) => parser.space(CHUNK),
            Self::Datagrams(parser) => parser.space(),
        }
    }

    /// Adds the bytes that were read into the space, or the one datagram.
    pub fn filled(&mut self, bytes: usize) {
        match self {
            Self::Stream(parser) => parser.filled(bytes),
            Self::Datagrams(parser) => parser.filled(bytes),
        }
    }

    #[expect(
        clippy::should_implement_trait,
        reason = "a message borrows the parser"
    )]
    pub fn next(&mut self) -> Option<Event<'_>> {
        match self {
            Self::Stream(parser) => parser.next(),
            Self::Datagrams(parser) => parser.next(),
        }
    }

    /// Discards the radar's description that was returned last, and the datagram that has it.
    pub fn refuse_description(&mut self) {
        if let Self::Datagrams(parser) = self {
            parser.refuse_description();
        }
    }

    /// Returns whether a part of an azimuth has arrived in a datagram since the last call.
    pub fn take_part(&mut self) -> bool {
        match self {
            Self::Stream(_) => false,
            Self::Datagrams(parser) => parser.take_part(),
        }
    }

    /// Returns the bytes of a stream since the last event: they grow while it is not Colossus.
    pub fn skipped_bytes(&self) -> usize {
        match self {
            Self::Stream(parser) => parser.skipped_bytes(),
            Self::Datagrams(_) => 0,
        }
    }
}
