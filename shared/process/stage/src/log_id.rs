//! The logs of a run, and the events of their growth.

/// A log of a run that followers read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogId {
    Keyframes,
    Loops,
    /// All scans with their points, by pose-integration.
    Scans,
}

pub(crate) const LOGS: [LogId; 3] = [LogId::Keyframes, LogId::Loops, LogId::Scans];

impl LogId {
    /// Returns the name of the event of its growth.
    pub(crate) const fn event(self) -> &'static str {
        match self {
            Self::Keyframes => "keyframes_grown",
            Self::Loops => "loops_grown",
            Self::Scans => "scans_grown",
        }
    }
}
