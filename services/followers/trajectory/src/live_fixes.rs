//! The fixes of a live receiver, as they come to a trajectory.

use std::path::{Path, PathBuf};

use gyre_recording::received_fixes;
use gyre_samples::GnssConfig;
use gyre_slam::Fixes;
use gyre_stage::{GnssReceiver, StageError};

/// Receives fixes, and reads the log of all that have arrived as that of a recording is read.
pub struct LiveFixes {
    receiver: GnssReceiver,
    config: GnssConfig,
    /// The folder of the results.
    out: PathBuf,
}

impl LiveFixes {
    /// Begins to receive, in a run with its results in `out`.
    ///
    /// # Errors
    /// An address at which nothing can be received, or a file that cannot be written.
    pub fn open(config: GnssConfig, out: &Path) -> Result<Self, StageError> {
        Ok(Self {
            receiver: GnssReceiver::open(&config.listen, &received_fixes(out))?,
            out: out.to_owned(),
            config,
        })
    }

    /// Ends reception. What has arrived survives a power failure.
    ///
    /// # Errors
    /// Reception has failed.
    pub fn finish(&mut self) -> Result<(), StageError> {
        self.receiver.finish()
    }

    /// Returns all fixes that have arrived; `None` if there are no new ones. With `is_last` nothing
    /// is received after this.
    ///
    /// # Errors
    /// Reception has failed, or a log that cannot be read.
    pub fn take(&mut self, is_last: bool) -> Result<Option<Fixes>, StageError> {
        if is_last {
            self.finish()?;
        }
        let Self {
            receiver,
            config,
            out,
        } = self;
        let read = || gyre_recording::gnss_log(config, Path::new(""), out);
        let Some(log) = receiver.if_grown(read)? else {
            return Ok(None);
        };
        let log = log.map_err(|error| StageError::Input(error.to_string()))?;
        let fixes = log.map(|log| log.on_radar(config)).unwrap_or_default();
        Ok(Some(Fixes::new(fixes, config)))
    }
}
