//! Faults of the radar and of its mounting: dirt, vibration, and what is not known of it.

use super::effects::{Effects, is_on};
use super::miscalibration::Miscalibration;
use super::radome::Radome;
use super::vibration::Vibration;

/// The faults of a radar.
#[derive(Clone, Debug, Default)]
pub(super) struct Faults {
    radome: Radome,
    miscalibration: Miscalibration,
    vibration: Vibration,
}

impl Faults {
    /// The faults that are switched on; one seed is one radar.
    pub fn new(effects: &Effects, seed: u64) -> Self {
        let mut faults = Self::default();
        if is_on(effects.dirt) {
            faults.radome = Radome::dirty(seed);
        }
        if is_on(effects.miscalibration) {
            faults.miscalibration = Miscalibration::draw(seed);
        }
        faults
    }

    /// Draws the vibration of a scan.
    pub fn begin_sweep(&mut self, effects: &Effects, seed: u64, scan: u64) {
        if is_on(effects.vibration) {
            self.vibration = Vibration::draw(seed, scan);
        }
    }

    /// Two-way amplitude that passes the radome at an azimuth.
    pub fn amplitude(&self, azimuth_rad: f64) -> f64 {
        self.radome.amplitude(azimuth_rad)
    }

    /// Deviation of the beam from an azimuth as reported, radians to the right.
    pub fn error_rad(&self, azimuth_rad: f64) -> f64 {
        self.miscalibration.error_rad(azimuth_rad) + self.vibration.error_rad(azimuth_rad)
    }

    /// The range at which the radar shows what is at `range_m`, metres.
    pub fn shown_m(&self, range_m: f64) -> f64 {
        self.miscalibration.shown_m(range_m)
    }
}
