//! One life of the shadow: its process, alone in a run of its own.

use std::{
    fs, io,
    io::Write,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_client::{RunError, Signals};
use gyre_contract::{StageId, run::REFINEMENT_STATE};
use gyre_supervise::{SuperviseError, rig::Process};

use crate::conformance::{
    Candidate,
    harness::{Harness, Sent},
};

/// Messages that are taken at once of a program that may send without end.
const AT_ONCE: usize = 64;
/// Time to exit after SIGTERM, as in a run.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two polls of a process that is to exit.
const POLL_PERIOD: Duration = Duration::from_millis(5);

pub(crate) struct ShadowProgram {
    /// The program; its manifest is the manifest of the observed run, without its live mode.
    pub candidate: Candidate,
    /// The place for the files of all lives.
    pub folder: PathBuf,
    pub output: Option<PathBuf>,
}

pub(crate) struct Life<'a> {
    pub harness: Harness<'a>,
    pub began: Instant,
    pub is_open: bool,
}

impl<'a> Life<'a> {
    /// Starts the program in a run of its own, with a copy of the state of the observed run's
    /// refinement.
    pub fn begin(program: &'a ShadowProgram, signals: &'a Signals) -> Result<Self, SuperviseError> {
        let (candidate, out) = (&program.candidate, program.folder.join("out"));
        if out.exists() {
            fs::remove_dir_all(&out).map_err(RunError::file(&out))?;
        }
        if candidate.stage == StageId::Refinement {
            copy_state(&candidate.manifest.out, &out)?;
        }
        let rig = candidate.rig(out, signals)?;
        let mut harness = Harness::open(rig, candidate)?;
        harness.start(false)?;
        Ok(Self {
            harness,
            began: Instant::now(),
            is_open: false,
        })
    }

    /// Answers the handshakes of the process. Returns whether it has opened its topics.
    pub(crate) fn attend(&mut self) -> Result<bool, RunError> {
        self.harness.answer_handshakes()?;
        if !self.is_open && self.harness.has_publisher() {
            self.is_open = true;
            self.harness.connect()?;
        }
        Ok(self.is_open)
    }

    pub(crate) fn take(&self) -> Result<Vec<Sent>, RunError> {
        let received = std::iter::from_fn(|| self.harness.receive().transpose());
        received.take(AT_ONCE).collect()
    }

    pub(crate) fn end(&mut self) -> Result<(), RunError> {
        self.harness.process.iter().for_each(Process::terminate);
        let since = Instant::now();
        while self.harness.death().is_none() && since.elapsed() < STOP_TIMEOUT {
            std::thread::sleep(POLL_PERIOD);
            self.attend()?;
        }
        Ok(())
    }
}

impl ShadowProgram {
    /// Appends the output of a life of the program to the file for it.
    pub(crate) fn keep_output(&self, life: &Life<'_>) -> Result<(), RunError> {
        let Some(path) = &self.output else {
            return Ok(());
        };
        let log = format!("log/{}.txt", self.candidate.stage.name());
        let appended = fs::read(life.harness.rig.manifest().out.join(log)).and_then(|printed| {
            let file = fs::OpenOptions::new().create(true).append(true).open(path);
            file?.write_all(&printed)
        });
        appended.map_err(RunError::file(path))
    }
}

/// Copies the state of a run's refinement: a refinement that is restarted or swapped in starts with
/// the same state.
fn copy_state(run: &Path, out: &Path) -> Result<(), RunError> {
    let [from, to] = [run, out].map(|folder| folder.join(REFINEMENT_STATE));
    gyre_storage::create_folder(to.parent().unwrap_or(out))?;
    match fs::copy(&from, to) {
        // A replaced refinement need not have one.
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(RunError::file(&from)(error)),
        _ => Ok(()),
    }
}
