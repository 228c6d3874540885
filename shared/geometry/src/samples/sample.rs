use bytemuck::{Pod, Zeroable};

/// One measurement of a sensor beside the radar, as it travels with a scan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sample {
    /// When it was measured, ns since 1970 on the radar's clock.
    pub stamp_ns: i64,
    /// The quantity: a number of [`SampleKind`].
    pub kind: u32,
    pub reserved: u32,
    /// The values that [`SampleKind`] names; unused ones are zero.
    pub values: [f64; 6],
}

/// The most samples that travel with one scan: a second at 1000 Hz.
pub const MAX_SAMPLES: usize = 1024;

/// The largest speed of a sample, m/s: no vehicle on wheels with a radar drives faster.
pub const MAX_SPEED_MPS: f64 = 150.0;

/// The largest angular velocity of a sample, rad/s: 2000 degrees a second, the widest range of
/// gyros of this kind.
pub const MAX_RATE_RADPS: f64 = 35.0;

/// The quantity that a sample measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SampleKind {
    /// Angular velocity about x, y, z (rad/s), then acceleration along them (m/s²).
    Gyro = 1,
    /// Speed along x (m/s), negative backwards.
    Wheels = 2,
}

impl SampleKind {
    pub const fn section(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Wheels => "wheels",
        }
    }
}

impl Sample {
    /// Creates a sample of a gyro that measures the yaw rate alone, counter-clockwise, rad/s.
    pub fn yaw_rate(stamp_ns: i64, rate_radps: f64) -> Self {
        Self {
            stamp_ns,
            kind: SampleKind::Gyro as u32,
            reserved: 0,
            values: [0.0, 0.0, rate_radps, 0.0, 0.0, 0.0],
        }
    }

    pub fn speed(stamp_ns: i64, speed_mps: f64) -> Self {
        Self {
            stamp_ns,
            kind: SampleKind::Wheels as u32,
            reserved: 0,
            values: [speed_mps, 0.0, 0.0, 0.0, 0.0, 0.0],
        }
    }

    /// Returns whether its kind is known, all its values are finite, and its rates are within
    /// [`MAX_RATE_RADPS`], its speed within [`MAX_SPEED_MPS`].
    pub fn is_valid(&self) -> bool {
        let within = |values: &[f64], most: f64| values.iter().all(|value| value.abs() <= most);
        let are_finite = self.values.iter().all(|value| value.is_finite());
        let is_measured = (self.is(SampleKind::Gyro) && within(&self.values[..3], MAX_RATE_RADPS))
            || (self.is(SampleKind::Wheels) && within(&self.values[..1], MAX_SPEED_MPS));
        are_finite && is_measured
    }

    /// Returns the key of the order of samples on the way: by their stamps, and for one stamp by
    /// their kinds. No two have the same.
    pub fn order(&self) -> (i64, u32) {
        (self.stamp_ns, self.kind)
    }

    pub fn is(&self, kind: SampleKind) -> bool {
        self.kind == kind as u32
    }
}
