//! The radar of the section `[source]`.

use std::time::Duration;

use gyre_colossus::{Address, BadAddress};
use gyre_live_radar::Settings;
use gyre_radar::DatasetOptions;
use gyre_run::SourceConfig;

/// Encoder counts per turn of a radar that does not tell them, unless `dataset.encoder_counts` says
/// otherwise.
const ENCODER_COUNTS: u16 = 5600;

/// Returns the connection to the radar of the section `[source]`, with the constants of the section
/// `[dataset]`.
///
/// # Errors
/// The address is none.
pub fn settings(source: &SourceConfig, options: &DatasetOptions) -> Result<Settings, BadAddress> {
    Ok(Settings {
        address: Address::parse(&source.address, &source.interface)?,
        encoder_counts: encoder_counts(options),
        silence: silence(source),
        scans: source.scans.map(|scans| scans as u64),
        constants: options.into(),
    })
}

/// Returns the encoder counts per turn of a radar that does not tell them.
pub fn encoder_counts(options: &DatasetOptions) -> u16 {
    options.encoder_counts.unwrap_or(ENCODER_COUNTS)
}

/// Returns the time without a byte or a message after which something is done about it.
pub fn silence(source: &SourceConfig) -> Duration {
    match Duration::try_from_secs_f64(source.silence_s) {
        Ok(silence) if !silence.is_zero() => silence,
        _ => Duration::MAX,
    }
}
