//! Faults to inject into the playback of a recording.

use serde::{Deserialize, Serialize};

gyre_messages::named! {
    /// The kind of a fault.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
    )]
    #[serde(rename_all = "kebab-case")]
    pub enum PlayedFaultKind {
        /// There are no samples of the gyro.
        #[default]
        GyroOut = "gyro-out",
        /// The wheels turn 30 % faster than the vehicle drives.
        WheelsSlip = "wheels-slip",
        /// The stamps of the samples of gyro and wheels are 1 s ahead.
        ClockJump = "clock-jump",
        /// Scans show nothing.
        RadarBlind = "radar-blind",
    }
}

impl PlayedFaultKind {
    /// Share of the excess turn of slipping wheels.
    pub const SLIP_SHARE: f64 = 0.3;
    /// Jump of the stamps of samples, s.
    pub const JUMP_S: f64 = 1.0;
}

/// A fault to inject into the playback of a recording, at the same place of each turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlayedFault {
    /// `gyro-out`: no samples of the gyro; `wheels-slip`: wheels that turn 30 % too fast;
    /// `clock-jump`: stamps of the samples of gyro and wheels that are 1 s ahead; `radar-blind`:
    /// scans that show nothing.
    pub kind: PlayedFaultKind,
    /// The begin, s after the stamp of the first scan that is played.
    pub from_s: f64,
    /// The duration, s; 0: no fault.
    pub for_s: f64,
}

impl PlayedFault {
    /// Returns whether it is there at a time after the stamp of the first scan, s.
    pub fn is_at(&self, time_s: f64) -> bool {
        (self.from_s..self.from_s + self.for_s).contains(&time_s)
    }

    /// Returns the time when its last effect ends, s after the stamp of the first scan: a clock
    /// that jumps back repeats earlier stamps.
    pub fn ends_s(&self) -> f64 {
        let after_s = match self.kind {
            PlayedFaultKind::ClockJump => PlayedFaultKind::JUMP_S,
            _ => 0.0,
        };
        self.from_s + self.for_s + after_s
    }

    /// Returns the first key whose value is no time of at least 0.
    pub fn invalid(&self) -> Option<(&'static str, f64)> {
        let mut times = [("from_s", self.from_s), ("for_s", self.for_s)].into_iter();
        times.find(|(_, time_s)| !(time_s.is_finite() && *time_s >= 0.0))
    }
}
