//! `gnss`: the fixes of a live GNSS receiver.

use gyre_geometry::samples::Sample;

use crate::{
    item::Item,
    message::Header,
    refinement::NO_YES,
    wire::{Bounds, wire},
};

wire! {
    /// A message of a live GNSS receiver, or the number of those that are missing.
    pub struct GnssHeader = "gyre_gnss_header_v1" {
        /// `seq` counts the messages of the run, from 0, and `stamp_ns` is the receiver's time.
        pub item: Item,
        /// 1 if the receiver had a fix, which may be on no place of the earth, or not a number.
        pub has_fix: u64 [Bounds::Codes(NO_YES)],
        pub latitude_deg: f64,
        pub longitude_deg: f64,
        /// Altitude above the ellipsoid; 0 if the receiver does not state it.
        pub altitude_m: f64,
        /// Standard deviation along east and along north; 0 if the receiver does not state it.
        pub sigma_m: f64,
        /// Messages of the receiver that cannot be read. If they or lost ones are counted, there is
        /// no fix, and the receiver did not state that.
        pub unreadable: u64,
        /// Messages of the receiver that came faster than they are read.
        pub lost: u64,
    }
}

impl GnssHeader {
    /// A fix, or none at this time, ns since 1970.
    pub fn of(stamp_ns: i64, fix: Option<Sample>) -> Self {
        let values = fix.map_or([0.0; 6], |fix| fix.values);
        let [latitude_deg, longitude_deg, altitude_m, sigma_m, ..] = values;
        Self {
            item: Item::recorded(0, 0, stamp_ns),
            has_fix: fix.is_some().into(),
            latitude_deg,
            longitude_deg,
            altitude_m,
            sigma_m,
            ..Self::default()
        }
    }

    pub fn counts(unreadable: u64, lost: u64) -> Self {
        Self {
            unreadable,
            lost,
            ..Self::default()
        }
    }

    pub fn fix(&self) -> Option<Sample> {
        let at = [self.latitude_deg, self.longitude_deg];
        let fix = Sample::fix(self.item.stamp_ns, at, self.altitude_m, self.sigma_m);
        (self.has_fix == 1).then_some(fix)
    }
}

impl Header for GnssHeader {
    fn words(&self, _: &[u8]) -> String {
        match (self.has_fix, self.unreadable, self.lost) {
            (1, ..) => format!("{:.7}, {:.7}", self.latitude_deg, self.longitude_deg),
            (_, 0, 0) => "without a fix".to_owned(),
            (_, unreadable, lost) => format!("{unreadable} unreadable, {lost} lost"),
        }
    }
}
