//! The count of the radar's turns without a scan.

use gyre_contract::control::LastScan;

/// The limit of the pace of the radar's clock: recordings may be played so fast.
const MAX_PACE: f64 = 4.0;
/// Tolerated lead of the count in turns beyond that: scans that were read late.
const SLACK_TURNS: f64 = 16.0;
/// The clock was set back where it has advanced by less than this since the last scan, turns.
const MIN_TURNS: f64 = 0.25;
/// The weight of one more turn in the mean duration of a turn.
const WEIGHT: f64 = 1.0 / 16.0;

/// Counts the turns between scans by time, also across connections and restarts.
///
/// The turn of the first azimuth is not counted if it had begun before that azimuth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TurnCounter {
    /// Duration of a turn: as configured, then as measured. 0: not known.
    turn_ns: f64,
    configured_ns: i64,
    last: Option<LastScan>,
    /// The times of the newest azimuth, and its part of the turn, from 0 to 1.
    newest: Option<(LastScan, f64)>,
    left_out: u64,
}

impl TurnCounter {
    pub fn resume(last: Option<LastScan>, left_out: u64) -> Self {
        Self {
            last,
            left_out,
            ..Self::default()
        }
    }

    pub fn configure(&mut self, period_ns: i64) {
        if self.configured_ns != period_ns {
            self.configured_ns = period_ns;
            self.turn_ns = period_ns.max(1) as f64;
        }
    }

    /// Notes an azimuth by its times and its part of the turn. The first of all may be in a turn
    /// that began before.
    pub fn note(&mut self, at: LastScan, fraction: f64, is_start: bool) {
        self.newest = Some((at, fraction));
        if self.last.is_none() {
            let turns = 0.5 - fraction - if is_start { 1.0 } else { 0.0 };
            let ns = (turns * self.turn_ns) as i64;
            self.last = Some(LastScan {
                stamp_ns: at.stamp_ns.saturating_add(ns),
                at_ns: at.at_ns.saturating_add(ns),
            });
        }
    }

    pub fn add(&mut self, scan: LastScan) {
        if let Some(last) = self.last {
            let turns = self.since(last, scan).round().max(1.0) as u64;
            self.left_out += turns - 1;
            let measured_ns = scan.stamp_ns.saturating_sub(last.stamp_ns) as f64;
            if turns == 1 && (measured_ns / self.turn_ns - 1.0).abs() < MIN_TURNS {
                self.turn_ns += WEIGHT * (measured_ns - self.turn_ns);
            }
        }
        self.last = Some(scan);
    }

    pub fn last(&self) -> Option<LastScan> {
        self.last
    }

    /// Returns the turns without a scan; the newest does not count if it `is_open`.
    pub fn left_out(&self, is_open: bool) -> u64 {
        let (Some(last), Some((here, fraction))) = (self.last, self.newest) else {
            return self.left_out;
        };
        // Scans have the time of their middle.
        let turns = (self.since(last, here) - fraction + 0.5).round();
        let turns = if turns > 0.0 { turns as u64 } else { 0 };
        self.left_out + turns.saturating_sub(is_open.into())
    }

    /// Returns the turns between two scans, by the host's clock where the radar's was set.
    fn since(&self, last: LastScan, here: LastScan) -> f64 {
        let turn_ns = self.turn_ns.max(1.0);
        let turns = |from: i64, to: i64| to.saturating_sub(from) as f64 / turn_ns;
        let by_radar = turns(last.stamp_ns, here.stamp_ns);
        let by_host = turns(last.at_ns, here.at_ns).max(0.0);
        let was_set_back = by_radar < MIN_TURNS && by_host > by_radar + 1.0;
        let was_set_ahead = by_radar > MAX_PACE * by_host + SLACK_TURNS;
        match was_set_back || was_set_ahead {
            true => by_host,
            false => by_radar,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN_NS: i64 = 250_000_000;

    /// A time in a turn, by a radar whose clock is ahead by `set_ns`.
    fn at(turn: i64, fraction: f64, set_ns: i64) -> LastScan {
        let at_ns = turn * TURN_NS + (fraction * TURN_NS as f64) as i64;
        LastScan {
            stamp_ns: at_ns + set_ns,
            at_ns,
        }
    }

    fn scan(turn: i64) -> LastScan {
        at(turn, 0.5, 0)
    }

    fn note(turns: &mut TurnCounter, turn: i64, fraction: f64) {
        turns.note(at(turn, fraction, 0), fraction, fraction == 0.0);
    }

    fn turns() -> TurnCounter {
        let mut turns = TurnCounter::resume(None, 0);
        turns.configure(TURN_NS);
        turns
    }

    #[test]
    fn turns_without_a_scan_are_counted_whatever_their_number() {
        let mut turns = turns();
        note(&mut turns, 0, 0.0);
        for (turn, left_out) in [(0, 0), (1, 0), (2, 0), (4, 1), (18, 14), (19, 14)] {
            note(&mut turns, turn, 0.999);
            turns.add(scan(turn));
            assert_eq!(turns.left_out(false), left_out, "turn {turn}");
        }
    }

    #[test]
    fn the_turn_in_which_a_stream_begins_counts_if_it_is_whole() {
        for (fraction, left_out) in [(0.0, 1), (0.7, 0)] {
            let mut turns = turns();
            note(&mut turns, 0, fraction);
            turns.add(scan(1));
            assert_eq!(turns.left_out(true), left_out);
        }
    }

    #[test]
    fn the_turn_of_the_newest_azimuth_is_left_out_once_it_cannot_be_completed() {
        let mut turns = turns();
        note(&mut turns, 0, 0.0);
        turns.add(scan(0));
        for fraction in [0.0, 0.5, 0.999] {
            note(&mut turns, 1, fraction);
            assert_eq!((turns.left_out(true), turns.left_out(false)), (0, 1));
        }
        note(&mut turns, 4, 0.3);
        assert_eq!((turns.left_out(true), turns.left_out(false)), (3, 4));
        turns.add(scan(4));
        assert_eq!(turns.left_out(false), 3);
    }

    #[test]
    fn a_source_goes_on_with_the_count_of_the_one_before() {
        let mut turns = TurnCounter::resume(Some(scan(7)), 3);
        turns.configure(TURN_NS);
        note(&mut turns, 9, 0.6);
        assert_eq!(turns.left_out(false), 5);
        turns.add(scan(10));
        assert_eq!(turns.left_out(false), 5);
    }

    #[test]
    fn a_clock_that_is_set_loses_no_turn() {
        for set_ns in [-3_600_000_000_000, -700_000_000, 3_600_000_000_000] {
            let mut turns = turns();
            note(&mut turns, 0, 0.0);
            for (turn, set_ns) in [(0, 0), (1, set_ns), (2, set_ns)] {
                turns.note(at(turn, 0.999, set_ns), 0.999, false);
                turns.add(at(turn, 0.5, set_ns));
            }
            assert_eq!(turns.left_out(false), 0, "{set_ns}");
        }
    }

    #[test]
    fn turns_are_counted_as_long_as_they_are() {
        let mut turns = turns();
        // 2 % faster than the radar reports: 400 of its turns are 392 reported turns.
        let scan = |turn: i64| LastScan {
            stamp_ns: turn * TURN_NS / 100 * 98,
            at_ns: turn * TURN_NS / 100 * 98,
        };
        (0..100).for_each(|turn| turns.add(scan(turn)));
        turns.add(scan(500));
        assert_eq!(turns.left_out(false), 400);
    }
}
