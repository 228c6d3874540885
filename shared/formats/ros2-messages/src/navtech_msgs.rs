//! `navtech_msgs`: what Navtech's driver publishes of a radar.
//!
//! Sources: `navtech_msgs` and the publishers `colossus_publisher` and `b_scan_extended_publisher`
//! of Navtech's driver.

use crate::{definition::package, sensor_msgs::Image, std_msgs::Header};

package! { navtech_msgs:
    /// The powers of one azimuth, nearest bin first: the topic `radar_data/fft_data`.
    struct RadarFftDataMsg {
        /// The time of receipt by the driver.
        header: Header = "std_msgs/Header header",
        /// Not to be used: the driver divides by the number of azimuths, where it should divide by
        /// the encoder's counts.
        angle: f64 = "float64 angle",
        /// Encoder count of the antenna, clockwise from straight ahead.
        azimuth: u16 = "uint16 azimuth",
        /// Number of the azimuth, incremented with each one; wraps.
        sweep_counter: u16 = "uint16 sweep_counter",
        /// Seconds of the radar's clock, as the radar sends them, whose byte order the driver does
        /// not change; 0 without a clock.
        ntp_seconds: u32 = "uint32 ntp_seconds",
        /// Nanoseconds or microseconds of the second, likewise.
        ntp_split_seconds: u32 = "uint32 ntp_split_seconds",
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "uint8[] data",
        data_length: u16 = "uint16 data_length",
    }

    /// The radar's description of itself: the topic `radar_data/configuration_data`.
    struct RadarConfigurationMsg {
        /// The time of receipt by the driver.
        header: Header = "std_msgs/Header header",
        /// Azimuths per turn.
        azimuth_samples: u16 = "uint16 azimuth_samples",
        encoder_size: u16 = "uint16 encoder_size",
        /// The rotation of images by the driver, in rows; the encoder values beside them are not
        /// rotated.
        azimuth_offset: u16 = "uint16 azimuth_offset",
        /// Depth of a range bin, 1e-4 m.
        bin_size: f32 = "float32 bin_size",
        /// Range bins per azimuth, at most.
        range_in_bins: u16 = "uint16 range_in_bins",
        /// Turns per second, or per 1000 s, as the version of the driver.
        expected_rotation_rate: u16 = "uint16 expected_rotation_rate",
        range_gain: f32 = "float32 range_gain",
        range_offset: f32 = "float32 range_offset",
    }

    /// The powers of one turn: the topic `radar_data/b_scan_msg`.
    ///
    /// The driver puts an azimuth into the row of its encoder count divided by the whole number of
    /// counts per azimuth, and leaves the rows that it does not reach at zero: encoder value, time
    /// and powers.
    struct RadarBScanMsg {
        /// The powers, `8UC1`, a row for an azimuth; stamped with the time of row 199.
        b_scan_img: Image = "sensor_msgs/Image b_scan_img",
        encoder_values: Vec<u16> = "uint16[] encoder_values",
        /// Time of each row, ns of the radar's clock; the driver computes it in floating point, to
        /// 256 ns. FoMo's converter writes microseconds.
        timestamps: Vec<u64> = "uint64[] timestamps",
    }
}
