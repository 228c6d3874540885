//! The transport beside copies: the same messages from one process to 1, 4 and 8 others, once
//! through shared memory as stages do it, and once through Unix stream sockets, where each reader
//! gets the bytes.
//!
//! Both sides are alike in all else: one process for the sender and one for each reader; the sender
//! writes the message anew, then sends it; a reader sleeps in `ppoll`, and has a message when it
//! has read a byte of each of its cache lines.

mod reader;
mod sender;
mod sending;
mod socket;

use std::fs;

use gyre_latency::Durations;
use gyre_storage::create_folder;
use serde::{Deserialize, Serialize};

use crate::{
    StressError,
    helper::Helper,
    record::Distribution,
    tested::{MessageKind, TestedPipeline},
    work::Work,
};

pub use crate::hand_over::{HandOver, Medium};
pub(crate) use reader::read;
pub(crate) use sender::send;

/// Messages a second. An observer rests for 10 ms between two polls, which must not show.
const RATE_HZ: f64 = 50.0;
/// Messages before those that are measured.
const WARM_UP: u64 = 10;
/// Messages that are measured in a row, whatever the duration: ten of them are beyond the 99th
/// percentile.
const LEAST: f64 = 1000.0;
/// The same for the 99.9th percentile: more say nothing new.
const MOST: f64 = 10_000.0;
/// The duration of a scenario that [`LEAST`] messages are for, s.
const LEAST_S: f64 = 60.0;
const READERS: [usize; 3] = [1, 4, 8];

/// The cost of the hand-over of one kind of message to some readers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandOverCost {
    /// The topic of this size.
    pub topic: &'static str,
    /// Bytes of a message.
    pub bytes: usize,
    /// The medium of the messages.
    #[serde(rename = "way")]
    pub medium: Medium,
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
    /// Messages that a reader has missed.
    pub missed: u64,
}

/// The result of the sender.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Sent {
    /// Processor time of the measured sends, ns.
    cpu_ns: u64,
    own_bytes: u64,
    shared_bytes: u64,
}

/// The result of a reader.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Readings {
    /// For each measured message its number, and the time from its sending until this reader had
    /// it, ns.
    after_ns: Vec<(u64, i64)>,
    /// Processor time for the measured messages, ns.
    cpu_ns: u64,
    own_bytes: u64,
}

/// Measures all kinds, media and numbers of readers. `note` receives lines about the progress.
///
/// # Errors
/// A process that cannot be started or fails.
pub fn compare(
    tested: &TestedPipeline,
    duration_s: f64,
    note: &mut dyn FnMut(&str),
) -> Result<Vec<HandOverCost>, StressError> {
    let messages = (duration_s / LEAST_S * LEAST).clamp(LEAST, MOST) as u64;
    let mut costs = Vec::new();
    for kind in &tested.kinds {
        for readers in READERS {
            for medium in Medium::ALL {
                let (topic, name) = (kind.topic, medium.name());
                note(&format!("copying: {topic} to {readers} through {name}"));
                let plan = HandOver {
                    medium,
                    place: tested.out.join("runs/copying"),
                    bytes: kind.bytes,
                    messages,
                    readers,
                };
                costs.push(measure(tested, kind, &plan)?);
            }
        }
    }
    Ok(costs)
}

fn measure(
    tested: &TestedPipeline,
    kind: &MessageKind,
    plan: &HandOver,
) -> Result<HandOverCost, StressError> {
    let _ = fs::remove_dir_all(&plan.place);
    create_folder(&plan.place).map_err(|error| StressError::file(&plan.place)(error.source))?;
    let start = |work: fn(HandOver) -> Work| Helper::start(&tested.program, work(plan.clone()));
    let mut sender = start(Work::Send)?;
    let readers: Result<Vec<_>, _> = (0..plan.readers).map(|_| start(Work::Read)).collect();
    let mut readers = readers?;
    sender.send_line("go")?;
    let readings: Result<Vec<_>, _> = readers.iter_mut().map(Helper::read_result).collect();
    let sent: Sent = sender.read_result()?;
    sender.end();
    Ok(cost(kind, plan, &sent, &readings?))
}

fn cost(kind: &MessageKind, plan: &HandOver, sent: &Sent, readings: &[Readings]) -> HandOverCost {
    let mut last = vec![(0_usize, 0_i64); plan.messages as usize];
    for (number, after_ns) in readings.iter().flat_map(|it| &it.after_ns) {
        if let Some((readers, last_ns)) = last.get_mut(*number as usize) {
            *readers += 1;
            *last_ns = (*last_ns).max(*after_ns);
        }
    }
    let mut durations = Durations::default();
    let complete = last
        .iter()
        .filter(|(readers, _)| *readers == readings.len());
    complete.for_each(|(_, last_ns)| durations.add(*last_ns));
    let per_message = |ns: u64| ns as f64 * 1e-3 / plan.messages.max(1) as f64;
    let own_bytes = sent.own_bytes + readings.iter().map(|it| it.own_bytes).sum::<u64>();
    let received: u64 = readings.iter().map(|it| it.after_ns.len() as u64).sum();
    HandOverCost {
        topic: kind.topic,
        bytes: kind.bytes,
        medium: plan.medium,
        readers: plan.readers,
        to_last_reader: Distribution::of(&durations),
        sender_us: per_message(sent.cpu_ns),
        reader_us: per_message(readings.iter().map(|it| it.cpu_ns).sum())
            / readings.len().max(1) as f64,
        own_mb: own_bytes as f64 * 1e-6,
        shared_mb: sent.shared_bytes as f64 * 1e-6,
        missed: (plan.messages * readings.len() as u64).saturating_sub(received),
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
    use std::path::PathBuf;

    use super::*;

    const KIND: MessageKind = MessageKind {
        topic: "scan",
        bytes: 1000,
    };

    fn plan() -> HandOver {
        HandOver {
            medium: Medium::Sockets,
            place: PathBuf::from("a/b"),
            bytes: 1000,
            messages: 2,
            readers: 2,
        }
    }

    #[test]
    fn processes_understand_their_plan() {
        let words = serde_json::to_string(&Work::Send(plan())).unwrap_or_default();
        assert!(words.starts_with("{\"send\":{"), "{words}");
        let parse = |words: &str| serde_json::from_str(words).ok();
        assert_eq!(parse(&words), Some(Work::Send(plan())));
        assert_eq!(parse(&words[3..]), None);
    }

    #[test]
    fn a_message_has_arrived_when_the_last_reader_has_it() {
        let had = |after_ns: &[(u64, i64)]| Readings {
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
        let cost = cost(&KIND, &plan(), &sent, &all);
        assert_eq!((cost.to_last_reader.samples, cost.missed), (1, 1));
        assert!(
            cost.to_last_reader
                .max_ms
                .is_some_and(|ms| (ms - 3.0).abs() < 0.01)
        );
        assert_eq!(
            (cost.sender_us, cost.reader_us, cost.own_mb),
            (2.0, 4.0, 4.0)
        );
    }
}
