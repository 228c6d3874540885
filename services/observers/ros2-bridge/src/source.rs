//! A radar that Navtech's driver publishes in ROS 2, as the source of a run: each azimuth is a
//! message on `radar_data/fft_data`.

mod ask;
mod configuration_estimate;
mod driver;
mod radar;

use std::time::Duration;

use gyre_client::RunError;
use gyre_contract::run::{SourceConfig, StageCounters};
use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::{GnssConfig, SampleKind, SensorKind};
use gyre_ros2_messages::Domain;
use gyre_stage::{Launch, source};
use gyre_stages::live_radar::{encoder_counts, silence};

pub use ask::ask;
pub use gyre_stages::live_radar::Sizes;

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub domain: Domain,
    /// The topic of the azimuths, such as `/radar_data/fft_data`. The configuration is beside it.
    pub topic: String,
    /// The topics of the sensors beside the radar that are in ROS 2.
    pub sensors: Vec<(SampleKind, String)>,
    /// Encoder counts per turn of a radar whose driver does not publish its configuration.
    pub encoder_counts: u16,
    /// Time without a message after which that is reported.
    pub silence: Duration,
    /// Scans to receive; `None`: without end.
    pub scans: Option<u64>,
    pub constants: DatasetOptions,
}

impl Settings {
    /// Returns the settings of the section `[source]`, with the constants of the section
    /// `[dataset]`.
    pub fn of(source: &SourceConfig, options: &DatasetOptions) -> Result<Self, String> {
        let interface = Some(source.interface.as_str()).filter(|address| !address.is_empty());
        Ok(Self {
            domain: Domain::new(source.domain, interface)?,
            topic: source.topic.clone(),
            sensors: Vec::new(),
            encoder_counts: encoder_counts(options),
            silence: silence(source),
            scans: source.scans.map(|scans| scans as u64),
            constants: *options,
        })
    }

    fn configuration_topic(&self) -> String {
        match self.topic.rsplit_once('/') {
            Some((place, _)) => format!("{place}/configuration_data"),
            None => "configuration_data".to_owned(),
        }
    }
}

pub fn run(launch: &Launch, mut settings: Settings) -> Result<StageCounters, RunError> {
    let (motion, gnss): (_, GnssConfig) = (launch.sensors()?, launch.section("gnss")?);
    let mut sensors = motion.sampled();
    sensors.push(&gnss);
    let in_ros2 = sensors.iter().filter(|it| it.kind() == SensorKind::Ros2);
    let topics = in_ros2.filter_map(|it| Some((it.of(), it.live_topic()?.to_owned())));
    settings.sensors = topics.collect();
    let scans = settings.scans;
    source::run_sensor(launch, &mut radar::Radar::open(settings)?, scans)
}
