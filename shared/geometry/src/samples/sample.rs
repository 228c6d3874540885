use bytemuck::{Pod, Zeroable};

use crate::samples::{Geographic, SampleKind};

/// One measurement of a sensor beside the radar, as it is logged, and as it travels with a scan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sample {
    /// When it was measured, ns since 1970: with a scan on the radar's clock, in a log on the
    /// sensor's own.
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

impl Sample {
    pub const fn of(kind: SampleKind, stamp_ns: i64, values: [f64; 6]) -> Self {
        Self {
            stamp_ns,
            kind: kind as u32,
            reserved: 0,
            values,
        }
    }

    /// Creates a sample of a gyro that measures the yaw rate alone, counter-clockwise, rad/s.
    pub fn yaw_rate(stamp_ns: i64, rate_radps: f64) -> Self {
        let values = [0.0, 0.0, rate_radps, 0.0, 0.0, 0.0];
        Self::of(SampleKind::Gyro, stamp_ns, values)
    }

    pub fn speed(stamp_ns: i64, speed_mps: f64) -> Self {
        let values = [speed_mps, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self::of(SampleKind::Wheels, stamp_ns, values)
    }

    /// Creates a fix at a place with its altitude and standard deviation, m.
    pub fn fix(stamp_ns: i64, [a, b]: [f64; 2], altitude_m: f64, sigma_m: f64) -> Self {
        let values = [a, b, altitude_m, sigma_m, 0.0, 0.0];
        Self::of(SampleKind::Gnss, stamp_ns, values)
    }

    /// The place of a fix: latitude and longitude, degrees, or m east and north.
    pub fn place(&self) -> [f64; 2] {
        [self.values[0], self.values[1]]
    }

    /// The standard deviation of a fix that is stated, m.
    pub fn sigma_m(&self) -> Option<f64> {
        Some(self.values[3]).filter(|sigma_m| *sigma_m > 0.0)
    }

    pub fn geographic(&self) -> Geographic {
        Geographic {
            latitude_deg: self.values[0],
            longitude_deg: self.values[1],
        }
    }

    /// Returns the standard deviation along each of both axes with these variances along them, m²;
    /// 0 if one is unknown, which is negative or not a number.
    pub fn sigma_of(variances_m2: [f64; 2]) -> f64 {
        match variances_m2.iter().all(|variance| *variance >= 0.0) {
            true => (0.5 * (variances_m2[0] + variances_m2[1])).sqrt(),
            false => 0.0,
        }
    }

    /// Returns whether it can travel with a scan: its kind does, all its values are finite, and its
    /// rates are within [`MAX_RATE_RADPS`], its speed within [`MAX_SPEED_MPS`].
    pub fn is_valid(&self) -> bool {
        let mut kinds = SampleKind::ALL.into_iter();
        let bounded = kinds.find_map(|kind| kind.bounded().filter(|_| self.is(kind)));
        let is_measured = bounded.is_some_and(|(count, most)| {
            self.values[..count].iter().all(|value| value.abs() <= most)
        });
        is_measured && self.values.iter().all(|value| value.is_finite())
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

/// The samples of a sensor that a recording has, in the order of the recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Logged {
    /// The topic in a bag of ROS 2.
    pub topic: Option<String>,
    pub samples: Vec<Sample>,
    /// Messages that state that nothing was measured.
    pub unmeasured: usize,
}

impl From<Vec<Sample>> for Logged {
    fn from(samples: Vec<Sample>) -> Self {
        Self {
            samples,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{SampleKind::*, *};

    #[test]
    fn a_line_is_a_sample_of_its_kind_or_none() {
        let stamp = 1_700_000_000_000_000_001;
        let rates = |values| Some(Sample::of(Gyro, stamp, values));
        for (kind, line, expected) in [
            (
                Gyro,
                "1700000000000000001, 0.1,-0.2,0.3",
                rates([0.1, -0.2, 0.3, 0.0, 0.0, 0.0]),
            ),
            (
                Gyro,
                " 1700000000000000001,0,0,1e-3,0.5,0,9.8 ",
                rates([0.0, 0.0, 1e-3, 0.5, 0.0, 9.8]),
            ),
            (
                Wheels,
                "1700000000000000001, 8.25",
                Some(Sample::speed(stamp, 8.25)),
            ),
            (Wheels, "17,-1", Some(Sample::speed(17, -1.0))),
        ] {
            assert_eq!(kind.parse(line), expected, "{kind:?}: {line}");
        }
        let of_gyro = [
            "1.5,0,0,0",
            "17,0,0",
            "17,0,0,0,1",
            "17,0,0,0,1,2,3,4",
            "17,0,x,0",
        ];
        let of_wheels = ["17,x", "1.5,3", "17,3,4"];
        for (kind, lines) in [(Gyro, &of_gyro[..]), (Wheels, &of_wheels)] {
            for line in ["hello", "17", "17,"].iter().chain(lines) {
                assert_eq!(kind.parse(line), None, "{kind:?}: {line}");
            }
        }
    }
}
