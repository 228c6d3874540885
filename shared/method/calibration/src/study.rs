//! A drive with its findings, and several drives of one radar together.

use crate::{Calibration, CalibrationError, Configured, Drive, Found, calibrate};

pub struct Study {
    pub drive: Drive,
    pub calibration: Calibration,
    pub found: Found,
}

impl Study {
    pub fn new(drive: Drive, configured: &Configured) -> Result<Self, CalibrationError> {
        let calibration = calibrate(&drive)?;
        let found = Found::new(&drive, &calibration, configured)?;
        Ok(Self {
            drive,
            calibration,
            found,
        })
    }

    /// Combines the findings of several drives of one radar, each with its own uncertainty. It is
    /// proposed if their scans overlap more with it, all together.
    pub fn combined(studies: &[Self]) -> Result<Found, CalibrationError> {
        let found: Vec<_> = studies.iter().map(|it| &it.found).collect();
        let mean = Found::mean(&found);
        let (change, mut overlap) = (mean.change(), [0.0; 2]);
        for Self {
            drive, calibration, ..
        } in studies
        {
            let share = drive.sweeps.len() as f64 / mean.scans as f64;
            let of_drive = calibration.overlap_with(drive, &change)?;
            overlap = [0, 1].map(|k| overlap[k] + share * of_drive[k]);
        }
        Ok(mean.compared(overlap))
    }
}
