//! Input that cannot be read for a while.

use std::time::{Duration, Instant};

use crate::{Launch, StageError};

pub(super) const PAUSE: Duration = Duration::from_millis(100);

/// Why a scan cannot be read: one sentence each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unreadable {
    /// The content is invalid: it is skipped and counted.
    Damaged(String),
    /// The file or device fails, whatever its content: it is tried again, and nothing is skipped.
    Io(String),
}

/// The limits on input that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tolerance {
    /// Time for which failing input is tried again.
    pub retry: Duration,
    /// Number of damaged scans in a row that are skipped; one more ends the source.
    pub max_unreadable: usize,
}

/// Opens the input of a source, and tries again while that fails with a sentence.
pub fn open<T>(
    launch: &Launch,
    tolerance: &Tolerance,
    mut open: impl FnMut() -> Result<T, String>,
) -> Result<T, StageError> {
    let mut attempts = Attempts::new(tolerance);
    loop {
        match open() {
            Ok(input) => return Ok(input),
            Err(reason) => attempts.failed(reason)?,
        }
        if launch.signals.sleep(PAUSE)? {
            return Err(StageError::Stopped);
        }
    }
}

/// The attempts to read the same input.
pub(super) struct Attempts {
    retry: Duration,
    first_failure: Option<Instant>,
}

impl Attempts {
    pub fn new(tolerance: &Tolerance) -> Self {
        Self {
            retry: tolerance.retry,
            first_failure: None,
        }
    }

    /// Allows another attempt after one that failed.
    pub fn failed(&mut self, reason: String) -> Result<(), StageError> {
        if self.first_failure.is_none() {
            tracing::warn!("tried again: {reason}");
        }
        let since = self.first_failure.get_or_insert_with(Instant::now);
        match since.elapsed() < self.retry {
            true => Ok(()),
            false => Err(StageError::Input(format!(
                "{reason}, and was tried again for {} s (source.retry_s): is the disk or the network folder still there?",
                self.retry.as_secs_f64()
            ))),
        }
    }
}
