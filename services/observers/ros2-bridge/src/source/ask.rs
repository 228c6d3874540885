//! The configuration of a radar, before a run.

use std::{
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Configuration, SweepAssembler};
use gyre_stages::live_radar::Sizes;
use thiserror::Error;

use super::{
    Settings,
    configuration_estimate::ConfigurationEstimate,
    driver::{Driver, DriverError},
};

/// The longest wait for the configuration, which the driver repeats every four turns, and for
/// azimuths to estimate it from.
const MAX_WAIT: Duration = Duration::from_secs(6);
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// A driver's radar that cannot be used.
#[derive(Debug, Error)]
pub enum AskError {
    #[error(transparent)]
    Driver(#[from] DriverError),
    #[error(
        "nobody publishes {topic} in domain {domain} of ROS 2: check source.topic, ROS_DOMAIN_ID and source.interface, and that the driver runs"
    )]
    NoTopic { topic: String, domain: u16 },
    #[error(
        "the driver publishes {topic}, but no azimuth arrives: check that the radar is on and in reach of its driver"
    )]
    Silent { topic: String },
    #[error(
        "the driver publishes no {topic}, and nothing else tells the depth of a range bin: set dataset.range_resolution_m, and dataset.encoder_counts unless it is 5600"
    )]
    NoConfiguration { topic: String },
    #[error("the radar on {topic} cannot be used: {source}")]
    Unusable {
        topic: String,
        source: gyre_colossus::BadConfiguration,
    },
}

/// Asks a driver for the sizes of its radar's scans, or estimates them from azimuths.
pub fn ask(settings: &Settings) -> Result<Sizes, AskError> {
    let mut driver = Driver::open(settings)?;
    let configuration = match published(&driver, settings)? {
        Some(configuration) => configuration,
        None => estimated(&mut driver, settings)?,
    };
    let unusable = |source| AskError::Unusable {
        topic: settings.topic.clone(),
        source,
    };
    let assembler = SweepAssembler::new(&configuration, settings.constants).map_err(unusable)?;
    Ok(Sizes {
        period_ns: configuration.period_ns(),
        limits: assembler.limits(),
    })
}

/// Waits for the configuration that the driver publishes.
fn published(driver: &Driver, settings: &Settings) -> Result<Option<Configuration>, AskError> {
    let started = Instant::now();
    while started.elapsed() < MAX_WAIT {
        driver.found()?;
        if let Ok(Some(described)) = driver.configuration() {
            return Ok(Some(described.radar));
        }
        sleep(POLL_INTERVAL);
    }
    match driver.found()? {
        Some(_) => Ok(None),
        None => Err(AskError::NoTopic {
            topic: settings.topic.clone(),
            domain: settings.domain.id(),
        }),
    }
}

/// Estimates the configuration from azimuths.
fn estimated(driver: &mut Driver, settings: &Settings) -> Result<Configuration, AskError> {
    let Some(resolution_m) = settings.constants.range_resolution_m else {
        return Err(AskError::NoConfiguration {
            topic: settings.configuration_topic(),
        });
    };
    let (mut estimate, started) = (ConfigurationEstimate::default(), Instant::now());
    while started.elapsed() < MAX_WAIT {
        driver.receive()?;
        while let Ok(Some(packet)) = driver.packet() {
            estimate.add_message(&packet.message, packet.message.arrival_ns());
        }
        if let Some(found) = estimate.configuration(settings.encoder_counts, resolution_m) {
            return Ok(found);
        }
        sleep(POLL_INTERVAL);
    }
    Err(AskError::Silent {
        topic: settings.topic.clone(),
    })
}
