//! `messages`: the package of Navtech's driver until 2024, where numbers are arrays of their bytes,
//! most significant byte first, except in `bin_size`.

use serde::{Deserialize, Serialize};

use crate::{definition::message, std_msgs::Header};

/// The powers of one azimuth; see [`RadarFftDataMsg`](crate::navtech_msgs::RadarFftDataMsg).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RadarFftDataMessage {
    /// The time of receipt by the driver.
    pub header: Header,
    /// Not to be used.
    #[serde(with = "serde_bytes")]
    pub angle: Vec<u8>,
    /// Encoder count of the antenna, two bytes.
    #[serde(with = "serde_bytes")]
    pub azimuth: Vec<u8>,
    /// Number of the azimuth, two bytes.
    #[serde(with = "serde_bytes")]
    pub sweep_counter: Vec<u8>,
    /// Seconds of the radar's clock, four bytes.
    #[serde(with = "serde_bytes")]
    pub ntp_seconds: Vec<u8>,
    /// Split seconds, four bytes.
    #[serde(with = "serde_bytes")]
    pub ntp_split_seconds: Vec<u8>,
    /// The powers, nearest bin first.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
    /// Their number, two bytes.
    #[serde(with = "serde_bytes")]
    pub data_length: Vec<u8>,
}
message!(
    RadarFftDataMessage,
    "messages",
    "std_msgs/Header header\nuint8[] angle\nuint8[] azimuth\nuint8[] sweep_counter\nuint8[] ntp_seconds\n\
     uint8[] ntp_split_seconds\nuint8[] data\nuint8[] data_length\n",
    [Header]
);

/// The radar's description of itself; see
/// [`RadarConfigurationMsg`](crate::navtech_msgs::RadarConfigurationMsg).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RadarConfigurationMessage {
    /// The time of receipt by the driver.
    pub header: Header,
    /// Azimuths per turn, two bytes.
    #[serde(with = "serde_bytes")]
    pub azimuth_samples: Vec<u8>,
    /// Encoder counts per turn, two bytes.
    #[serde(with = "serde_bytes")]
    pub encoder_size: Vec<u8>,
    /// Depth of a range bin, 1e-4 m (of the oldest drivers m), a double of eight bytes, least
    /// significant first.
    #[serde(with = "serde_bytes")]
    pub bin_size: Vec<u8>,
    /// Range bins per azimuth, two bytes.
    #[serde(with = "serde_bytes")]
    pub range_in_bins: Vec<u8>,
    /// Turns per second, or per 1000 s, two bytes.
    #[serde(with = "serde_bytes")]
    pub expected_rotation_rate: Vec<u8>,
}
message!(
    RadarConfigurationMessage,
    "messages",
    "std_msgs/Header header\nuint8[] azimuth_samples\nuint8[] encoder_size\nuint8[] bin_size\nuint8[] range_in_bins\n\
     uint8[] expected_rotation_rate\n",
    [Header]
);
