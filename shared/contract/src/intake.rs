//! `intake`: counts of the data that a live radar has delivered, and of lost data.

use crate::{
    control::Received,
    item::Item,
    message::Header,
    refinement::NO_YES,
    wire::{Bounds, wire},
};

wire! {
    /// Counts of a live radar's data since the start of the run, with each of its scans.
    pub struct IntakeHeader = "gyre_intake_header_v1" {
        /// The item of the scan.
        pub item: Item,
        /// Azimuths that are missing from the published scans.
        pub missing_azimuths: u64,
        /// Turns without a scan.
        pub scans_left_out: u64,
        pub damaged_messages: u64,
        pub foreign_messages: u64,
        pub connections: u64,
        /// 1 while the radar is connected and sends.
        pub is_receiving: u64 [Bounds::Codes(NO_YES)],
    }
}

impl IntakeHeader {
    pub fn of(item: Item, received: &Received) -> Self {
        Self {
            item,
            missing_azimuths: received.missing_azimuths,
            scans_left_out: received.scans_left_out,
            damaged_messages: received.damaged_messages,
            foreign_messages: received.foreign_messages,
            connections: received.connections,
            is_receiving: received.is_receiving.into(),
        }
    }
}

impl Header for IntakeHeader {
    fn words(&self, _: &[u8]) -> String {
        format!(
            "{} azimuths missing, {} scans left out, {} damaged and {} foreign messages, {} connections",
            self.missing_azimuths,
            self.scans_left_out,
            self.damaged_messages,
            self.foreign_messages,
            self.connections
        )
    }
}
