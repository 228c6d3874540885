//! Messages as azimuths.

use gyre_colossus::{Azimuth, Configuration};
use gyre_ros2_messages::{
    Ros2Message, decode,
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    sensor_msgs::Image,
};

use crate::bags::{
    Message,
    topics::{Form, Kind},
};

/// The description that a radar gives of itself, and by how many rows its driver turns images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Described {
    pub radar: Configuration,
    pub azimuth_offset: u16,
}

pub(crate) fn described(form: Form, message: &Message) -> Result<Described, String> {
    let (radar, azimuth_offset) = match form {
        Form::Numbers => {
            let message: RadarConfigurationMsg = of(message)?;
            (message.configuration(), message.azimuth_offset)
        }
        Form::Bytes => {
            let message: RadarConfigurationMessage = of(message)?;
            (message.configuration(), 0)
        }
    };
    Ok(Described {
        radar: radar.map_err(|e| e.to_string())?,
        azimuth_offset,
    })
}

/// Calls `each` with the azimuths in a message of a scan topic and their receive times, ns.
pub(crate) fn azimuths(
    kind: Kind,
    message: &Message,
    described: &Described,
    mut each: impl FnMut(Azimuth<'_>, i64),
) -> Result<(), String> {
    let Described {
        radar,
        azimuth_offset,
    } = described;
    match kind {
        Kind::Azimuths(Form::Numbers) => {
            let azimuth: RadarFftDataMsg = of(message)?;
            each(azimuth.azimuth(), azimuth.header.stamp_or(message.log_ns));
        }
        Kind::Azimuths(Form::Bytes) => {
            let azimuth: RadarFftDataMessage = of(message)?;
            let received_ns = azimuth.header.stamp_or(message.log_ns);
            each(azimuth.azimuth().map_err(|e| e.to_string())?, received_ns);
        }
        Kind::BScans => {
            // The stamp in its header is the radar's.
            let scan: RadarBScanMsg = of(message)?;
            let rows = scan.rows(radar, *azimuth_offset, message.log_ns)?;
            rows.for_each(|row| each(row.azimuth, row.arrived_ns));
        }
        Kind::Images => {
            let image: Image = of(message)?;
            let received_ns = image.header.stamp_or(message.log_ns);
            let rows = image.rows(radar, *azimuth_offset, received_ns)?;
            rows.for_each(|row| each(row.azimuth, row.arrived_ns));
        }
        Kind::Configuration(_) => {}
    }
    Ok(())
}

pub(crate) fn of<T: Ros2Message>(message: &Message) -> Result<T, String> {
    decode(&message.data).map_err(|error| error.to_string())
}
