//! The silence of a live radar, which a run reports while there are no poses to count.

use gyre_contract::control::Received;

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

impl Silence {
    pub fn new(radar: String, now_ns: i64) -> Self {
        Self {
            radar,
            began_ns: now_ns,
            next_ns: FIRST_NS,
            reported: None,
        }
    }

    /// Returns a sentence when the radar has been silent for twice as long, or sends again.
    pub fn update(&mut self, received: &Received, now_ns: i64) -> Option<String> {
        if received.is_receiving {
            let silent_s = seconds(now_ns - self.reported.take()?);
            self.next_ns = FIRST_NS;
            let radar = &self.radar;
            return Some(format!("{radar} sends, after {silent_s} s of silence"));
        }
        let last_scan_ns = received.last_scan.map(|scan| scan.at_ns);
        let heard_ns = last_scan_ns.unwrap_or(i64::MIN).max(self.began_ns);
        let silent_ns = now_ns - heard_ns;
        if silent_ns < self.next_ns {
            return None;
        }
        self.next_ns *= 2;
        self.reported = Some(heard_ns);
        let (radar, silent_s) = (&self.radar, seconds(silent_ns));
        Some(format!("waiting for {radar}: no scan for {silent_s} s"))
    }
}

fn seconds(ns: i64) -> i64 {
    ns / 1_000_000_000
}

#[cfg(test)]
mod tests {
    use gyre_contract::control::LastScan;

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

    /// The sentences of a radar in 40 s, a look a second, whose last scan and receipt these return.
    fn said(received: impl Fn(i64) -> Received) -> Vec<(i64, String)> {
        let mut silence = Silence::new("the radar".to_owned(), 0);
        let update = |at_s| Some((at_s, silence.update(&received(at_s), at_s * SECOND)?));
        (1..=40).filter_map(update).collect()
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
        // One that sends, or that comes within a moment, is not mentioned.
        assert!(said(|at_s| heard(Some(at_s), true)).is_empty());
        assert!(said(|at_s| heard(None, at_s > 2)).is_empty());
        // One that was never there is silent since the run began.
        assert_eq!(said(|_| heard(None, false))[0].0, 3);
    }
}
