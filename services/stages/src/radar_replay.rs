//! The source stage: publishes the scans of a dataset on `scan`, decoded directly into shared
//! memory.
//!
//! [`run`] opens a recording; [`play`] plays any dataset.

mod listing;
mod player;

use std::{error::Error, num::NonZeroUsize, ops::Range, path::Path};

use gyre_contract::{
    ScanHeader, StageId,
    run::{PlayedFrom, SourceConfig, StageCounters},
};
use gyre_datasets::{Dataset, DatasetOptions, ScanSamples};
use gyre_stage::{
    Launch, Source,
    source::{self, Unreadable},
};
use gyre_transport::RunError;
pub use listing::Listing;
pub use player::{Player, play_recorded};

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

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let config: SourceConfig = launch.section("source")?;
    if config.from != PlayedFrom::Scan {
        return play_recorded(launch);
    }
    let options: DatasetOptions = launch.section("dataset")?;
    // The supervisor has opened it before, so whatever is wrong now may pass. It has resolved the
    // options too: a dataset.toml that is changed during a run does not change the run.
    let (root, room) = (&launch.manifest.root, launch.manifest.limits.scan_bytes);
    let open = || match open(root, &config, &options) {
        Ok(dataset) if dataset.limits().bytes > room => Err(format!(
            "the scans of {} have become larger than when the run began (start it again when the recording is complete)",
            config.data.display()
        )),
        opened => opened.map_err(|error| error.to_string()),
    };
    let mut dataset = source::open(launch, &config, open)?;
    let sensors = launch.sensors()?;
    let samples = ScanSamples::open(&sensors.sampled(), &config.data, dataset.as_mut());
    let samples = samples.map_err(RunError::input)?;
    play(launch, dataset, samples, Pace::Sensor)
}

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
) -> Result<StageCounters, RunError> {
    let config: SourceConfig = launch.section("source")?;
    let once = config.played(dataset.scans());
    let mut replay = Replay {
        scans: config.stream(dataset.scans()),
        turns: Turns::of(once, dataset.as_ref()),
        burst: config.burst,
        dataset,
        samples,
        pace,
    };
    let counters = source::run(launch, &mut replay, &config)?;
    let slipped_s = counters.slipped_ns as f64 * 1e-9;
    if slipped_s > NOTABLE_SLIP_S {
        tracing::warn!(slipped_s, "the simulation did not keep up with the rate");
    }
    Ok(counters)
}

struct Replay {
    dataset: Box<dyn Dataset>,
    samples: ScanSamples,
    scans: Range<usize>,
    turns: Turns,
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
        let samples = self.samples.of(self.dataset.as_ref(), header.span_ns());
        header.set_samples(bytes, &samples, 0);
        header.shift_times(shift_ns, bytes);
        Ok(())
    }
}

/// The turns of a part of a recording. Each turn continues in time where the one before ended.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Turns {
    once: Range<usize>,
    /// Duration of a turn, ns: from its first scan to the first one of the next turn.
    turn_ns: i64,
}

impl Turns {
    /// The turns of these scans. Where their times are not known without decoding, a turn lasts a
    /// period for each scan.
    fn of(once: Range<usize>, dataset: &dyn Dataset) -> Self {
        let stamp_ns = |scan| dataset.nominal_stamp_ns(scan);
        let ends = || Some(stamp_ns(once.end.checked_sub(1)?)? - stamp_ns(once.start)?);
        let period_ns = dataset.period_ns();
        let turn_ns = match ends() {
            Some(span_ns) if span_ns >= 0 => span_ns + period_ns,
            _ => once.len() as i64 * period_ns,
        };
        Self { once, turn_ns }
    }

    /// Returns the index in the recording of scan `index` of the stream, and the offset to add to
    /// its times, ns.
    fn place(&self, index: usize) -> (usize, i64) {
        let (scans, after) = (self.once.len(), index.saturating_sub(self.once.start));
        // Without a turn there is nothing to play; the reader reports it.
        if scans == 0 || after < scans {
            return (index, 0);
        }
        let turn = (after / scans) as i64;
        let shift_ns = self.turn_ns.saturating_mul(turn);
        (self.once.start + after % scans, shift_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_of_later_turns_are_the_same_and_their_times_go_on() {
        let turns = Turns {
            once: 5..8,
            turn_ns: 750,
        };
        let places: Vec<_> = (5..12).map(|index| turns.place(index)).collect();
        assert_eq!(places[..3], [(5, 0), (6, 0), (7, 0)]);
        assert_eq!(places[3..6], [(5, 750), (6, 750), (7, 750)]);
        assert_eq!(places[6], (5, 1500));
    }
}
