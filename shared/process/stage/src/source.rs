//! The loop of the first stage: publishes a scan when the window admits it and, at a given rate,
//! when it is due.

mod attempts;
mod credit;
mod feed;
mod live_samples;
mod pace;
mod playback;
mod player;
mod position;
mod received;
mod sensor;

use std::{
    num::{NonZeroU64, NonZeroUsize},
    ops::Range,
};

use rustix::thread::set_current_timer_slack;

use gyre_messages::{ScanHeader, StageId};

use crate::{Launch, StageCounters, StageError, writer::Writer};
pub(crate) use credit::Credit;
pub(crate) use feed::{Feed, hop};
use pace::Pace;
use playback::Playback;

pub use crate::outlet::RecordedMessage;
pub use attempts::{Tolerance, Unreadable, open};
pub use player::{Recorded, run_player};
pub use received::{LastScan, Received, read as received_of};
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

    /// Reads scan `index` into shared memory.
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
    tolerance: &Tolerance,
) -> Result<StageCounters, StageError> {
    launch.take_place()?;
    let mut playback = Playback {
        feed: Feed::open(launch, || Writer::open(&launch.node, &launch.manifest))?,
        source,
        tolerance,
    };
    // By default the system ends a wait up to 50 us late. If it refuses, scans are that late.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    let ended = playback.play();
    playback.feed.finish(ended)
}
