//! The loop of the first stage: publishes a scan when the window admits it and, at a given rate,
//! when it is due.

mod feed;
mod fixes;
mod live_samples;
mod pace;
mod playback;
mod player;
mod position;
mod predictions;

mod sensor;

use std::{
    num::{NonZeroU64, NonZeroUsize},
    ops::Range,
    time::{Duration, Instant},
};

use gyre_contract::{ScanHeader, StageId, run::SourceConfig};
use rustix::thread::set_current_timer_slack;

use crate::Launch;
pub use feed::Credit;
pub(crate) use feed::{Feed, hop};
pub use fixes::fixes_sent;
use gyre_contract::run::StageCounters;
use gyre_transport::RunError;
use pace::Pace;
use playback::Playback;

pub use gyre_transport::RecordedMessage;
pub use player::run_player;

pub use sensor::{Arrival, Sensor, run_sensor};

pub trait Source {
    /// The stage that it is, or replaces.
    const HOP: StageId;

    /// The scans to play, by their index in the recording.
    fn scans(&self) -> Range<usize>;

    /// Time when scan `index` is complete on the sensor's clock, ns since 1970, if it is known
    /// without reading the scan. Without it a restarted source in live mode cannot determine the
    /// missed scans, and plays them late.
    fn complete_ns(&self, index: usize) -> Option<i64>;

    /// Time between two scans, ns.
    fn period_ns(&self) -> i64;

    /// Number of scans that become due at once, when the last of them is complete.
    fn burst(&self) -> NonZeroUsize {
        NonZeroUsize::MIN
    }

    /// Returns whether live mode drops the scans that become due while this process is busy or
    /// down, as with a real sensor.
    fn drops_missed_scans(&self) -> bool;

    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), Unreadable>;
}

/// Runs the source until SIGTERM.
pub fn run(
    launch: &Launch,
    source: &mut impl Source,
    config: &SourceConfig,
) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let mut playback = Playback {
        feed: Feed::of_scans(launch)?,
        source,
        config,
    };
    // By default the system ends a wait up to 50 us late. If it refuses, scans are that late.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    let ended = playback.play();
    playback.feed.finish(ended)
}

const PAUSE: Duration = Duration::from_millis(100);

/// Why a scan cannot be read: one sentence each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unreadable {
    /// The content is invalid: it is skipped and counted.
    Damaged(String),
    /// The file or device fails, whatever its content: it is tried again, and nothing is skipped.
    Io(String),
}

/// Opens the input of a source, and tries again while that fails with a sentence.
pub fn open<T>(
    launch: &Launch,
    config: &SourceConfig,
    mut open: impl FnMut() -> Result<T, String>,
) -> Result<T, RunError> {
    let mut attempts = Attempts::new(config);
    loop {
        match open() {
            Ok(input) => return Ok(input),
            Err(reason) => attempts.failed(reason)?,
        }
        if launch.signals.sleep(PAUSE)? {
            return Err(RunError::Stopped);
        }
    }
}

struct Attempts {
    retry: Duration,
    first_failure: Option<Instant>,
}

impl Attempts {
    fn new(config: &SourceConfig) -> Self {
        Self {
            retry: Duration::try_from_secs_f64(config.retry_s).unwrap_or(Duration::MAX),
            first_failure: None,
        }
    }

    fn failed(&mut self, reason: String) -> Result<(), RunError> {
        if self.first_failure.is_none() {
            tracing::warn!("tried again: {reason}");
        }
        let since = self.first_failure.get_or_insert_with(Instant::now);
        match since.elapsed() < self.retry {
            true => Ok(()),
            false => Err(RunError::Input(format!(
                "{reason}, and was tried again for {} s (source.retry_s): is the disk or the network folder still there?",
                self.retry.as_secs_f64()
            ))),
        }
    }
}
