//! Messages of one azimuth.

use gyre_colossus::{Azimuth, Powers};

use crate::{Ros2Message, cdr::bad, messages::RadarFftDataMessage, navtech_msgs::RadarFftDataMsg};

impl RadarFftDataMsg {
    /// Returns the azimuth as the radar sent it. The angle comes from the encoder, because
    /// [`RadarFftDataMsg::angle`] is wrong.
    pub fn azimuth(&self) -> Azimuth<'_> {
        Azimuth {
            sweep_counter: self.sweep_counter,
            encoder: self.azimuth,
            seconds: self.ntp_seconds.to_le_bytes(),
            split_seconds: self.ntp_split_seconds.to_le_bytes(),
            powers: Powers::Eight(&self.data),
        }
    }
}

impl RadarFftDataMessage {
    pub fn azimuth(&self) -> Result<Azimuth<'_>, String> {
        let sweep_counter = number::<Self, 2>("sweep_counter", &self.sweep_counter)?;
        Ok(Azimuth {
            sweep_counter: u16::from_be_bytes(sweep_counter),
            encoder: u16::from_be_bytes(number::<Self, 2>("azimuth", &self.azimuth)?),
            seconds: number::<Self, 4>("ntp_seconds", &self.ntp_seconds)?,
            split_seconds: number::<Self, 4>("ntp_split_seconds", &self.ntp_split_seconds)?,
            powers: Powers::Eight(&self.data),
        })
    }
}

/// Returns the bytes of a number that is an array of its bytes.
pub(super) fn number<T: Ros2Message, const N: usize>(
    field: &str,
    bytes: &[u8],
) -> Result<[u8; N], String> {
    let reason = || format!("`{field}` has {} bytes, expected {N}", bytes.len());
    bytes.try_into().map_err(|_| bad::<T>(reason()))
}
