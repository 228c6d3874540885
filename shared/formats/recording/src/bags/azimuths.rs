//! Messages as azimuths.

use gyre_colossus::Azimuth;
use gyre_ros2_messages::{
    Ros2Message, decode,
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    radar::DescribedRadar,
    sensor_msgs::Image,
};

use crate::bags::{
    Message,
    topics::{Form, Kind},
};

pub(crate) fn described(form: Form, message: &Message) -> Result<DescribedRadar, String> {
    match form {
        Form::Numbers => of::<RadarConfigurationMsg>(message)?.configuration(),
        Form::Bytes => of::<RadarConfigurationMessage>(message)?.configuration(),
    }
}

/// Calls `each` with the azimuths in a message of a scan topic and their receive times, ns.
pub(crate) fn azimuths(
    kind: Kind,
    message: &Message,
    described: &DescribedRadar,
    mut each: impl FnMut(Azimuth<'_>, i64),
) -> Result<(), String> {
    let DescribedRadar {
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
            each(azimuth.azimuth()?, received_ns);
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
    decode(&message.data)
}
