//! The configuration of a radar, before a run.

use std::{
    thread::sleep,
    time::{Duration, Instant},
};

use gyre_client::RunError;
use gyre_colossus::Configuration;
use gyre_stages::live_radar::{AskError, Sizes};

use super::{Settings, configuration_estimate::ConfigurationEstimate, driver::Driver};

/// The longest wait for the configuration, which the driver repeats every four turns. Meanwhile
/// azimuths come, to estimate it from.
const MAX_WAIT: Duration = Duration::from_secs(6);
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Asks a driver for the sizes of its radar's scans, or estimates them from azimuths.
pub fn ask(settings: &Settings) -> Result<Sizes, AskError> {
    let place = format!("on {}", settings.topic);
    Sizes::of(&configuration(settings)?, settings.constants, &place)
}

/// Returns the configuration that the driver publishes, or the one that its azimuths show.
fn configuration(settings: &Settings) -> Result<Configuration, AskError> {
    let lasting = |error: RunError| AskError::lasting(error.to_string());
    let mut driver = Driver::open(settings).map_err(lasting)?;
    let (mut estimate, started) = (ConfigurationEstimate::default(), Instant::now());
    while started.elapsed() < MAX_WAIT {
        driver.receive().map_err(lasting)?;
        if let Ok(Some(described)) = driver.configuration() {
            return Ok(described.radar);
        }
        while let Ok(Some(packet)) = driver.packet() {
            estimate.add_message(&packet.message, packet.message.arrival_ns());
        }
        sleep(POLL_INTERVAL);
    }
    let topic = &settings.topic;
    if driver.found().map_err(lasting)?.is_none() {
        let domain = settings.domain.id;
        return Err(AskError::passing(format!(
            "nobody publishes {topic} in domain {domain} of ROS 2: check source.topic, ROS_DOMAIN_ID and source.interface, and that the driver runs"
        )));
    }
    let Some(resolution_m) = settings.constants.range_resolution_m else {
        let topic = settings.configuration_topic();
        return Err(AskError::lasting(format!(
            "the driver publishes no {topic}, and nothing else gives the depth of a range bin: set dataset.range_resolution_m, and dataset.encoder_counts unless it is 5600"
        )));
    };
    let found = estimate.configuration(settings.encoder_counts, resolution_m);
    found.ok_or_else(|| {
        AskError::passing(format!(
            "the driver publishes {topic}, but no azimuth arrives: check that the radar is on and in reach of its driver"
        ))
    })
}
