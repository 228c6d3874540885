//! The fixes of a live receiver, as they come to a trajectory.

use std::path::Path;

use gyre_recording::{ReceivedFixes, received_fixes};
use gyre_samples::GnssConfig;
use gyre_slam::Fixes;
use gyre_stage::{GnssReceiver, StageError};

/// The time to examine all fixes grows with their number. So during the run they are examined when
/// one in so many is new: after ten hours at 20 Hz that is every 18 s.
const NEW_SHARE: usize = 2000;

/// Receives fixes, and reads the log of all that have arrived on.
pub struct LiveFixes {
    receiver: GnssReceiver,
    config: GnssConfig,
    received: ReceivedFixes,
    examined: usize,
}

impl LiveFixes {
    /// Begins to receive, in a run with its results in `out`.
    pub fn open(config: GnssConfig, out: &Path) -> Result<Self, StageError> {
        let log = received_fixes(out);
        Ok(Self {
            receiver: GnssReceiver::open(&config.listen, &log)?,
            received: ReceivedFixes::new(&log),
            examined: 0,
            config,
        })
    }

    /// Ends reception. Received fixes survive a power failure.
    pub fn finish(&mut self) -> Result<(), StageError> {
        self.receiver.finish()
    }

    /// Returns all fixes that have arrived; `None` if there are no new ones, or few beside all.
    /// With `is_last` nothing is received after this.
    pub fn take(&mut self, is_last: bool) -> Result<Option<Fixes>, StageError> {
        if is_last {
            self.finish()?;
        }
        let received = &mut self.received;
        let read = self.receiver.if_grown(|| received.read_on())?;
        read.unwrap_or(Ok(())).map_err(StageError::input)?;
        let new = self.received.count() - self.examined;
        let least = if is_last {
            1
        } else {
            self.examined / NEW_SHARE + 1
        };
        Ok((new >= least).then(|| {
            self.examined += new;
            let fixes = self.received.log().on_radar(&self.config);
            Fixes::new(fixes, &self.config)
        }))
    }
}
