//! The radar of the section `[source]`.

use std::time::Duration;

use gyre_live_radar::{PORT, Settings};
use gyre_radar::DatasetOptions;
use gyre_radar_replay::SourceConfig;

/// Returns the connection to the radar of the section `[source]`, with the constants of the section `[dataset]`.
pub fn settings(source: &SourceConfig, options: &DatasetOptions) -> Settings {
    Settings {
        address: match source.address.contains(':') {
            true => source.address.clone(),
            false => format!("{}:{PORT}", source.address),
        },
        silence: match Duration::try_from_secs_f64(source.silence_s) {
            Ok(silence) if !silence.is_zero() => silence,
            _ => Duration::MAX,
        },
        scans: source.scans.map(|scans| scans as u64),
        constants: options.into(),
    }
}
