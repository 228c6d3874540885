//! The time while two or more stages work at once.

use std::{cmp::Reverse, collections::BinaryHeap};

use gyre_messages::{Hop, Hops};

/// Starts (+1) and ends (-1) of work in the order of time. Work earlier than the first work on the
/// newest scan is final, so only the scans in flight are kept.
#[derive(Debug, Default)]
pub struct Overlap {
    edges: BinaryHeap<Reverse<(i64, i32)>>,
    busy: i32,
    since_ns: i64,
    together_ns: i64,
}

impl Overlap {
    pub fn add(&mut self, hops: &Hops) {
        let worked = |hop: &&Hop| **hop != Hop::default();
        for hop in hops.iter().filter(worked) {
            self.edges.push(Reverse((hop.started_ns, 1)));
            self.edges.push(Reverse((hop.finished_ns, -1)));
        }
        self.sweep(hops[0].started_ns);
    }

    /// Returns the time while two or more stages worked at once, ns.
    pub fn together_ns(mut self) -> i64 {
        self.sweep(i64::MAX);
        self.together_ns
    }

    fn sweep(&mut self, until_ns: i64) {
        while let Some(Reverse((at_ns, change))) = self.edges.peek().copied() {
            if at_ns >= until_ns {
                break;
            }
            self.edges.pop();
            if self.busy >= 2 {
                self.together_ns += at_ns - self.since_ns;
            }
            self.busy += change;
            self.since_ns = at_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_scans_in_flight_are_kept() {
        let mut overlap = Overlap::default();
        for scan in 0..1000 {
            let hop = |k: i64| Hop {
                started_ns: scan * 10 + k * 10,
                finished_ns: scan * 10 + k * 10 + 8,
                ..Hop::default()
            };
            overlap.add(&std::array::from_fn(|k| hop(k as i64 + 1)));
            assert!(overlap.edges.len() <= 2 * 7 * 8, "{}", overlap.edges.len());
        }
        // Seven stages work at once for 8 of 10 ns; alone are the first and the last scan's ends.
        assert_eq!(overlap.together_ns(), 8 * (1000 + 6 - 2));
    }
}
