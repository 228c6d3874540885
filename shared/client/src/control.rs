//! The control of a running run, from other processes: its status, and requests to its supervisor.
//!
//! [`gyre_contract::control`] has the requests and their answers.

mod exchange;

use std::{
    env,
    fmt::Display,
    fs, io,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use gyre_contract::{
    Command, Commands,
    control::{Answer, PendingSwap, Request, SOCKET, Status, Swap},
};

use exchange::Sent;
use gyre_transport::{Manifest, RunError, run, sessions::not_running};

/// Time for the supervisor to answer. It is busy while it ends a process that the kernel holds.
const ANSWER: Duration = Duration::from_secs(15);
const LOOK: Duration = Duration::from_secs(1);
/// Time for the first scan of a command, and between two looks for it.
const APPLIED: Duration = Duration::from_secs(5);
const APPLIED_LOOK: Duration = Duration::from_millis(20);
/// Appended if the client stops waiting for a request that changes something.
const NOT_LATER: &str = "; what it has not begun by now it does not begin";

#[derive(Debug)]
pub struct Control {
    root: PathBuf,
    /// Device and inode of the root, which differ for a later run with the same results.
    id: (u64, u64),
    out: PathBuf,
}

impl Control {
    pub fn of(out: &Path) -> Result<Self, RunError> {
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

    /// Returns the control of the only run of this user.
    pub fn only() -> Result<Self, RunError> {
        let mut runs = Self::of_all();
        if runs.len() > 1 {
            let names = runs.iter().map(|run| run.out.display().to_string());
            let names = names.collect::<Vec<_>>().join(", ");
            return Err(RunError::Input(format!(
                "several runs are running: name one of {names}"
            )));
        }
        let none = "no run is running: `gyre up` or `gyre run` starts one";
        runs.pop().ok_or_else(|| RunError::Input(none.to_owned()))
    }

    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    pub fn status(&self) -> Result<Status, RunError> {
        self.status_or("")
    }

    fn status_or(&self, otherwise: &str) -> Result<Status, RunError> {
        match self.ask(&Request::Status, otherwise)? {
            Answer::Status(status) => Ok(*status),
            answer => Err(self.silent(format_args!("its answer is {answer:?}"))),
        }
    }

    /// Asks the run to end, as an interrupt does. It has ended when this run is there no more.
    pub fn stop(&self) -> Result<(), RunError> {
        self.order(&Request::Stop)
    }

    pub fn restart(&self, process: &str) -> Result<(), RunError> {
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
    ) -> Result<Option<String>, RunError> {
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

    /// Gives the run a command, and waits for its first scan. Returns the time of that scan, ns on
    /// the sensor's clock; `None` if no scan has taken it: it then applies to the next one. If
    /// the run has ended before, that is an error.
    pub fn command(&self, command: Command) -> Result<Option<i64>, RunError> {
        let number = match self.ask(&Request::Command(command), NOT_LATER)? {
            Answer::Numbered(number) => number,
            answer => return self.is_done(answer).map(|()| None),
        };
        let mut commands = Commands::open(&self.out).map_err(RunError::input)?;
        let since = Instant::now();
        while since.elapsed() < APPLIED && self.is_there() {
            commands.refresh().map_err(RunError::input)?;
            if let Some(from_ns) = commands.from_ns(number) {
                return Ok(Some(from_ns));
            }
            thread::sleep(APPLIED_LOOK);
        }
        match self.is_there() {
            true => Ok(None),
            false => Err(RunError::Input(
                "the run has ended, and no scan has taken the command: it is not applied"
                    .to_owned(),
            )),
        }
    }

    /// Returns whether the run is still there: its supervisor lives, and has not written all
    /// results.
    #[must_use]
    pub fn is_there(&self) -> bool {
        id_of(&self.root) == Some(self.id) && run::is_alive(&self.root)
    }

    fn order(&self, request: &Request) -> Result<(), RunError> {
        let answer = self.ask(request, NOT_LATER)?;
        self.is_done(answer)
    }

    fn is_done(&self, answer: Answer) -> Result<(), RunError> {
        match answer {
            Answer::Done => Ok(()),
            Answer::Refused(reason) => Err(RunError::Input(reason)),
            answer => Err(self.silent(format_args!("its answer is {answer:?}"))),
        }
    }

    /// Asks. The error that there is no answer ends with `otherwise`.
    fn ask(&self, request: &Request, otherwise: &str) -> Result<Answer, RunError> {
        self.wait(self.send(request)?, ANSWER, |_| {
            Err(self.silent(format_args!(
                "there was no answer within {ANSWER:?}{otherwise}"
            )))
        })
    }

    fn send(&self, request: &Request) -> Result<Sent, RunError> {
        let sent = Sent::to(&self.root.join(SOCKET), request, ANSWER);
        sent.map_err(|error| self.failed(&error))
    }

    /// Waits for the answer; calls `look` after each `period` without an answer.
    fn wait(
        &self,
        mut sent: Sent,
        period: Duration,
        mut look: impl FnMut(&Self) -> Result<(), RunError>,
    ) -> Result<Answer, RunError> {
        loop {
            let answer = sent.answer(period).map_err(|error| self.failed(&error))?;
            if let Some(line) = answer {
                return serde_json::from_str(&line).map_err(|error| self.silent(error));
            }
            look(self)?;
        }
    }

    fn failed(&self, error: &io::Error) -> RunError {
        match error.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::UnexpectedEof => not_running(self.out.clone()),
            _ => self.silent(error),
        }
    }

    fn silent(&self, reason: impl Display) -> RunError {
        let out = self.out.display();
        RunError::Input(format!(
            "the run that writes to {out} does not answer: {reason}"
        ))
    }
}

/// Returns the place of a program as a shell finds it: itself if it is a path, else in the folders
/// of PATH.
#[must_use]
pub fn place_of_program(program: &str) -> PathBuf {
    let folders = env::var_os("PATH").unwrap_or_default();
    let place = env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| !program.contains('/') && path.is_file());
    place.unwrap_or_else(|| PathBuf::from(program))
}

fn id_of(root: &Path) -> Option<(u64, u64)> {
    let root = fs::metadata(root).ok()?;
    Some((root.dev(), root.ino()))
}
