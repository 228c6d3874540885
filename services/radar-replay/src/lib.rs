//! Plays a recorded dataset onto the `scan` topic, each image decoded where its readers will find it; or a simulated drive, each
//! image rendered while those before it are on their way, read as it would be read from a disk.

mod config;
mod render_ahead;

use gyre_messages::ScanHeader;
use gyre_radar::{Dataset, DatasetOptions, OpenError};
use gyre_simulator::{SimulatedDrive, SimulationConfig};
use gyre_stage::{Launch, Source, StageError, Statistics, source};

pub use config::SourceConfig;
use render_ahead::RenderAhead;

/// The stage's name.
pub const NAME: &str = "radar-replay";

/// A simulation that fell behind by less kept up, seconds.
const WORTH_SAYING_S: f64 = 0.01;

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let options: DatasetOptions = launch.section("dataset")?;
    let input = |error: &dyn std::error::Error| StageError::Input(error.to_string());
    let simulation = streamed(launch)?;
    let dataset = match &simulation {
        Some(simulation) => {
            let recording = SimulatedDrive::new(simulation).map_err(|error| input(&error))?;
            open_simulation(recording, &options)
        }
        None => gyre_radar::open(&config.data, &options),
    };
    let dataset = dataset.map_err(|error| input(&error))?;
    let mut replay = Replay {
        passes_by: simulation.is_none(),
        ..Replay::of(dataset, &config)
    };
    let statistics = source::run(launch, &mut replay)?;
    let slipped_s = statistics.slipped_ns as f64 * 1e-9;
    if slipped_s > WORTH_SAYING_S {
        tracing::warn!(slipped_s, "the simulation did not keep up with the rate");
    }
    Ok(statistics)
}

/// The simulation to play, if it is not to be read from where it was stored.
fn streamed(launch: &Launch) -> Result<Option<SimulationConfig>, StageError> {
    match launch.has_section("simulation") {
        true => launch
            .section("simulation")
            .map(|simulation: SimulationConfig| Some(simulation).filter(|s| !s.output.store)),
        false => Ok(None),
    }
}

/// A simulated drive as a dataset that lies on no disk.
pub fn open_simulation(
    recording: SimulatedDrive,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    gyre_radar::open_source(Box::new(RenderAhead::new(recording)), options)
}

/// A part of a dataset.
pub struct Replay {
    dataset: Box<dyn Dataset>,
    first: usize,
    scans: usize,
    half_period_ns: i64,
    passes_by: bool,
}

impl Replay {
    /// The part of a dataset that `config` names.
    pub fn of(dataset: Box<dyn Dataset>, config: &SourceConfig) -> Self {
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
            passes_by: true,
        }
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

    /// A simulated sweep is complete when it is rendered, and not before.
    fn passes_by(&self) -> bool {
        self.passes_by
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
    let stamps = (0..dataset.len()).map_while(|index| dataset.nominal_stamp_ns(index));
    let stamps: Vec<i64> = stamps.collect();
    let mut periods: Vec<i64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods.sort_unstable();
    periods.get(periods.len() / 2).copied().unwrap_or(0)
}
