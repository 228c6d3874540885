//! The control of a running run, from other processes: its status, and requests to its supervisor.
//!
//! The supervisor answers at a socket in the run's root, which is the user's alone: one request on
//! one line of JSON, one answer on another, and the connection is closed.

mod exchange;

use std::{
    fmt::Display,
    fs, io,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    time::Duration,
};

use serde::{Deserialize, Serialize};

use crate::{Manifest, StageError, run, sessions::not_running, source::Received};
use exchange::Sent;

pub const SOCKET: &str = "control.sock";
/// Time for the supervisor to answer. It is busy while it ends a process that the kernel holds.
const ANSWER: Duration = Duration::from_secs(15);
const LOOK: Duration = Duration::from_secs(1);
/// Appended if the client stops waiting for a request that changes something.
const NOT_LATER: &str = "; what it has not begun by now it does not begin";

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    Status,
    /// End the run as an interrupt does: its journal stays, and the same command continues it.
    Stop,
    Restart {
        process: String,
    },
    Swap(Swap),
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Swap {
    pub process: String,
    /// Program and arguments; `None`: those that the run was begun with.
    pub command: Option<Vec<String>>,
    pub directory: PathBuf,
    /// True if the program is started only when the one before has ended, since it cannot stand by.
    pub cold: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    Status(Box<Status>),
    Done,
    Refused(String),
    /// To [`Request::Swap`]: the program has taken over, and nothing has shown yet that it works; a
    /// sentence.
    Untried(String),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    pub pid: u32,
    pub out: PathBuf,
    pub started_in: PathBuf,
    pub live: bool,
    pub phase: Phase,
    pub uptime_s: f64,
    /// Scans that the source has published; `None` if a replaced source does not report them.
    pub published: Option<u64>,
    pub poses: u64,
    pub dropped: u64,
    /// Time since the newest pose was seen, s; `None` before the first one.
    pub last_pose_s: Option<f64>,
    /// The trouble of the whole run: it waits for its radar, or its disk is full.
    #[serde(default)]
    pub notice: Option<String>,
    pub swap: Option<PendingSwap>,
    pub processes: Vec<ProcessStatus>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PendingSwap {
    pub process: String,
    pub command: Vec<String>,
    /// True if the program has taken over, but no scan has passed through it yet; false if it has
    /// not reported that it is ready to take over.
    pub has_taken_over: bool,
    pub waited_s: f64,
    pub limit_s: Option<f64>,
}

gyre_contract::named! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Phase {
        /// A stage has not opened its topics.
        #[default]
        Starting = "starting",
        Running = "running",
        /// The stream has ended, and followers read their logs to the end.
        Following = "following",
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessStatus {
    pub name: String,
    pub pid: u32,
    pub command: Vec<String>,
    pub is_swapped: bool,
    pub activity: Activity,
    /// For how long it has done that, s; `None` if it does not report it.
    pub activity_s: Option<f64>,
    pub uptime_s: f64,
    pub restarts: usize,
    pub last_death: Option<String>,
    /// Messages that it should have recorded and has missed since its start; `None` if it is no
    /// recorder.
    pub missed: Option<u64>,
    /// The counts of a live radar's data; `None` if it is no source of one.
    pub received: Option<Received>,
}

gyre_contract::named! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Activity {
        /// It has not opened its topics: it may be loading a model.
        Starting = "starting",
        Waiting = "waiting",
        Working = "working",
        /// It has not woken from a sleep that has ended: it is stopped, or not run by the system.
        Silent = "silent",
        /// It runs, and writes no heartbeat, as a replacement need not.
        Running = "running",
        Ended = "ended",
    }
}

#[derive(Debug)]
pub struct Control {
    root: PathBuf,
    /// Device and inode of the root, which differ for a later run with the same results.
    id: (u64, u64),
    out: PathBuf,
}

impl Control {
    pub fn of(out: &Path) -> Result<Self, StageError> {
        let absolute = out.canonicalize().unwrap_or_else(|_| out.to_owned());
        Self::at(run::root_of(&absolute), out.to_owned()).ok_or_else(|| not_running(out.to_owned()))
    }

    /// Returns the control of the run with this root; `None` if it is dead, or has no socket yet.
    fn at(root: PathBuf, out: PathBuf) -> Option<Self> {
        let id = id_of(&root)?;
        let is_running = root.join(SOCKET).exists() && run::is_alive(&root);
        is_running.then_some(Self { root, id, out })
    }

    /// Returns the controls of all runs of this user, by the folders of their results.
    #[must_use]
    pub fn of_all() -> Vec<Self> {
        let with_out = |root: PathBuf| {
            let mut run = Self::at(root.clone(), root)?;
            let manifest = Manifest::read(&run.root).map(|manifest| manifest.out);
            // A run that waits for its radar has none yet.
            run.out = manifest
                .or_else(|_| run.status().map(|status| status.out))
                .unwrap_or(run.out);
            Some(run)
        };
        let mut runs: Vec<Self> = run::roots().into_iter().filter_map(with_out).collect();
        runs.sort_by(|a, b| a.out.cmp(&b.out));
        runs
    }

    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    pub fn status(&self) -> Result<Status, StageError> {
        self.status_or("")
    }

    fn status_or(&self, otherwise: &str) -> Result<Status, StageError> {
        match self.ask(&Request::Status, otherwise)? {
            Answer::Status(status) => Ok(*status),
            answer => Err(self.silent(format_args!("its answer is {answer:?}"))),
        }
    }

    /// Asks the run to end, as an interrupt does. It has ended when this run is there no more.
    pub fn stop(&self) -> Result<(), StageError> {
        self.order(&Request::Stop)
    }

    pub fn restart(&self, process: &str) -> Result<(), StageError> {
        let process = process.to_owned();
        self.order(&Request::Restart { process })
    }

    /// Replaces the program of a stage. Returns when the new program has worked on a first pose;
    /// or, with a sentence, when it has taken over but no scan came. Each second until then,
    /// `observe` receives the reason for waiting. If the new program fails to take over, the
    /// previous program continues.
    pub fn swap(
        &self,
        swap: Swap,
        observe: &mut dyn FnMut(&PendingSwap),
    ) -> Result<Option<String>, StageError> {
        let sent = self.send(&Request::Swap(swap))?;
        // The supervisor has the limits: `run.start_timeout_s`, and the limit of the trial. But it
        // may hang.
        let answer = self.wait(sent, LOOK, |run| {
            let status = run.status_or(NOT_LATER)?;
            status.swap.iter().for_each(&mut *observe);
            Ok(())
        });
        match answer? {
            Answer::Untried(sentence) => Ok(Some(sentence)),
            answer => self.is_done(answer).map(|()| None),
        }
    }

    /// Returns whether the run is still there: its supervisor lives, and has not written all
    /// results.
    #[must_use]
    pub fn is_there(&self) -> bool {
        id_of(&self.root) == Some(self.id) && run::is_alive(&self.root)
    }

    fn order(&self, request: &Request) -> Result<(), StageError> {
        let answer = self.ask(request, NOT_LATER)?;
        self.is_done(answer)
    }

    fn is_done(&self, answer: Answer) -> Result<(), StageError> {
        match answer {
            Answer::Done => Ok(()),
            Answer::Refused(reason) => Err(StageError::Input(reason)),
            answer => Err(self.silent(format_args!("its answer is {answer:?}"))),
        }
    }

    /// Asks. The error that there is no answer ends with `otherwise`.
    fn ask(&self, request: &Request, otherwise: &str) -> Result<Answer, StageError> {
        self.wait(self.send(request)?, ANSWER, |_| {
            Err(self.silent(format_args!(
                "there was no answer within {ANSWER:?}{otherwise}"
            )))
        })
    }

    fn send(&self, request: &Request) -> Result<Sent, StageError> {
        let sent = Sent::to(&self.root.join(SOCKET), request, ANSWER);
        sent.map_err(|error| self.failed(&error))
    }

    /// Waits for the answer; calls `look` after each `period` without an answer.
    fn wait(
        &self,
        mut sent: Sent,
        period: Duration,
        mut look: impl FnMut(&Self) -> Result<(), StageError>,
    ) -> Result<Answer, StageError> {
        loop {
            let answer = sent.answer(period).map_err(|error| self.failed(&error))?;
            if let Some(line) = answer {
                return serde_json::from_str(&line).map_err(|error| self.silent(error));
            }
            look(self)?;
        }
    }

    fn failed(&self, error: &io::Error) -> StageError {
        match error.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::UnexpectedEof => not_running(self.out.clone()),
            _ => self.silent(error),
        }
    }

    fn silent(&self, reason: impl Display) -> StageError {
        let out = self.out.display();
        StageError::Input(format!(
            "the run that writes to {out} does not answer: {reason}"
        ))
    }
}

fn id_of(root: &Path) -> Option<(u64, u64)> {
    let root = fs::metadata(root).ok()?;
    Some((root.dev(), root.ino()))
}
