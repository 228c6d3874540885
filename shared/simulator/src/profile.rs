//! The radars that can be simulated: what their data sheets, their recordings and the literature say of them.

use serde::{Deserialize, Serialize};

/// A radar by its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// Navtech CTS350-X as Oxford Radar RobotCar recorded it: 3768 bins of 0.0438 m.
    #[default]
    Cts350xOxford,
    /// Navtech CTS350-X as RADIATE recorded it: 576 bins of 0.1736 m.
    Cts350xRadiate,
    /// Navtech CIR204-H (Boreas until 2024, MulRan): 3360 bins of 0.0596 m, 200 m.
    Cir204h,
    /// Navtech RAS6 (Boreas-RT, FoMo): 6848 bins of 0.0438 m, 300 m, rising and falling chirps by turns.
    Ras6,
    /// K2Pi (Checchin et al. 2010): 24 GHz, one turn a second, 3 degrees, 0.6 m, 3 to 100 m.
    K2pi,
}

/// The chirps' direction, which gives Doppler's shift its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chirp {
    /// What approaches reads too near.
    Rising,
    /// What approaches reads too far.
    Falling,
    /// Rising in even azimuths, falling in odd ones, and each says which.
    Alternating,
}

/// How a radar samples the world around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Azimuths of a turn.
    pub azimuths: usize,
    /// Range bins of an azimuth.
    pub bins: usize,
    /// Metres a range bin.
    pub range_resolution_m: f64,
    /// Metres to add to a bin's range: bin `b` is at `(b + 0.5) * range_resolution_m + range_offset_m`.
    pub range_offset_m: f64,
    /// Time of one turn, microseconds.
    pub period_us: i64,
    /// Counts of the encoder in one turn.
    pub encoder_counts: u16,
    /// Count of the first azimuth: real sweeps do not begin at zero.
    pub encoder_first: u16,
    /// Counts from one azimuth to the next.
    pub encoder_step: u16,
    /// The chirps' direction.
    pub chirp: Chirp,
    /// Metres of range that a closing speed of 1 m/s shifts an echo by.
    pub doppler_s: f64,
}

impl Profile {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Cts350xOxford, Self::Cts350xRadiate, Self::Cir204h, Self::Ras6, Self::K2pi];

    /// How it samples.
    pub fn sampling(self) -> Sampling {
        let oxford = Sampling {
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
        match self {
            Self::Cts350xOxford => oxford,
            Self::Cts350xRadiate => {
                Sampling { bins: 576, range_resolution_m: 100.0 / 576.0, encoder_first: 0, ..oxford }
            }
            Self::Cir204h => {
                Sampling { bins: 3360, range_resolution_m: 0.0596, range_offset_m: -0.31, doppler_s: 0.049, ..oxford }
            }
            Self::Ras6 => Sampling {
                bins: 6848,
                range_resolution_m: 0.043_81,
                range_offset_m: -0.31,
                chirp: Chirp::Alternating,
                doppler_s: 0.0505,
                ..oxford
            },
            // 3 degrees are 46.67 counts of 5600; 3600 counts divide evenly.
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
}
