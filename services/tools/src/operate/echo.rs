//! `gyre echo`: prints the messages of a running run.

use std::{
    io::{self, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    time::Duration,
};

use clap::Args;
use gyre_client::{AnyMessage, Next, Received, Run};
use gyre_configuration::terminal::Failure;
use gyre_contract::{Message, Pose, Topic};

use crate::operate::{RunChoice, hz};

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
        true => hz::measure(&run, topic),
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
                    false => print(&mut lines, topic, message, missed)?,
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

fn print(
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
