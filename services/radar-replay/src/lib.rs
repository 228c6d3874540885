//! Plays a recorded dataset onto the `scan` topic, each image decoded where its readers will find it.

mod config;

use gyre_messages::ScanHeader;
use gyre_radar::{Dataset, DatasetOptions, OpenError};
use gyre_stage::{Launch, Source, StageError, Statistics, source};

pub use config::SourceConfig;

/// The stage's name.
pub const NAME: &str = "radar-replay";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let options: DatasetOptions = launch.section("dataset")?;
    let mut replay = Replay::open(&config, &options).map_err(|error| StageError::Input(error.to_string()))?;
    source::run(launch, &mut replay)
}

/// A part of a dataset.
pub struct Replay {
    dataset: Box<dyn Dataset>,
    first: usize,
    scans: usize,
    half_period_ns: i64,
}

impl Replay {
    /// Opens the dataset that `config` names.
    pub fn open(config: &SourceConfig, options: &DatasetOptions) -> Result<Self, OpenError> {
        let dataset = gyre_radar::open(&config.data, options)?;
        let first = config.first.min(dataset.len());
        let scans = config.scans.unwrap_or(usize::MAX).min(dataset.len() - first);
        let half_period_ns = median_period_ns(dataset.as_ref()) / 2;
        Ok(Self { dataset, first, scans, half_period_ns })
    }
}

impl Source for Replay {
    fn len(&self) -> usize {
        self.scans
    }

    /// A scan's stamp is the middle of its sweep; it is complete half a turn later.
    fn complete_ns(&self, index: usize) -> Option<i64> {
        Some(self.dataset.nominal_stamp_ns(self.first + index)? + self.half_period_ns)
    }

    fn read(&mut self, index: usize, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<(), String> {
        let read = self.dataset.read(self.first + index, header.slot(bytes));
        header.set_geometry(&read.map_err(|error| error.to_string())?);
        Ok(())
    }
}

fn median_period_ns(dataset: &dyn Dataset) -> i64 {
    let stamps = (0..dataset.len()).map_while(|index| dataset.nominal_stamp_ns(index));
    let stamps: Vec<i64> = stamps.collect();
    let mut periods: Vec<i64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods.sort_unstable();
    periods.get(periods.len() / 2).copied().unwrap_or(0)
}
