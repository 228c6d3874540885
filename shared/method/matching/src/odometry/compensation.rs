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
