//! The configuration of a radar, before a run.

use std::{
    io::{ErrorKind, Read},
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{BadConfiguration, Event, Message, Parser, Request, SweepAssembler};
use gyre_radar::ScanLimits;
use thiserror::Error;

use crate::{Settings, connection::connect};

/// The longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two looks for it.
const POLL: Duration = Duration::from_millis(10);
/// Bytes to read at once.
const CHUNK: usize = 4096;

/// Why a radar cannot be used.
#[derive(Debug, Error)]
pub enum AskError {
    /// There is none.
    #[error(
        "no radar answers at {address} ({source}): check source.address, and that the radar is on and in reach"
    )]
    NoAnswer {
        /// Its address.
        address: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Something else answers.
    #[error(
        "{address} sent no configuration of a radar within {} s: is it a Navtech radar, and has it less than three clients?",
        PATIENCE.as_secs()
    )]
    NoConfiguration {
        /// Its address.
        address: String,
    },
    /// Its configuration is not usable.
    #[error("the radar at {address} cannot be used: {source}")]
    Unusable {
        /// Its address.
        address: String,
        /// What is wrong.
        source: BadConfiguration,
    },
}

/// What a radar says of its scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Time of a turn, ns.
    pub period_ns: i64,
    /// The size of a scan.
    pub limits: ScanLimits,
}

/// Asks a radar for its configuration.
///
/// # Errors
/// No answer, or one that cannot be used.
pub fn ask(settings: &Settings) -> Result<Sizes, AskError> {
    let address = settings.address.clone();
    let no_answer = |source| AskError::NoAnswer {
        address: address.clone(),
        source,
    };
    // No azimuths: a recording that is played as a radar begins with the first request for them.
    let mut radar = connect(&address, &[Request::RequestConfiguration]).map_err(no_answer)?;
    let (mut parser, started) = (Parser::default(), Instant::now());
    while started.elapsed() < PATIENCE {
        match radar.read(parser.space(CHUNK)) {
            Ok(0) => break,
            Ok(count) => parser.filled(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => sleep(POLL),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(no_answer(error)),
        }
        while let Some(event) = parser.next() {
            let Event::Message(Message::Configuration(configuration)) = event else {
                continue;
            };
            let assembler = SweepAssembler::new(&configuration, settings.constants);
            return match assembler {
                Ok(assembler) => Ok(Sizes {
                    period_ns: configuration.period_ns(),
                    limits: assembler.limits(),
                }),
                Err(source) => Err(AskError::Unusable { address, source }),
            };
        }
    }
    Err(AskError::NoConfiguration { address })
}
