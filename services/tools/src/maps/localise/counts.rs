//! Counts of found, lost and skipped scans.

use gyre_slam::localisation::Status;
use serde::Serialize;

/// Spans without a fix that are listed.
const LISTED: usize = 10;

/// A scan: its number, its time in ns, and whether it was found.
pub type Located = (usize, i64, Status);

#[derive(Debug, Serialize)]
pub struct Counts {
    found: usize,
    tracked: usize,
    predicted: usize,
    lost: usize,
    /// The first scan with a fix, and its time after the first scan, s.
    first_fix: Option<(usize, f64)>,
    /// The first and the last scan of each span where the localiser was lost.
    lost_scans: Vec<(usize, usize)>,
}

impl Counts {
    pub fn of(scans: &[Located]) -> Self {
        let count = |status: Status| scans.iter().filter(|it| it.2 == status).count();
        let after_s = |stamp_ns: i64| stamp_ns.saturating_sub(scans[0].1) as f64 * 1e-9;
        let first = scans.iter().find(|it| it.2 == Status::Found);
        let is_lost = |it: &Located| it.2 == Status::Lost;
        let spans = scans.chunk_by(|one, next| is_lost(one) == is_lost(next));
        let lost = spans.filter(|span| is_lost(&span[0]));
        Self {
            found: count(Status::Found),
            tracked: count(Status::Tracked),
            predicted: count(Status::Predicted),
            lost: count(Status::Lost),
            first_fix: first.map(|(number, stamp_ns, _)| (*number, after_s(*stamp_ns))),
            lost_scans: lost.map(|it| (it[0].0, it[it.len() - 1].0)).collect(),
        }
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
        let (scans, fixes) = (found + tracked + predicted + lost, found + tracked);
        let percent = 100.0 * fixes as f64 / scans.max(1) as f64;
        text += &format!("\n{fixes} of {scans} scans localised ({percent:.1} %): ");
        text += &format!("{found} found, {tracked} tracked; {predicted} predicted, {lost} lost");
        if left_out > 0 {
            text += &format!("; {left_out} more could not be used");
        }
        if !self.lost_scans.is_empty() {
            let span = |(first, last): &(usize, usize)| format!("{first} to {last}");
            let spans: Vec<String> = self.lost_scans.iter().take(LISTED).map(span).collect();
            text += &format!("\nlost: scans {}", spans.join(", "));
            let more = self.lost_scans.len().saturating_sub(LISTED);
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
        let scans = (0..).zip(statuses);
        let located = scans.map(|(k, status)| (k, k as i64 * 250_000_000, *status));
        Counts::of(&located.collect::<Vec<_>>())
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
        let none = "no scan was found in the map\n0 of 3 scans localised (0.0 %)";
        assert!(elsewhere.summary(0).starts_with(none));
    }
}
