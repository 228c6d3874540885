use gyre_estimation::places::Registrar;
use gyre_geometry::{Pose, UncertainMotion};
use gyre_scan_matching::{MotionMatch, RefinementConfig, SettingError, Submap};

use crate::localisation::sight::Sight;

/// Factor of the covariance of a registration with the map over a registration with the scans just
/// before.
const VARIANCE_SCALE: f64 = 2.0;

/// Registers a scan with submaps. Planned once; nothing is allocated afterwards.
pub(crate) struct Registration {
    registrar: Registrar,
    sight: Sight,
}

impl Registration {
    pub fn new(refinement: &RefinementConfig, capacity: usize) -> Result<Self, SettingError> {
        Ok(Self {
            registrar: Registrar::new(refinement, capacity)?,
            sight: Sight::new(Registrar::CELLS),
        })
    }

    pub fn set_scan(&mut self, scan: &Submap) {
        self.registrar.set_later(scan);
        self.sight.look(scan);
    }

    pub fn set_place(&mut self, place: &Submap) {
        self.registrar.set_earlier(place);
    }

    /// Searches for the translation, if the scan's yaw in the submap's frame is `yaw_rad`.
    pub fn search(&mut self, yaw_rad: f64) -> MotionMatch {
        self.registrar.search(yaw_rad, self.sight.seen())
    }

    /// Aligns the scan from an initial guess within some metres: its pose in the submap's frame,
    /// and the masked correlation there; `None` if its points do not determine it.
    pub fn align(
        &mut self,
        scan: &Submap,
        place: &Submap,
        initial: &Pose,
    ) -> Option<(UncertainMotion, f64)> {
        let aligner = &mut self.registrar.aligner;
        let mut motion = aligner.align_to_submap(scan, place, initial)?;
        motion.covariance *= VARIANCE_SCALE;
        let seen = self.sight.seen();
        let correlation = self.registrar.correlation(&motion.motion, seen);
        Some((motion, correlation))
    }
}
