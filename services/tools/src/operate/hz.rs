//! `gyre echo --hz`: measures the rate of a topic, and the delay of its messages.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use gyre_client::{Next, Received, Run, clock};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::Topic;

const PERIOD: Duration = Duration::from_secs(2);

#[derive(Default)]
struct Measured {
    /// Receive times of the messages, ns.
    received_ns: Vec<i64>,
    /// From the publication to the reception, ns; of messages of stages.
    delays_ns: Vec<i64>,
    bytes: usize,
}

/// Prints a line every two seconds, until the run ends.
pub(super) fn measure(out: &Path, topic: &'static Topic) -> Result<(), Failure> {
    let run = Run::open(out)?;
    let begun_ns = clock::now_ns();
    let mut observer = run.observe_topic(topic)?;
    let mut missed = 0;
    loop {
        let (mut measured, until) = (Measured::default(), Instant::now() + PERIOD);
        let has_ended = loop {
            let left = until.saturating_duration_since(Instant::now());
            match observer.next(left)? {
                // The publisher first sends the messages that it has kept.
                Next::Message(message, _) => measured.add(message, begun_ns),
                Next::Idle if left.is_zero() => break false,
                Next::Idle => {}
                Next::Ended => break true,
            }
        };
        let new = observer.missed() - missed;
        missed += new;
        print::line(format_args!(
            "{}: {}, {new} missed",
            topic.name,
            measured.in_words()
        ))?;
        if has_ended {
            return Ok(());
        }
    }
}

impl Measured {
    /// Adds a message, unless a stage has published it before this time.
    fn add<M>(&mut self, message: &Received<M>, begun_ns: i64) {
        let now_ns = clock::now_ns();
        let published = message.item().hops.iter().map(|hop| hop.published_ns);
        let published = published.max().filter(|ns| *ns > 0);
        if published.is_some_and(|ns| ns < begun_ns) {
            return;
        }
        let delay_ns = published.map(|ns| now_ns - ns);
        self.received_ns.push(now_ns);
        self.delays_ns.extend(delay_ns);
        self.bytes += message.header_bytes().len() + message.values::<u8>().len();
    }

    fn in_words(&self) -> String {
        let gaps = self.received_ns.windows(2).map(|pair| pair[1] - pair[0]);
        let mut gaps: Vec<i64> = gaps.collect();
        let (Some(sum), count) = (gaps.iter().copied().reduce(|a, b| a + b), gaps.len()) else {
            return format!("{} messages", self.received_ns.len());
        };
        gaps.sort_unstable();
        let ms = |ns: i64| ns as f64 * 1e-6;
        let mut words = format!(
            "{:.2} Hz, {:.1} to {:.1} ms apart, {} bytes",
            1e9 * count as f64 / sum.max(1) as f64,
            ms(gaps[0]),
            ms(gaps[count - 1]),
            self.bytes / self.received_ns.len()
        );
        let mut delays = self.delays_ns.clone();
        delays.sort_unstable();
        if let (Some(most), middle) = (delays.last(), delays.len() / 2) {
            let median = ms(delays[middle]);
            words += &format!(
                ", received after {median:.2} ms, at most {:.2} ms",
                ms(*most)
            );
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_of_the_times_between_messages() {
        let measured = Measured {
            received_ns: vec![0, 200_000_000, 500_000_000],
            delays_ns: vec![90_000, 100_000, 2_000_000],
            bytes: 3000,
        };
        let words =
            "4.00 Hz, 200.0 to 300.0 ms apart, 1000 bytes, received after 0.10 ms, at most 2.00 ms";
        assert_eq!(measured.in_words(), words);
        assert_eq!(Measured::default().in_words(), "0 messages");
    }
}
