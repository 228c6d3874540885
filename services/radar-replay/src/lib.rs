//! The source stage: publishes the scans of a dataset on `scan`, decoded directly into shared memory.
//!
//! [`run`] opens a recording; [`play`] plays any dataset.

mod config;

use gyre_messages::ScanHeader;
use gyre_radar::{Dataset, DatasetOptions};
use gyre_stage::{Launch, Source, StageCounters, StageError, source};

pub use config::SourceConfig;

/// A playback with a longer delay is reported, s.
const NOTABLE_SLIP_S: f64 = 0.01;

/// The pace of a dataset in live mode: the fate of scans that become due while the source is busy or down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// They are dropped, as those of a real sensor.
    Sensor,
    /// They are played late, since each scan is rendered only when it is read.
    OnDemand,
}

/// Plays the recording of the section `[source]` until SIGTERM.
///
/// # Errors
/// An invalid configuration, a recording that cannot be opened, or an error of [`source::run`].
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let options: DatasetOptions = launch.section("dataset")?;
    let dataset = gyre_radar::open(&config.data, &options)
        .map_err(|error| StageError::Input(error.to_string()))?;
    play(launch, dataset, Pace::Sensor)
}

/// Plays the part of a dataset that the section `[source]` selects, until SIGTERM.
///
/// # Errors
/// An invalid configuration, or an error of [`source::run`].
pub fn play(
    launch: &Launch,
    dataset: Box<dyn Dataset>,
    pace: Pace,
) -> Result<StageCounters, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let counters = source::run(launch, &mut Replay::new(dataset, &config, pace))?;
    let slipped_s = counters.slipped_ns as f64 * 1e-9;
    if slipped_s > NOTABLE_SLIP_S {
        tracing::warn!(slipped_s, "the simulation did not keep up with the rate");
    }
    Ok(counters)
}

/// The selected part of a dataset.
struct Replay {
    dataset: Box<dyn Dataset>,
    first: usize,
    scans: usize,
    half_period_ns: i64,
    pace: Pace,
}

impl Replay {
    fn new(dataset: Box<dyn Dataset>, config: &SourceConfig, pace: Pace) -> Self {
        let first = config.first.min(dataset.len());
        let scans = config
            .scans
            .unwrap_or(usize::MAX)
            .min(dataset.len() - first);
        let half_period_ns = median_period_ns(dataset.as_ref()) / 2;
        Self {
            dataset,
            first,
            scans,
            half_period_ns,
            pace,
        }
    }
}

impl Source for Replay {
    fn len(&self) -> usize {
        self.scans
    }

    /// The stamp of a scan is the middle of its sweep; the scan is complete half a period later.
    fn complete_ns(&self, index: usize) -> Option<i64> {
        Some(self.dataset.nominal_stamp_ns(self.first + index)? + self.half_period_ns)
    }

    fn drops_missed_scans(&self) -> bool {
        self.pace == Pace::Sensor
    }

    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), String> {
        let read = self.dataset.read(self.first + index, header.slot(bytes));
        header.set_geometry(&read.map_err(|error| error.to_string())?);
        Ok(())
    }
}

fn median_period_ns(dataset: &dyn Dataset) -> i64 {
    let stamps: Vec<i64> = (0..dataset.len())
        .map_while(|index| dataset.nominal_stamp_ns(index))
        .collect();
    let periods = stamps.windows(2).map(|pair| (pair[1] - pair[0]) as f64);
    gyre_radar::median(periods).map_or(0, |period_ns| period_ns as i64)
}
