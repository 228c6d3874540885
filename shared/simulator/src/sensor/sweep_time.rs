#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepTime {
    pub start_us: i64,
    pub period_us: i64,
    pub azimuths: usize,
    /// The start of the drive, microseconds since 1970.
    pub epoch_us: i64,
}

impl SweepTime {
    pub fn stamp_us(&self, azimuth: usize) -> i64 {
        self.start_us + self.period_us * azimuth as i64 / self.azimuths as i64
    }

    /// Middle of the sweep: half-way between the first and the last azimuth, microseconds since
    /// 1970.
    pub fn middle_us(&self) -> i64 {
        self.start_us + (self.stamp_us(self.azimuths - 1) - self.start_us) / 2
    }

    /// Time of a stamp since the start of the drive, seconds.
    pub fn drive_time_s(&self, stamp_us: i64) -> f64 {
        (stamp_us - self.epoch_us) as f64 * 1e-6
    }
}
