//! The recorder: an observer that writes the messages of a running run to an MCAP file.
//!
//! One thread takes messages from the observers' queues and copies them, and a second thread
//! compresses and writes. Between them is a queue with a limit in bytes. So a slow disk costs
//! memory first, and then messages, which are counted. Nothing that the recorder does reaches the
//! run: see [`gyre_client::observer`].

mod begin;
mod health;
mod queue;
mod tap;

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::mpsc::Receiver,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_client::{
    MAX_WAIT, Manifest, Run, RunError, Signals, clock, has_room, log, run, wait_for_any,
};
use gyre_contract::{Message, Pose, Use, topic, topic_named};
use gyre_recording::{LogTail, Positions, RecordingError, SplitWriter};

use begin::{begin, failed};
use health::health;
use queue::{Entry, LIMIT_BYTES, Sender, queue, write};
use tap::{Counts, Tap};

pub use begin::{require_new, require_own};
pub use gyre_recording::{Ledger, Split};

const LOG: &str = "log";
const HEALTH: &str = "health";
const NAME: &str = "recorder";
const SENTENCE_PERIOD: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
pub struct Options {
    pub out: PathBuf,
    pub to: PathBuf,
    /// The topics, `log` and `health` among them; empty: the default ones that the run has.
    pub topics: Vec<String>,
    pub split: Split,
    /// True if an existing recording belongs to this run, begun by another recorder: it continues
    /// in its next part.
    pub continues: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    pub path: PathBuf,
    pub counts: Vec<Counts>,
}

impl Recorded {
    pub fn is_complete(&self) -> bool {
        self.counts.iter().all(|it| it.missed == 0)
    }
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |number: fn(&Counts) -> u64| {
            let counts = self.counts.iter().filter(|counts| number(counts) > 0);
            let counts = counts.map(|it| format!("{} {}", number(it), it.topic));
            match &counts.collect::<Vec<String>>()[..] {
                [] => "nothing".to_owned(),
                counts => counts.join(", "),
            }
        };
        let (recorded, missed) = (list(|it| it.recorded), list(|it| it.missed));
        let path = self.path.display();
        write!(f, "recorded {recorded} in {path}; missed {missed}")?;
        match self.is_complete() {
            true => Ok(()),
            false => write!(f, ": the recording is not complete"),
        }
    }
}

pub fn record(options: &Options) -> Result<Recorded, RunError> {
    let run = match std::env::var_os(run::ENVIRONMENT) {
        // The supervisor's own: its root is the same for other names of the folder.
        Some(root) if options.continues => Run::at(Path::new(&root))?,
        _ => Run::open(&options.out)?,
    };
    let manifest = run.manifest();
    let _log = log::start_log(manifest, NAME)?;
    let signals = Signals::install()?;
    let topics = topics(&options.topics, manifest)?;
    let begun = begin(options, manifest, &topics)?;
    let taps = taps(&run, &topics, begun.earlier.as_ref())?;
    let (to, split) = (options.to.clone(), options.split);
    let earlier = begun.earlier.unwrap_or_default();
    let writer = SplitWriter::create(to, begun.head, split, begun.ledger, earlier);
    let writer = writer.map_err(failed)?;
    let path = writer.file.path.clone();
    if options.continues {
        run.is_ready(NAME, &signals)?;
    }
    let has = |name| topics.iter().any(|topic| topic == name);
    let log = has(LOG).then(|| LogTail::new(&manifest.events()));
    let health = has(HEALTH).then(|| health(manifest.out.clone()));
    let (sender, receiver) = queue(LIMIT_BYTES);
    let writing = thread::spawn(move || write(writer, &receiver));
    let mut recorder = Recorder {
        run: &run,
        signals,
        taps,
        log,
        health,
        queue: sender,
        is_of_run: options.continues,
        reported: 0,
        due: Instant::now(),
    };
    let ended = recorder.run_until_end(&writing);
    let counts: Vec<Counts> = recorder.taps.iter().map(|tap| tap.counts()).collect();
    let signals = recorder.signals;
    drop(recorder.queue);
    let died = |_| RunError::Transient("the thread that writes the recording has ended".to_owned());
    match writing.join().map_err(died)? {
        Err(error) if error.is_full() && options.continues => {
            return Err(await_room(&path, error, &signals)?);
        }
        written => written.map_err(failed)?,
    }
    ended?;
    let recorded = Recorded { path, counts };
    match recorded.is_complete() {
        true => tracing::info!("{recorded}"),
        false => tracing::error!("{recorded}"),
    }
    Ok(recorded)
}

/// Waits until the disk of a recording has room again; the recorder that is started then continues
/// in the next file. Returns the error without room, when the run ends.
fn await_room(path: &Path, error: RecordingError, signals: &Signals) -> Result<RunError, RunError> {
    tracing::error!("{error}: the recording continues in a different file when there is room");
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    while !has_room(folder.unwrap_or(Path::new("."))) {
        if signals.sleep(MAX_WAIT)? {
            return Ok(failed(error));
        }
    }
    let again = "the disk of the recording was full, and has room again";
    Ok(RunError::Transient(again.to_owned()))
}

fn topics(named: &[String], manifest: &Manifest) -> Result<Vec<String>, RunError> {
    if named.is_empty() {
        let topics = gyre_contract::all().filter(|it| it.is(Use::Recorded));
        let topics = topics.map(|it| it.name).filter(|it| manifest.has_topic(it));
        return Ok(topics.chain([LOG, HEALTH]).map(str::to_owned).collect());
    }
    for name in named.iter().filter(|it| *it != LOG && *it != HEALTH) {
        let unknown = |sentence| RunError::Input(format!("{sentence}, {LOG}, {HEALTH}"));
        topic_named(name).map_err(unknown)?;
    }
    Ok(named.to_vec())
}

fn taps(run: &Run, topics: &[String], earlier: Option<&Positions>) -> Result<Vec<Tap>, RunError> {
    let tap = |name: &String| {
        // Recording begins with the first scan, which waits for the recorder.
        let expected = earlier.map(|it| it.get(name).copied().unwrap_or_default());
        topic(name).map(|topic| Tap::on(run, topic, expected))
    };
    topics.iter().filter_map(tap).collect()
}

struct Recorder<'run> {
    run: &'run Run,
    signals: Signals,
    taps: Vec<Tap>,
    log: Option<LogTail>,
    health: Option<Receiver<String>>,
    queue: Sender,
    is_of_run: bool,
    reported: u64,
    due: Instant,
}

impl Recorder<'_> {
    /// Receives until the run ends, a signal requests a stop, or the other thread has failed.
    fn run_until_end<T>(&mut self, writing: &JoinHandle<T>) -> Result<(), RunError> {
        loop {
            // Before the queues are emptied: the messages before the end are still there.
            let has_ended = self.run.has_ended();
            self.take_all()?;
            // As long as poses are to come, masking may be killed and may number its messages
            // again, even the end of the stream.
            let is_last = |tap: &Tap| tap.counts().topic == Pose::TOPIC;
            let have_ended = self.taps.iter().any(is_last) && self.taps.iter().all(Tap::has_ended);
            if has_ended || have_ended || writing.is_finished() {
                return Ok(());
            }
            let listeners: Vec<_> = self.taps.iter().map(|tap| tap.listener()).collect();
            if wait_for_any(&self.signals, &listeners, MAX_WAIT)? {
                return self.take_all();
            }
        }
    }

    fn take_all(&mut self) -> Result<(), RunError> {
        for tap in &mut self.taps {
            tap.drain(&self.queue)?;
        }
        self.report_missed()?;
        if let Some(log) = &mut self.log {
            for line in log.lines(clock::since_1970_ns()) {
                self.queue.put(Entry::Log(line));
            }
        }
        for json in self.health.iter().flat_map(Receiver::try_iter) {
            self.queue.put(Entry::Health(json, clock::since_1970_ns()));
        }
        Ok(())
    }

    fn report_missed(&mut self) -> Result<(), RunError> {
        let missed = self.taps.iter().map(|tap| tap.counts().missed).sum();
        if missed > self.reported && Instant::now() >= self.due {
            let counts = self.taps.iter().map(Tap::counts);
            let counts = counts.filter(|it| it.missed > 0);
            let counts = counts.map(|it| format!("{} of {}", it.missed, it.topic));
            let counts: Vec<String> = counts.collect();
            tracing::warn!(
                "missed {} so far: the recorder was too slow, or was not there",
                counts.join(", ")
            );
            (self.reported, self.due) = (missed, Instant::now() + SENTENCE_PERIOD);
            if self.is_of_run {
                self.run.tell_missed(missed)?;
            }
        }
        Ok(())
    }
}
