//! The configuration of a radar, before a run.

use std::{
    io::{self, ErrorKind},
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Address, Configuration, Event, Message, Request, SweepAssembler};
use gyre_datasets::DatasetOptions;
use gyre_geometry::ScanLimits;
use thiserror::Error;

use crate::live_radar::{Settings, connection::RadarSocket};

const MAX_WAIT: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(10);

#[derive(Debug, Error)]
#[error("{sentence}")]
pub struct AskError {
    pub sentence: String,
    /// True if the radar may answer later: it or its network is not there yet.
    pub may_pass: bool,
    /// True if no radar has this name, or its network does not know the name yet.
    pub is_unknown_name: bool,
}

impl AskError {
    pub fn passing(sentence: String) -> Self {
        Self::of(sentence, true)
    }

    pub fn lasting(sentence: String) -> Self {
        Self::of(sentence, false)
    }

    fn of(sentence: String, may_pass: bool) -> Self {
        Self {
            sentence,
            may_pass,
            is_unknown_name: false,
        }
    }

    fn no_answer(address: &str, error: &io::Error) -> Self {
        let text = error.to_string();
        let is_unknown_name = text.contains("lookup address") && !text.contains("emporary");
        let sentence = format!(
            "no radar answers at {address} ({text}): check source.address, and that the radar is on and in reach"
        );
        Self {
            sentence,
            may_pass: !is_unknown_name && error.kind() != ErrorKind::InvalidInput,
            is_unknown_name,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    pub period_ns: i64,
    pub limits: ScanLimits,
}

impl Sizes {
    /// Returns the sizes of the scans of a radar; `place`, as in `at 192.168.0.1`, names it.
    pub fn of(
        configuration: &Configuration,
        constants: DatasetOptions,
        place: &str,
    ) -> Result<Self, AskError> {
        let assembler = SweepAssembler::new(configuration, constants).map_err(|error| {
            AskError::lasting(format!("the radar {place} cannot be used: {error}"))
        })?;
        Ok(Self {
            period_ns: configuration.period_ns(),
            limits: assembler.limits(),
        })
    }
}

/// Asks a radar for its configuration. A radar that sends by UDP includes the configuration in each
/// datagram.
pub fn ask(settings: &Settings) -> Result<Sizes, AskError> {
    let place = format!("at {}", settings.address);
    Sizes::of(&configuration(settings)?, settings.constants, &place)
}

fn configuration(settings: &Settings) -> Result<Configuration, AskError> {
    let address = settings.address.to_string();
    let no_answer = |error| AskError::no_answer(&address, &error);
    // No azimuths: a recording that is played as a radar begins with the first request for them.
    let requests = [Request::RequestConfiguration];
    let mut radar = RadarSocket::open(&settings.address, &requests).map_err(no_answer)?;
    let (mut messages, mut damage) = (settings.parser(), None);
    let started = Instant::now();
    let mut understood = false;
    while started.elapsed() < MAX_WAIT {
        match radar.read(messages.space()) {
            Ok((count, _)) => messages.filled(count),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => break,
            Err(error) if error.kind() == ErrorKind::WouldBlock => sleep(POLL),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(no_answer(error)),
        }
        while let Some(event) = messages.next() {
            match event {
                Event::Message(Message::Configuration(configuration)) => return Ok(configuration),
                Event::Message(_) => understood = true,
                Event::Damaged { reason, .. } => damage = Some(reason),
            }
        }
    }
    let limit_s = MAX_WAIT.as_secs();
    let has_damage = damage.is_some() && !understood;
    let sentence = match (&settings.address, damage.filter(|_| !understood)) {
        (_, Some(damage)) => format!("what arrives at {address} are no scans: {damage}"),
        (Address::Tcp(_), None) => format!(
            "{address} sent no configuration of a radar within {limit_s} s: is it a Navtech radar, and has it less than three clients?"
        ),
        (Address::Udp { .. }, None) => format!(
            "nothing arrives at {address} within {limit_s} s: check that the radar's data output is CAT-240 to this address, and that source.interface is this machine's address on the radar's network"
        ),
    };
    Err(AskError::of(sentence, !has_damage))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_radar_that_is_not_there_yet_is_told_apart_from_a_wrong_name() {
        let lookup = |why| io::Error::other(format!("failed to lookup address information: {why}"));
        for (error, may_pass) in [
            (ErrorKind::ConnectionRefused.into(), true),
            (lookup("Temporary failure in name resolution"), true),
            (lookup("Name or service not known"), false),
            (ErrorKind::InvalidInput.into(), false),
        ] {
            let error = AskError::no_answer("radar:6317", &error);
            assert_eq!(error.may_pass, may_pass, "{error}");
        }
    }
}
