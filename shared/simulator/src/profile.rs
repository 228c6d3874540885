//! The simulated radars, from data sheets, recordings and the literature.

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bytes before each azimuth's bins: stamp, encoder, validity or chirp, as in Oxford's files.
pub const METADATA_BYTES: usize = 11;

/// A radar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// Navtech CTS350-X as recorded by Oxford Radar RobotCar: 3768 bins of 0.0438 m.
    #[default]
    Cts350xOxford,
    /// Navtech CTS350-X as recorded by RADIATE: 576 bins of 0.1736 m.
    Cts350xRadiate,
    /// Navtech CIR204-H (Boreas until 2024, MulRan): 3360 bins of 0.0596 m, 200 m.
    Cir204h,
    /// Navtech RAS6 (Boreas-RT, FoMo): 6848 bins of 0.0438 m, 300 m, alternating chirps.
    Ras6,
    /// K2Pi (Checchin et al. 2010): 24 GHz, one turn a second, 3 degrees, 0.6 m, 3 to 100 m.
    K2pi,
}

/// The direction of the chirps, which determines the sign of the Doppler shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chirp {
    /// Approaching targets are measured too near.
    Rising,
    /// Rising in even azimuths and falling in odd ones, as recorded in each azimuth's metadata.
    Alternating,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    pub azimuths: usize,
    pub bins: usize,
    /// Range resolution, metres a bin.
    pub range_resolution_m: f64,
    /// Metres to add to a bin's range: bin `b` is at
    /// `(b + 0.5) * range_resolution_m + range_offset_m`.
    pub range_offset_m: f64,
    pub period_us: i64,
    pub encoder_counts: u16,
    /// Count of the first azimuth: real sweeps do not begin at zero.
    pub encoder_first: u16,
    /// Counts from one azimuth to the next.
    pub encoder_step: u16,
    pub chirp: Chirp,
    /// Doppler shift: metres of range for each m/s of closing speed.
    pub doppler_s: f64,
}

/// The transmitter and receiver of a radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    pub carrier_ghz: f64,
    /// Two-way half-power width of the beam, radians.
    pub beam_rad: f64,
    /// Distance between two independent range cells, metres, given the window.
    pub cell_m: f64,
    /// Power received from 1 m² is this over the fourth power of the range, at long range, in the
    /// receiver's units.
    pub constant: f64,
    /// Range below which power falls with the square only, metres: an FMCW receiver filters low
    /// beat frequencies.
    pub filter_m: f64,
    /// Range below which power rises with the square, metres: near targets lie below the beam of
    /// the antenna on the roof.
    pub near_m: f64,
    pub full_scale: f32,
    pub whole_powers: bool,
    /// Mean power of the receiver's noise by range: (m, dB above the unit), interpolated.
    pub floor_db: &'static [(f64, f64)],
}

impl Receiver {
    /// Power received from 1 m² at a range.
    pub fn sensitivity(&self, range_m: f64) -> f64 {
        let square = range_m * range_m;
        let under_beam = (self.near_m * self.near_m / square).powi(2);
        self.constant / (square * (square + self.filter_m * self.filter_m) * (1.0 + under_beam))
    }

    /// Wavelength of the carrier, metres.
    pub fn wavelength_m(&self) -> f64 {
        0.299_792_458 / self.carrier_ghz
    }
}

impl Sampling {
    pub fn step_rad(&self) -> f64 {
        f64::from(self.encoder_step) * TAU / f64::from(self.encoder_counts)
    }

    pub fn encoder_count(&self, azimuth: usize) -> u16 {
        self.encoder_first + self.encoder_step * azimuth as u16
    }

    /// Angle of an azimuth as reported, radians clockwise from straight ahead.
    pub fn azimuth_rad(&self, azimuth: usize) -> f64 {
        f64::from(self.encoder_count(azimuth)) * TAU / f64::from(self.encoder_counts)
    }

    /// Bytes of an azimuth: metadata, then powers.
    pub fn stride(&self) -> usize {
        METADATA_BYTES + self.bins
    }

    pub fn bin(&self, range_m: f64) -> f64 {
        (range_m - self.range_offset_m) / self.range_resolution_m - 0.5
    }

    /// The range of a bin's centre, metres.
    pub fn range_m(&self, bin: f64) -> f64 {
        (bin + 0.5) * self.range_resolution_m + self.range_offset_m
    }

    /// The maximum range, metres.
    pub fn reach_m(&self) -> f64 {
        self.range_m(self.bins as f64)
    }
}

impl Profile {
    pub fn sampling(self) -> Sampling {
        match self {
            Self::Cts350xOxford => OXFORD,
            Self::Cts350xRadiate => Sampling {
                bins: 576,
                range_resolution_m: 100.0 / 576.0,
                encoder_first: 0,
                ..OXFORD
            },
            Self::Cir204h => Sampling {
                bins: 3360,
                range_resolution_m: 0.0596,
                range_offset_m: -0.31,
                doppler_s: 0.049,
                ..OXFORD
            },
            Self::Ras6 => Sampling {
                bins: 6848,
                range_resolution_m: 0.043_81,
                range_offset_m: -0.31,
                chirp: Chirp::Alternating,
                doppler_s: 0.0505,
                ..OXFORD
            },
            // Checchin et al. 2010, Table 1; 3600 counts are its angular precision of 0.1 degrees.
            // The Doppler shift depends on the duration of the chirp, which is not published: 0
            // unless `sensor.doppler_s` is set.
            Self::K2pi => Sampling {
                azimuths: 120,
                bins: 162,
                range_resolution_m: 0.6,
                range_offset_m: 3.0,
                period_us: 1_000_000,
                encoder_counts: 3600,
                encoder_first: 0,
                encoder_step: 30,
                chirp: Chirp::Rising,
                doppler_s: 0.0,
            },
        }
    }

    /// The transmitter and receiver of this radar.
    pub fn receiver(self) -> Receiver {
        let oxford = Receiver {
            carrier_ghz: 76.5,
            beam_rad: 1.1f64.to_radians(),
            cell_m: 0.24,
            constant: 1.6e11,
            filter_m: 60.0,
            near_m: 4.0,
            full_scale: 1.0e7,
            whole_powers: true,
            floor_db: &OXFORD_FLOOR,
        };
        match self {
            Self::Cts350xOxford => oxford,
            Self::Cts350xRadiate => Receiver {
                constant: 6.0e11,
                full_scale: 2.0e8,
                whole_powers: false,
                floor_db: &RADIATE_FLOOR,
                ..oxford
            },
            // No recording was available: Oxford's values, with the longer cell of its smaller
            // bandwidth.
            Self::Cir204h => Receiver {
                cell_m: 0.33,
                constant: 1.6e11,
                ..oxford
            },
            Self::Ras6 => Receiver {
                constant: 1.5e12,
                full_scale: 1.0e8,
                floor_db: &RAS6_FLOOR,
                ..oxford
            },
            // Checchin et al. 2010, Table 1: 24 GHz, an angular resolution of 3 degrees, 250 MHz,
            // which is 0.6 m. Assumptions are the sensitivity (1 m² at 100 m, the maximum range, is
            // 16 dB above the floor), the filter and the floor.
            Self::K2pi => Receiver {
                carrier_ghz: 24.0,
                beam_rad: 3.0f64.to_radians(),
                cell_m: 0.6,
                constant: 2.0e10,
                filter_m: 40.0,
                whole_powers: false,
                floor_db: &K2PI_FLOOR,
                ..oxford
            },
        }
    }
}

const OXFORD: Sampling = Sampling {
    azimuths: 400,
    bins: 3768,
    range_resolution_m: 0.0438,
    range_offset_m: -0.15,
    period_us: 250_000,
    encoder_counts: 5600,
    encoder_first: 13,
    encoder_step: 14,
    chirp: Chirp::Rising,
    doppler_s: 0.042,
};

/// Floors are measured in empty azimuths of real scans; K2Pi's is assumed.
const OXFORD_FLOOR: [(f64, f64); 4] = [(2.5, 2.5), (5.0, 3.7), (60.0, 3.7), (150.0, 3.2)];
const RADIATE_FLOOR: [(f64, f64); 2] = [(5.0, 10.0), (100.0, 9.6)];
const RAS6_FLOOR: [(f64, f64); 7] = [
    (3.0, 17.0),
    (55.0, 16.0),
    (90.0, 14.1),
    (115.0, 13.6),
    (150.0, 13.1),
    (225.0, 11.6),
    (300.0, 10.2),
];
const K2PI_FLOOR: [(f64, f64); 2] = [(3.0, 8.0), (100.0, 6.0)];
