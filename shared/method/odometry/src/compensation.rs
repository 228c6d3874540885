use std::collections::VecDeque;

use gyre_geometry::Twist;

/// Delays velocities: each scan is compensated with the velocity of the scan `lag` scans earlier.
/// With a lag of 2 or more the stages of a pipeline overlap across scans.
#[derive(Debug)]
pub(crate) struct LaggedTwists {
    lag: usize,
    /// The velocities of the last `lag` scans, oldest first; `None` where the chain starts.
    last: VecDeque<Option<Twist>>,
}

impl LaggedTwists {
    /// Creates an empty delay. With a lag of 0 there is no velocity for any scan.
    pub fn new(lag: usize) -> Self {
        Self {
            lag,
            last: VecDeque::with_capacity(lag + 1),
        }
    }

    pub fn next(&self) -> Option<Twist> {
        match self.last.len() == self.lag {
            true => self.last.front().copied().flatten(),
            false => None,
        }
    }

    pub fn push(&mut self, found: Option<Twist>) {
        self.last.push_back(found);
        if self.last.len() > self.lag {
            self.last.pop_front();
        }
    }

    pub fn clear(&mut self) {
        self.last.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twist(vx_mps: f64) -> Option<Twist> {
        Some(Twist {
            vx_mps,
            ..Twist::default()
        })
    }

    #[test]
    fn a_scan_is_compensated_with_the_velocity_of_the_scan_lag_scans_earlier() {
        let mut twists = LaggedTwists::new(2);
        let found = [None, twist(1.0), twist(2.0), twist(3.0)];
        let given = found.map(|found| {
            let next = twists.next();
            twists.push(found);
            next
        });
        assert_eq!(given, [None, None, None, twist(1.0)]);
        assert_eq!(twists.next(), twist(2.0));
        let mut none = LaggedTwists::new(0);
        none.push(twist(1.0));
        assert_eq!(none.next(), None);
    }
}
