//! Counts of found, lost and skipped scans.

use gyre_slam::localisation::Status;
use serde::Serialize;

/// Spans without a fix that are listed.
const LISTED: usize = 10;

#[derive(Debug, Default, Serialize)]
pub struct Counts {
    found: usize,
    tracked: usize,
    predicted: usize,
    lost: usize,
    #[serde(skip)]
    first_ns: Option<i64>,
    /// The first scan with a fix, and its time after the first scan, s.
    first_fix: Option<(usize, f64)>,
    /// The first and the last scan of each span where the localiser was lost.
    #[serde(rename = "lost_scans")]
    spans: Vec<(usize, usize)>,
    #[serde(skip)]
    was_lost: bool,
}

impl Counts {
    pub fn add(&mut self, number: usize, stamp_ns: i64, status: Status) {
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        match status {
            Status::Found => self.found += 1,
            Status::Tracked => self.tracked += 1,
            Status::Predicted => self.predicted += 1,
            Status::Lost => self.lost += 1,
        }
        if status == Status::Found {
            let after_s = stamp_ns.saturating_sub(first_ns) as f64 * 1e-9;
            self.first_fix.get_or_insert((number, after_s));
        }
        let is_lost = status == Status::Lost;
        match self.spans.last_mut() {
            Some((_, last)) if is_lost && self.was_lost => *last = number,
            _ if is_lost => self.spans.push((number, number)),
            _ => (),
        }
        self.was_lost = is_lost;
    }

    pub fn scans(&self) -> usize {
        self.found + self.tracked + self.predicted + self.lost
    }

    pub fn has_fix(&self) -> bool {
        self.first_fix.is_some()
    }

    pub fn summary(&self, left_out: usize) -> String {
        let mut text = match self.first_fix {
            Some((scan, after_s)) => format!("first fix: scan {scan}, after {after_s:.1} s"),
            None => "no scan was found in the map".to_owned(),
        };
        let Self {
            found,
            tracked,
            predicted,
            lost,
            ..
        } = self;
        let (scans, fixes) = (self.scans(), found + tracked);
        let percent = 100.0 * fixes as f64 / scans.max(1) as f64;
        text += &format!("\n{fixes} of {scans} scans localised ({percent:.1} %): ");
        text += &format!("{found} found, {tracked} tracked; {predicted} predicted, {lost} lost");
        if left_out > 0 {
            text += &format!("; {left_out} more could not be used");
        }
        if !self.spans.is_empty() {
            let span = |(first, last): &(usize, usize)| format!("{first} to {last}");
            let spans: Vec<String> = self.spans.iter().take(LISTED).map(span).collect();
            text += &format!("\nlost: scans {}", spans.join(", "));
            let more = self.spans.len().saturating_sub(LISTED);
            if more > 0 {
                text += &format!(" and {more} more times");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(statuses: &[Status]) -> Counts {
        let mut counts = Counts::default();
        for (number, status) in statuses.iter().enumerate() {
            counts.add(number, number as i64 * 250_000_000, *status);
        }
        counts
    }

    #[test]
    fn the_summary_says_when_the_first_fix_was_and_where_the_drive_was_lost() {
        use Status::{Found, Lost, Predicted, Tracked};
        let drive = [Lost, Lost, Found, Tracked, Predicted, Lost, Found, Tracked];
        let expected = "first fix: scan 2, after 0.5 s\n\
            4 of 8 scans localised (50.0 %): 2 found, 2 tracked; 1 predicted, 3 lost; 1 more could not be used\n\
            lost: scans 0 to 1, 5 to 5";
        assert_eq!(counts(&drive).summary(1), expected);
        let elsewhere = counts(&[Lost; 3]);
        assert!(!elsewhere.has_fix());
        let none = "no scan was found in the map\n0 of 3 scans localised (0.0 %)";
        assert!(elsewhere.summary(0).starts_with(none));
    }
}
