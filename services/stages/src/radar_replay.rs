//! The source stage: publishes the scans of a dataset on `scan`, decoded directly into shared
//! memory.
//!
//! [`run`] opens a recording; [`play`] plays any dataset.

mod faults;
mod listing;
mod player;
mod turns;

use std::{error::Error, num::NonZeroUsize, ops::Range, path::Path, time::Duration};

use gyre_datasets::{Dataset, DatasetOptions, ScanSamples};
use gyre_messages::{ScanHeader, StageId};
use gyre_run::{PlayedFrom, SourceConfig};
use gyre_samples::{GyroConfig, WheelsConfig};
use gyre_stage::{
    Launch, Source, StageCounters, StageError,
    source::{self, Tolerance, Unreadable},
};

use faults::Faults;
pub use listing::Listing;
pub use player::{Player, play_recorded};
use turns::Turns;

/// A playback with a longer delay is reported, s.
const NOTABLE_SLIP_S: f64 = 0.01;

/// The pace of a dataset in live mode: the fate of scans that become due while the source is busy
/// or down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// They are dropped, as a real sensor would.
    Sensor,
    /// They are played late, since each scan is rendered only when it is read.
    OnDemand,
}

/// Plays the recording of the section `[source]` until SIGTERM.
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let config: SourceConfig = launch.section("source")?;
    if config.from != PlayedFrom::Scan {
        return play_recorded(launch);
    }
    let options: DatasetOptions = launch.section("dataset")?;
    // The supervisor has opened it before, so whatever is wrong now may pass. It has resolved the
    // options too: a dataset.toml that is changed during a run does not change the run.
    let root = &launch.manifest.root;
    let open = || open(root, &config, &options).map_err(|error| error.to_string());
    let mut dataset = source::open(launch, &tolerance(&config), open)?;
    let (gyro, wheels): (GyroConfig, WheelsConfig) =
        (launch.section("gyro")?, launch.section("wheels")?);
    let samples = ScanSamples::open(&gyro, &wheels, &config.data, dataset.as_mut());
    let samples = samples.map_err(StageError::input)?;
    play(launch, dataset, samples, Pace::Sensor)
}

pub fn tolerance(config: &SourceConfig) -> Tolerance {
    Tolerance {
        retry: Duration::try_from_secs_f64(config.retry_s).unwrap_or(Duration::MAX),
        max_unreadable: config.max_unreadable,
    }
}

/// Opens the recording with the files that the supervisor has listed.
fn open(
    root: &Path,
    config: &SourceConfig,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, Box<dyn Error>> {
    Ok(match Listing::read(root)? {
        Some(Listing { format, files }) => {
            gyre_recording::reopen(&config.data, options, format, files)?
        }
        None => gyre_recording::open_resolved(&config.data, options)?,
    })
}

/// Plays the part of a dataset that the section `[source]` selects, until SIGTERM.
pub fn play(
    launch: &Launch,
    dataset: Box<dyn Dataset>,
    samples: ScanSamples,
    pace: Pace,
) -> Result<StageCounters, StageError> {
    let config: SourceConfig = launch.section("source")?;
    let once = config.played(dataset.scans());
    let first_ns = dataset.nominal_stamp_ns(once.start);
    let faults = Faults::of(config.faults.clone(), first_ns)?;
    if !config.faults.is_empty() {
        tracing::warn!(
            faults = config.faults.len(),
            "faults are put into what is played: source.faults"
        );
    }
    let mut replay = Replay {
        scans: config.stream(dataset.scans()),
        turns: Turns::of(once, dataset.as_ref()),
        burst: config.burst,
        dataset,
        samples: faults.put_into(samples)?,
        faults,
        pace,
    };
    let counters = source::run(launch, &mut replay, &tolerance(&config))?;
    let slipped_s = counters.slipped_ns as f64 * 1e-9;
    if slipped_s > NOTABLE_SLIP_S {
        tracing::warn!(slipped_s, "the simulation did not keep up with the rate");
    }
    Ok(counters)
}

struct Replay {
    dataset: Box<dyn Dataset>,
    samples: ScanSamples,
    /// The scans of the stream, counted on through all turns.
    scans: Range<usize>,
    turns: Turns,
    faults: Faults,
    burst: NonZeroUsize,
    pace: Pace,
}

impl Source for Replay {
    const HOP: StageId = StageId::RadarReplay;

    fn scans(&self) -> Range<usize> {
        self.scans.clone()
    }

    /// The stamp of a scan is the middle of its sweep; the scan is complete half a period later.
    fn complete_ns(&self, index: usize) -> Option<i64> {
        let (scan, shift_ns) = self.turns.place(index);
        Some(self.dataset.nominal_stamp_ns(scan)? + self.period_ns() / 2 + shift_ns)
    }

    fn period_ns(&self) -> i64 {
        self.dataset.period_ns()
    }

    fn burst(&self) -> NonZeroUsize {
        self.burst
    }

    fn drops_missed_scans(&self) -> bool {
        self.pace == Pace::Sensor
    }

    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), Unreadable> {
        let (scan, shift_ns) = self.turns.place(index);
        let read = self.dataset.read(scan, header.slot(bytes));
        header.set_geometry(&read.map_err(|error| match error.is_io() {
            true => Unreadable::Io(error.to_string()),
            false => Unreadable::Damaged(error.to_string()),
        })?);
        self.faults.blind(header, bytes);
        let samples = self.samples.of(self.dataset.as_ref(), header.span_ns());
        header.set_samples(bytes, &samples, 0);
        header.shift_times(shift_ns, bytes);
        Ok(())
    }
}
