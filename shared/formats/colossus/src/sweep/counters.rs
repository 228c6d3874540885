//! Counts of differences from the sent data.

/// Counts of losses, drops and changes since the start of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    pub sweeps: u64,
    /// Azimuths that did not arrive, of the sweeps returned.
    pub missing_azimuths: u64,
    /// Sweeps dropped because more than half of their azimuths did not arrive.
    pub incomplete_sweeps: u64,
    /// Sweeps dropped because a turn or more is missing in the middle, or the radar's clock was
    /// set. One each, however many turns are missing: turns without an azimuth are not counted
    /// here.
    pub broken_sweeps: u64,
    /// Azimuths dropped because their sweep was complete.
    pub surplus_azimuths: u64,
    /// Azimuths dropped because they have the encoder count of the azimuth before.
    pub repeated_azimuths: u64,
    /// Azimuths dropped because their encoder count is beyond a turn.
    pub invalid_azimuths: u64,
    /// Rows with more bins than configured, cut.
    pub cut_rows: u64,
}
