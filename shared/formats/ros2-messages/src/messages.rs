//! `messages`: the package of Navtech's driver until 2024, where numbers are arrays of their bytes,
//! most significant byte first, except in `bin_size`.

use crate::{definition::package, std_msgs::Header};

package! { messages:
    /// The powers of one azimuth; see [`RadarFftDataMsg`](crate::navtech_msgs::RadarFftDataMsg).
    struct RadarFftDataMessage {
        header: Header = "std_msgs/Header header",
        /// Not to be used.
        #[serde(with = "serde_bytes")]
        angle: Vec<u8> = "uint8[] angle",
        #[serde(with = "serde_bytes")]
        azimuth: Vec<u8> = "uint8[] azimuth",
        #[serde(with = "serde_bytes")]
        sweep_counter: Vec<u8> = "uint8[] sweep_counter",
        #[serde(with = "serde_bytes")]
        ntp_seconds: Vec<u8> = "uint8[] ntp_seconds",
        #[serde(with = "serde_bytes")]
        ntp_split_seconds: Vec<u8> = "uint8[] ntp_split_seconds",
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "uint8[] data",
        #[serde(with = "serde_bytes")]
        data_length: Vec<u8> = "uint8[] data_length",
    }

    /// The radar's description of itself; see
    /// [`RadarConfigurationMsg`](crate::navtech_msgs::RadarConfigurationMsg).
    struct RadarConfigurationMessage {
        header: Header = "std_msgs/Header header",
        #[serde(with = "serde_bytes")]
        azimuth_samples: Vec<u8> = "uint8[] azimuth_samples",
        #[serde(with = "serde_bytes")]
        encoder_size: Vec<u8> = "uint8[] encoder_size",
        /// Depth of a range bin, 1e-4 m (of the oldest drivers m), a double of eight bytes, least
        /// significant first.
        #[serde(with = "serde_bytes")]
        bin_size: Vec<u8> = "uint8[] bin_size",
        #[serde(with = "serde_bytes")]
        range_in_bins: Vec<u8> = "uint8[] range_in_bins",
        /// Turns per second, or per 1000 s, two bytes.
        #[serde(with = "serde_bytes")]
        expected_rotation_rate: Vec<u8> = "uint8[] expected_rotation_rate",
    }
}
