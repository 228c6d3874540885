//! The silence of a live radar, which a run reports while there are no poses to count.

use gyre_stage::source::Received;

/// The silence that is reported first, ns. The next lines come when it has doubled.
const FIRST_NS: i64 = 3_000_000_000;

pub struct Silence {
    /// As "the radar at 192.168.0.1:6317".
    radar: String,
    /// When the run began, `CLOCK_MONOTONIC`, ns.
    began_ns: i64,
    /// The silence after which the next line is due, ns.
    next_ns: i64,
    /// When the last scan arrived before a silence that was reported, `CLOCK_MONOTONIC`, ns.
    reported: Option<i64>,
}

#[derive(Debug, PartialEq, Eq)]
pub struct Report {
    pub sentence: String,
    /// False if it only continues the sentence before, with another time.
    pub is_new: bool,
}

impl Silence {
    pub fn new(radar: String, now_ns: i64) -> Self {
        Self {
            radar,
            began_ns: now_ns,
            next_ns: FIRST_NS,
            reported: None,
        }
    }

    pub fn update(&mut self, received: &Received, now_ns: i64) -> Option<Report> {
        let last_scan_ns = received.last_scan.map(|scan| scan.at_ns);
        let heard_ns = last_scan_ns.unwrap_or(i64::MIN).max(self.began_ns);
        if received.is_receiving {
            let silent_s = seconds(now_ns - self.reported.take()?);
            self.next_ns = FIRST_NS;
            return Some(Report {
                sentence: format!("{} sends, after {silent_s} s of silence", self.radar),
                is_new: true,
            });
        }
        let silent_ns = now_ns - heard_ns;
        let is_new = silent_ns >= self.next_ns;
        if is_new {
            self.next_ns *= 2;
            self.reported = Some(heard_ns);
        }
        self.reported?;
        let silent_s = seconds(silent_ns);
        Some(Report {
            sentence: format!("waiting for {}: no scan for {silent_s} s", self.radar),
            is_new,
        })
    }
}

fn seconds(ns: i64) -> i64 {
    ns / 1_000_000_000
}

#[cfg(test)]
mod tests {
    use gyre_stage::source::LastScan;

    use super::*;

    const SECOND: i64 = 1_000_000_000;

    fn heard(at_s: Option<i64>, is_receiving: bool) -> Received {
        let last_scan = at_s.map(|at_s| LastScan {
            stamp_ns: 0,
            at_ns: at_s * SECOND,
        });
        Received {
            last_scan,
            is_receiving,
            ..Received::default()
        }
    }

    /// The reports of one second each, starting at 1 s, for the azimuths received by then.
    fn reports(received: impl Fn(i64) -> Received, until_s: i64) -> Vec<(i64, Report)> {
        let mut silence = Silence::new("the radar".to_owned(), 0);
        (1..=until_s)
            .filter_map(|at_s| {
                let report = silence.update(&received(at_s), at_s * SECOND)?;
                Some((at_s, report))
            })
            .collect()
    }

    /// The new sentences of a radar whose last scan and whose receipt these return.
    fn said(received: impl Fn(i64) -> Received) -> Vec<(i64, String)> {
        let new = reports(received, 40)
            .into_iter()
            .filter(|(_, it)| it.is_new);
        new.map(|(at_s, report)| (at_s, report.sentence)).collect()
    }

    #[test]
    fn one_that_is_silent_is_waited_for_until_it_sends_again() {
        // The last scan came at 10 s, the next azimuth 20 s later.
        let received = |at_s: i64| heard(Some(at_s.min(10)), !(12..30).contains(&at_s));
        let expected = [
            (13, "waiting for the radar: no scan for 3 s"),
            (16, "waiting for the radar: no scan for 6 s"),
            (22, "waiting for the radar: no scan for 12 s"),
            (30, "the radar sends, after 20 s of silence"),
        ];
        assert_eq!(
            said(received),
            expected.map(|(at_s, it)| (at_s, it.to_owned()))
        );
        // A bar counts on in between.
        assert_eq!(reports(received, 40).len(), 18);
        // One that sends, or that comes within a moment, is not mentioned.
        assert!(said(|at_s| heard(Some(at_s), true)).is_empty());
        assert!(said(|at_s| heard(None, at_s > 2)).is_empty());
        // One that was never there is silent since the run began.
        assert_eq!(said(|_| heard(None, false))[0].0, 3);
    }
}
