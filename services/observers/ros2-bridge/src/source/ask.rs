//! The configuration of a radar, before a run.

use std::{
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_colossus::{Configuration, SweepAssembler};
use gyre_stages::live_radar::Sizes;
use thiserror::Error;

use super::{Settings, configuration_estimate::ConfigurationEstimate, driver::Driver};
use crate::NodeError;

/// The longest wait for the configuration, which the driver repeats every four turns, and for
/// azimuths to estimate it from.
const MAX_WAIT: Duration = Duration::from_secs(6);
const POLL_INTERVAL: Duration = Duration::from_millis(10);

#[derive(Debug, Error)]
#[error("{reason}")]
pub struct AskError {
    reason: String,
    /// True of a driver that may still come, or whose radar may.
    pub may_pass: bool,
}

impl AskError {
    fn of(reason: String, may_pass: bool) -> Self {
        Self { reason, may_pass }
    }
}

impl From<NodeError> for AskError {
    fn from(error: NodeError) -> Self {
        Self::of(error.to_string(), false)
    }
}

/// Asks a driver for the sizes of its radar's scans, or estimates them from azimuths.
pub fn ask(settings: &Settings) -> Result<Sizes, AskError> {
    let mut driver = Driver::open(settings)?;
    let configuration = match published(&driver, settings)? {
        Some(configuration) => configuration,
        None => estimated(&mut driver, settings)?,
    };
    let assembler = SweepAssembler::new(&configuration, settings.constants);
    let assembler = assembler.map_err(|error| {
        let reason = format!("the radar on {} cannot be used: {error}", settings.topic);
        AskError::of(reason, false)
    })?;
    Ok(Sizes {
        period_ns: configuration.period_ns(),
        limits: assembler.limits(),
    })
}

fn published(driver: &Driver, settings: &Settings) -> Result<Option<Configuration>, AskError> {
    let started = Instant::now();
    while started.elapsed() < MAX_WAIT {
        driver.found()?;
        if let Ok(Some(described)) = driver.configuration() {
            return Ok(Some(described.radar));
        }
        sleep(POLL_INTERVAL);
    }
    if driver.found()?.is_some() {
        return Ok(None);
    }
    let (topic, domain) = (&settings.topic, settings.domain.id());
    let reason = format!(
        "nobody publishes {topic} in domain {domain} of ROS 2: check source.topic, ROS_DOMAIN_ID and source.interface, and that the driver runs"
    );
    Err(AskError::of(reason, true))
}

fn estimated(driver: &mut Driver, settings: &Settings) -> Result<Configuration, AskError> {
    let Some(resolution_m) = settings.constants.range_resolution_m else {
        let topic = settings.configuration_topic();
        let reason = format!(
            "the driver publishes no {topic}, and nothing else gives the depth of a range bin: set dataset.range_resolution_m, and dataset.encoder_counts unless it is 5600"
        );
        return Err(AskError::of(reason, false));
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
    let reason = format!(
        "the driver publishes {}, but no azimuth arrives: check that the radar is on and in reach of its driver",
        settings.topic
    );
    Err(AskError::of(reason, true))
}
