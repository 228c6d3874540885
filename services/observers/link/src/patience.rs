//! The time that a receiver waits for the next answer. A large message on a slow network takes as
//! long as it takes: one that is asked for again each time would never arrive.

use std::time::Duration;

/// Time after which answers have ceased: a cut can lose a request without an end.
const SHORTEST: Duration = Duration::from_secs(12);
const LONGEST: Duration = Duration::from_secs(15 * 60);
/// The first answer is empty, and takes less time; it may come behind a message that was given up.
const FIRST_ANSWER_SHARE: u32 = 4;
const LONGEST_FIRST: Duration = Duration::from_secs(30);
/// The time that a message may take, as a multiple of the time of the previous message.
const MARGIN: u32 = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Patience(Duration);

impl Default for Patience {
    fn default() -> Self {
        Self(SHORTEST)
    }
}

impl Patience {
    /// Returns the longest time without an answer, before the first one and between two.
    pub fn limit(self, was_answered: bool) -> Duration {
        match was_answered {
            true => self.0,
            false => (self.0 / FIRST_ANSWER_SHARE).min(LONGEST_FIRST),
        }
    }

    pub fn received(&mut self, after: Duration) {
        self.0 = (after * MARGIN).clamp(SHORTEST, LONGEST);
    }

    /// Notes that no message has come in time: the next message has twice the time.
    pub fn lost(&mut self) {
        self.0 = (self.0 * 2).min(LONGEST);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_of_a_minute_arrives_and_the_next_one_is_waited_for() {
        let minute = Duration::from_secs(60);
        let mut patience = Patience::default();
        let mut requests = 1;
        while patience.limit(true) < minute {
            patience.lost();
            requests += 1;
        }
        assert_eq!(requests, 4);
        patience.received(minute);
        assert_eq!(patience.limit(true), 2 * minute);
        assert_eq!(patience.limit(false), minute / 2);
        patience.received(Duration::from_millis(20));
        assert_eq!(patience, Patience::default());
        (0..40).for_each(|_| patience.lost());
        assert_eq!(patience.limit(true), LONGEST);
        assert_eq!(patience.limit(false), LONGEST_FIRST);
    }
}
