//! `gyre echo`: prints the messages of a running run, or their rate and their delay.

use std::{
    io::{self, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Args;
use gyre_client::{AnyMessage, Next, Received, Run, clock};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{Message, Pose, Topic};

use crate::operate::choice::RunChoice;

#[derive(Debug, Args)]
pub struct EchoArguments {
    /// The run and the topic, in any order. Default: the only run there is, and pose.
    #[arg(value_name = "RUN|TOPIC", num_args = 0..=2)]
    pub words: Vec<PathBuf>,

    /// Print each message as a line of JSON, with all of its fields but its payload.
    #[arg(long)]
    pub json: bool,

    /// Print the rate of the topic and the delay of its messages, every two seconds.
    #[arg(long, conflicts_with = "json")]
    pub hz: bool,
}

/// Prints a line for each message of a topic, and how many were missed, until the run ends.
pub fn echo(arguments: &EchoArguments) -> Result<(), Failure> {
    let words = &arguments.words;
    let topic = |word: &PathBuf| {
        let name = word.to_str().filter(|_| !word.is_dir())?;
        gyre_contract::topic(name)
    };
    let topics: Vec<_> = words.iter().filter_map(topic).collect();
    let runs: Vec<&PathBuf> = words.iter().filter(|word| topic(word).is_none()).collect();
    let topic = match (&topics[..], &runs[..]) {
        ([topic], [] | [_]) => *topic,
        ([], [] | [_]) => Pose::ENTRY,
        _ => {
            let names = gyre_contract::all().map(|topic| topic.name);
            let names = names.collect::<Vec<_>>().join(", ");
            let usage = "name a run, the folder of its results, and a topic";
            return Err(format!("{usage}: {names}").into());
        }
    };
    let run = runs.first().copied().cloned();
    let run = RunChoice { run }.folder()?;
    let printed = match arguments.hz {
        true => measure(&run, topic),
        false => observe(&run, topic, arguments.json),
    };
    match printed.map_err(|error| error.downcast::<io::Error>()) {
        Ok(()) => Ok(()),
        // Nobody reads it any more, as after `gyre echo OUT | head`.
        Err(Ok(error)) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(Ok(error)) => Err(format!("cannot print: {error}").into()),
        Err(Err(error)) => Err(error),
    }
}

fn observe(out: &Path, topic: &'static Topic, json: bool) -> Result<(), Failure> {
    let run = Run::open(out)?;
    let mut observer = run.observe_topic(topic)?;
    let mut lines = BufWriter::new(io::stdout().lock());
    let mut received = 0_u64;
    loop {
        let next = match observer.next(Duration::ZERO)? {
            Next::Idle => {
                // Written together: one that reads them is not woken for each.
                lines.flush()?;
                observer.next(Duration::MAX)?
            }
            next => next,
        };
        match next {
            Next::Message(message, missed) => {
                received += 1;
                match json {
                    true => print_json(&mut lines, topic, message, missed)?,
                    false => print_words(&mut lines, topic, message, missed)?,
                }
            }
            Next::Idle => {}
            Next::Ended => break,
        }
    }
    let missed = observer.missed();
    if !json {
        let name = topic.name;
        writeln!(lines, "{name}: {received} received, {missed} missed")?;
    }
    Ok(lines.flush()?)
}

fn print_words(
    lines: &mut impl Write,
    topic: &Topic,
    message: &Received<AnyMessage>,
    missed: u64,
) -> io::Result<()> {
    let (seq, scan) = (message.item().seq, message.item().scan);
    if missed > 0 {
        writeln!(lines, "{missed} missed")?;
    }
    let words = (topic.words)(message.header_bytes(), message.values());
    writeln!(lines, "{seq}: scan {scan}, {words}")
}

fn print_json(
    lines: &mut impl Write,
    topic: &Topic,
    message: &Received<AnyMessage>,
    missed: u64,
) -> io::Result<()> {
    write!(lines, "{{\"topic\":\"{}\",\"missed\":{missed}", topic.name)?;
    for (name, value) in topic.structure.values(message.header_bytes()).fields() {
        write!(lines, ",\"{name}\":")?;
        serde_json::to_writer(&mut *lines, &value)?;
    }
    writeln!(lines, "}}")
}

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
fn measure(out: &Path, topic: &'static Topic) -> Result<(), Failure> {
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
