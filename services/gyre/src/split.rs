//! The link of a run that is split between two machines.

use gyre_configuration::{Configuration, terminal::Failure};
use gyre_contract::run::LinkConfig;

/// Checks that the other side of a split run can be reached as it is configured.
pub fn check(configuration: &Configuration) -> Result<(), Failure> {
    if configuration.link.side.is_none() {
        return Ok(());
    }
    #[cfg(not(feature = "link"))]
    return Err(crate::features::absent(crate::features::LINK).into());
    #[cfg(feature = "link")]
    gyre_link::check(&configuration.link).map_err(|error| format!("[link]: {error}").into())
}

/// Returns the size of the largest scan, bytes, if scans are sent: the robot knows it.
pub fn scan_bytes(link: &LinkConfig) -> Result<usize, Failure> {
    match link.cut {
        #[cfg(feature = "link")]
        gyre_contract::run::PlayedFrom::Scan => {
            let name = &link.name;
            gyre_configuration::terminal::print::note(format_args!(
                "link {name}: waiting for the robot, which knows how large its scans are"
            ));
            Ok(gyre_link::ask_robot(link)?)
        }
        _ => Ok(0),
    }
}
