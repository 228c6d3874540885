//! The radar of the section `[source]`.

use std::time::Duration;

use gyre_live_radar::{Address, BadAddress, Settings};
use gyre_radar::DatasetOptions;
use gyre_radar_replay::SourceConfig;

/// Encoder counts per turn of a radar that sends by UDP, unless `dataset.encoder_counts` says otherwise.
const ENCODER_COUNTS: u16 = 5600;

/// Returns the connection to the radar of the section `[source]`, with the constants of the section `[dataset]`.
///
/// # Errors
/// The address is none.
pub fn settings(source: &SourceConfig, options: &DatasetOptions) -> Result<Settings, BadAddress> {
    Ok(Settings {
        address: Address::parse(&source.address, &source.interface)?,
        encoder_counts: options.encoder_counts.unwrap_or(ENCODER_COUNTS),
        silence: match Duration::try_from_secs_f64(source.silence_s) {
            Ok(silence) if !silence.is_zero() => silence,
            _ => Duration::MAX,
        },
        scans: source.scans.map(|scans| scans as u64),
        constants: options.into(),
    })
}
