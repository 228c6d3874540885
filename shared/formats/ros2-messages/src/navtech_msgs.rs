//! `navtech_msgs`: what Navtech's driver publishes of a radar.
//!
//! Sources: `navtech_msgs` and the publishers `colossus_publisher` and `b_scan_extended_publisher`
//! of Navtech's driver.

use serde::{Deserialize, Serialize};

use crate::{definition::message, sensor_msgs::Image, std_msgs::Header};

/// The powers of one azimuth: the topic `radar_data/fft_data`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RadarFftDataMsg {
    /// The time of receipt by the driver.
    pub header: Header,
    /// Not to be used: the driver divides by the number of azimuths, where it should divide by the
    /// encoder's counts.
    pub angle: f64,
    /// Encoder count of the antenna, clockwise from straight ahead.
    pub azimuth: u16,
    /// Number of the azimuth, incremented with each one; wraps.
    pub sweep_counter: u16,
    /// Seconds of the radar's clock, as the radar sends them, whose byte order the driver does not
    /// change; 0 without a clock.
    pub ntp_seconds: u32,
    /// Nanoseconds or microseconds of the second, likewise.
    pub ntp_split_seconds: u32,
    /// The powers, nearest bin first.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
    pub data_length: u16,
}
message!(
    RadarFftDataMsg,
    "navtech_msgs",
    "std_msgs/Header header\nfloat64 angle\nuint16 azimuth\nuint16 sweep_counter\nuint32 ntp_seconds\n\
     uint32 ntp_split_seconds\nuint8[] data\nuint16 data_length\n",
    [Header]
);

/// The radar's description of itself: the topic `radar_data/configuration_data`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RadarConfigurationMsg {
    /// The time of receipt by the driver.
    pub header: Header,
    /// Azimuths per turn.
    pub azimuth_samples: u16,
    /// Encoder counts per turn.
    pub encoder_size: u16,
    /// The rotation of images by the driver, in rows; the encoder values beside them are not
    /// rotated.
    pub azimuth_offset: u16,
    /// Depth of a range bin, 1e-4 m.
    pub bin_size: f32,
    /// Range bins per azimuth, at most.
    pub range_in_bins: u16,
    /// Turns per second, or per 1000 s, as the version of the driver.
    pub expected_rotation_rate: u16,
    pub range_gain: f32,
    pub range_offset: f32,
}
message!(
    RadarConfigurationMsg,
    "navtech_msgs",
    "std_msgs/Header header\nuint16 azimuth_samples\nuint16 encoder_size\nuint16 azimuth_offset\n\
     float32 bin_size\nuint16 range_in_bins\nuint16 expected_rotation_rate\nfloat32 range_gain\nfloat32 range_offset\n",
    [Header]
);

/// The powers of one turn: the topic `radar_data/b_scan_msg`.
///
/// The driver puts an azimuth into the row of its encoder count divided by the whole number of
/// counts per azimuth, and leaves the rows that it does not reach at zero: encoder value, time and
/// powers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RadarBScanMsg {
    /// The powers, `8UC1`, a row for an azimuth; stamped with the time of row 199.
    pub b_scan_img: Image,
    /// Encoder count of each row.
    pub encoder_values: Vec<u16>,
    /// Time of each row, ns of the radar's clock; the driver computes it in floating point, to 256
    /// ns. FoMo's converter writes microseconds.
    pub timestamps: Vec<u64>,
}
message!(
    RadarBScanMsg,
    "navtech_msgs",
    "sensor_msgs/Image b_scan_img\nuint16[] encoder_values\nuint64[] timestamps\n",
    [Image]
);
