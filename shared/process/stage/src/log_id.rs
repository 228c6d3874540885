//! The logs of a run, and the events of their growth.

gyre_messages::named! {
    /// A log of a run that followers read; its name is the event of its growth.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum LogId {
        Keyframes = "keyframes_grown",
        Loops = "loops_grown",
        /// All scans with their points, by pose-integration.
        Scans = "scans_grown",
    }
}
