//! The section `[masking]`.

use serde::{Deserialize, Serialize};

/// How to mask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaskingConfig {
    /// `none`, or `threshold`: power below [`MaskingConfig::threshold`] counts as nothing. Default `threshold`.
    pub kind: MaskKind,
    /// Power that counts as nothing, 0 to 255. Default 60.
    pub threshold: u8,
    /// Undo the distortion that the vehicle's motion puts into a sweep. Default true.
    pub compensate: bool,
    /// Which motion to undo it with: that of the scan so many scans before, at least 1. With 2 or more the stages overlap
    /// across scans. Default 2.
    pub lag: usize,
    /// Undo Doppler's shift in the rasters too, with the same motion, where the scan knows it. At constant speed the shift
    /// cancels between rasters; undone, it cancels only between scans that both know their motion, and a motion seems
    /// too short by the whole shift where compensation sets in. Default false.
    pub undo_doppler: bool,
    /// Wait so long over each scan, ms: to see what happens under load. Default 0.
    pub stress_delay_ms: u64,
}

/// The masks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaskKind {
    /// Everything counts.
    None,
    /// Weak returns count as nothing.
    Threshold,
}

impl Default for MaskingConfig {
    fn default() -> Self {
        Self {
            kind: MaskKind::Threshold,
            threshold: 60,
            compensate: true,
            lag: 2,
            undo_doppler: false,
            stress_delay_ms: 0,
        }
    }
}

impl MaskingConfig {
    /// Power that counts as nothing.
    pub fn floor(&self) -> u8 {
        match self.kind {
            MaskKind::None => 0,
            MaskKind::Threshold => self.threshold,
        }
    }

    /// The lag of the motions that masking waits for; 0 where it waits for none.
    pub fn feedback_lag(&self) -> usize {
        if self.compensate { self.lag } else { 0 }
    }
}
