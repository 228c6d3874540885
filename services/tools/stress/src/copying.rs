//! The transport beside copies: the same messages from one process to 1, 4 and 8 others, once through shared memory as stages do it, and
//! once through Unix stream sockets, where each reader gets the bytes.
//!
//! Both sides are alike in all else: one process for the sender and one for each reader; the sender writes the message anew, then sends it;
//! a reader sleeps in `ppoll`, and has a message when it has read a byte of each of its cache lines.

mod reader;
mod send;
mod sender;
mod socket;

use std::{fs, path::PathBuf};

use gyre_latency::Durations;
use serde::{Deserialize, Serialize};

use crate::{
    StressError,
    helper::Helper,
    record::Distribution,
    subject::{Kind, Subject},
};

/// Messages a second. An observer rests for 10 ms between two looks, which must not show.
const RATE_HZ: f64 = 50.0;
/// Messages before those that are measured.
const WARM_UP: u64 = 10;
/// Messages that are measured in a row, whatever the duration: ten of them are beyond the 99th percentile.
const LEAST: f64 = 1000.0;
/// The same for the 99.9th percentile: more say nothing new.
const MOST: f64 = 10_000.0;
/// The duration of a scenario that [`LEAST`] messages are for, s.
const LEAST_S: f64 = 60.0;
const READERS: [usize; 3] = [1, 4, 8];

/// How messages reach their readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// Through shared memory, without copying.
    SharedMemory,
    /// Through Unix stream sockets, by copying.
    Sockets,
}

impl Way {
    const ALL: [Self; 2] = [Self::SharedMemory, Self::Sockets];

    /// Returns its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SharedMemory => "shared memory",
            Self::Sockets => "sockets",
        }
    }

    const fn word(self) -> &'static str {
        match self {
            Self::SharedMemory => "shared-memory",
            Self::Sockets => "sockets",
        }
    }
}

/// What the hand-over of one kind of message to so many readers costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The topic whose messages are so large.
    pub topic: &'static str,
    /// Bytes of a message.
    pub bytes: usize,
    /// How messages reach their readers.
    pub way: Way,
    /// Number of readers.
    pub readers: usize,
    /// From the start of the sending until the last reader has the message.
    pub to_last_reader: Distribution,
    /// Processor time of the sender for a message, without the time to write it, us.
    pub sender_us: f64,
    /// Processor time of a reader for a message, in the mean, us.
    pub reader_us: f64,
    /// Own memory of all processes, MB.
    pub own_mb: f64,
    /// Shared memory, MB.
    pub shared_mb: f64,
    /// Messages that a reader has not had.
    pub missed: u64,
}

/// One hand-over, as its processes know it.
#[derive(Clone, Debug, PartialEq)]
struct Plan {
    way: Way,
    /// The folder that names the topic, or the socket.
    place: PathBuf,
    bytes: usize,
    messages: u64,
    readers: usize,
}

/// What the sender says at its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Sent {
    /// Processor time of the measured sends, ns.
    cpu_ns: u64,
    own_bytes: u64,
    shared_bytes: u64,
}

/// What a reader says at its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Had {
    /// For each measured message its number, and the time from its sending until this reader had it, ns.
    after_ns: Vec<(u64, i64)>,
    /// Processor time for the measured messages, ns.
    cpu_ns: u64,
    own_bytes: u64,
}

/// Measures all kinds, ways and numbers of readers. `note` says what is done.
///
/// # Errors
/// A process that cannot be started or fails.
pub fn compare(
    subject: &Subject,
    duration_s: f64,
    note: &mut dyn FnMut(&str),
) -> Result<Vec<Row>, StressError> {
    let messages = (duration_s / LEAST_S * LEAST).clamp(LEAST, MOST) as u64;
    let mut rows = Vec::new();
    for kind in &subject.kinds {
        for readers in READERS {
            for way in Way::ALL {
                let (topic, way_name) = (kind.topic, way.name());
                note(&format!("copying: {topic} to {readers} through {way_name}"));
                let place = subject.out.join("runs/copying");
                let plan = Plan {
                    way,
                    place,
                    bytes: kind.bytes,
                    messages,
                    readers,
                };
                rows.push(measure(subject, kind, &plan)?);
            }
        }
    }
    Ok(rows)
}

fn measure(subject: &Subject, kind: &Kind, plan: &Plan) -> Result<Row, StressError> {
    let _ = fs::remove_dir_all(&plan.place);
    fs::create_dir_all(&plan.place).map_err(StressError::file(&plan.place))?;
    let start = |role: &str| Helper::start(&subject.program, &plan.words(role));
    let mut sender = start("send")?;
    let readers: Result<Vec<_>, _> = (0..plan.readers).map(|_| start("read")).collect();
    let mut readers = readers?;
    sender.tell("go")?;
    let had: Result<Vec<Had>, _> = readers.iter_mut().map(Helper::hear_result).collect();
    let sent: Sent = sender.hear_result()?;
    sender.end();
    Ok(row(kind, plan, &sent, &had?))
}

fn row(kind: &Kind, plan: &Plan, sent: &Sent, had: &[Had]) -> Row {
    let mut last = vec![(0_usize, 0_i64); plan.messages as usize];
    for (number, after_ns) in had.iter().flat_map(|had| &had.after_ns) {
        if let Some((readers, last_ns)) = last.get_mut(*number as usize) {
            *readers += 1;
            *last_ns = (*last_ns).max(*after_ns);
        }
    }
    let mut durations = Durations::default();
    let complete = last.iter().filter(|(readers, _)| *readers == had.len());
    complete.for_each(|(_, last_ns)| durations.add(*last_ns));
    let per_message = |ns: u64| ns as f64 * 1e-3 / plan.messages.max(1) as f64;
    let own_bytes = sent.own_bytes + had.iter().map(|had| had.own_bytes).sum::<u64>();
    let received: u64 = had.iter().map(|had| had.after_ns.len() as u64).sum();
    Row {
        topic: kind.topic,
        bytes: kind.bytes,
        way: plan.way,
        readers: plan.readers,
        to_last_reader: Distribution::of(&durations),
        sender_us: per_message(sent.cpu_ns),
        reader_us: per_message(had.iter().map(|had| had.cpu_ns).sum()) / had.len().max(1) as f64,
        own_mb: own_bytes as f64 * 1e-6,
        shared_mb: sent.shared_bytes as f64 * 1e-6,
        missed: (plan.messages * had.len() as u64).saturating_sub(received),
    }
}

impl Plan {
    fn words(&self, role: &str) -> Vec<String> {
        let numbers = [self.bytes as u64, self.messages, self.readers as u64];
        let place = self.place.display().to_string();
        let words = ["hand-over".to_owned(), role.to_owned()];
        let rest = [self.way.word().to_owned(), place];
        let numbers = numbers.map(|number| number.to_string());
        words.into_iter().chain(rest).chain(numbers).collect()
    }

    fn parse(words: &[String]) -> Option<Self> {
        let [way, place, bytes, messages, readers] = words else {
            return None;
        };
        Some(Self {
            way: Way::ALL.into_iter().find(|known| known.word() == way)?,
            place: PathBuf::from(place),
            bytes: bytes.parse().ok()?,
            messages: messages.parse().ok()?,
            readers: readers.parse().ok()?,
        })
    }

    fn socket(&self) -> PathBuf {
        self.place.join("socket")
    }
}

/// Does the part of the sender or of a reader.
pub(crate) fn helper(words: &[String]) -> Result<(), StressError> {
    let usage = || StressError::Usage("this is what `gyre stress` starts".to_owned());
    let (role, words) = words.split_first().ok_or_else(usage)?;
    let plan = Plan::parse(words).ok_or_else(usage)?;
    match role.as_str() {
        "send" => sender::send(&plan),
        "read" => reader::read(&plan),
        _ => Err(usage()),
    }
}

/// Own memory of this process, bytes.
fn own_bytes() -> u64 {
    gyre_stage::usage::Usage::of(std::process::id()).map_or(0, |usage| usage.own_bytes)
}

/// Processor time of this process, ns.
fn cpu_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    (now.tv_sec * 1_000_000_000 + now.tv_nsec) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind {
        topic: "scan",
        bytes: 1000,
    };

    fn plan() -> Plan {
        Plan {
            way: Way::Sockets,
            place: PathBuf::from("a/b"),
            bytes: 1000,
            messages: 2,
            readers: 2,
        }
    }

    #[test]
    fn processes_understand_their_plan() {
        let words = plan().words("send");
        assert_eq!(words[..2], ["hand-over", "send"]);
        assert_eq!(Plan::parse(&words[2..]), Some(plan()));
        assert_eq!(Plan::parse(&words[3..]), None);
    }

    #[test]
    fn a_message_has_arrived_when_the_last_reader_has_it() {
        let had = |after_ns: &[(u64, i64)]| Had {
            after_ns: after_ns.to_vec(),
            cpu_ns: 8_000,
            own_bytes: 1_000_000,
        };
        let sent = Sent {
            cpu_ns: 4_000,
            own_bytes: 2_000_000,
            shared_bytes: 0,
        };
        let all = [
            had(&[(0, 1_000_000), (1, 5_000_000)]),
            had(&[(0, 3_000_000)]),
        ];
        let row = row(&KIND, &plan(), &sent, &all);
        assert_eq!((row.to_last_reader.samples, row.missed), (1, 1));
        assert!(
            row.to_last_reader
                .max_ms
                .is_some_and(|ms| (ms - 3.0).abs() < 0.01)
        );
        assert_eq!((row.sender_us, row.reader_us, row.own_mb), (2.0, 4.0, 4.0));
    }
}
