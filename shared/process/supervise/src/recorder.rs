//! The recorder of a run: a process beside the stages that nothing depends on. It is restarted
//! alone, and the run continues without a recorder that dies too often.

use std::time::{Duration, Instant};

use gyre_client::observer;
use gyre_contract::control::{Activity, ProcessStatus};
use gyre_transport::run::ready_file;

use crate::{
    Ending, Event, SuperviseError,
    child::{Child, RESTART_BACKOFF},
    run::Run,
};

/// The longest time for which the first scan waits until the recorder observes all topics.
const START_TIMEOUT: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(10);
/// The longest time for which a complete run waits for the end of its recording.
const END_TIMEOUT: Duration = Duration::from_secs(30);
/// The same for a run that was interrupted or has failed.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

pub(crate) struct Recorder {
    child: Child,
    /// `None` while it runs, and when it has ended for good.
    restart_at: Option<Instant>,
    has_ended: bool,
    restarts: usize,
}

impl Recorder {
    /// Starts the recorder of the plan before any stage, and waits until it observes all topics, so
    /// that it misses nothing of the beginning.
    pub fn start(run: &mut Run<'_>) -> Result<Option<Self>, SuperviseError> {
        let Some(plan) = &run.plan.recorder else {
            return Ok(None);
        };
        let mut child = match Child::spawn(plan, &run.starter(), false) {
            Err(SuperviseError::Process(reason)) => {
                run.note(&reason);
                return Ok(None);
            }
            spawned => spawned?,
        };
        let ready = ready_file(&run.manifest().root, &plan.name);
        let started = Instant::now();
        while started.elapsed() < START_TIMEOUT && !ready.exists() && !child.has_exited() {
            if run.sleep(LOOK)? {
                break;
            }
        }
        Ok(Some(Self {
            child,
            restart_at: None,
            has_ended: false,
            restarts: 0,
        }))
    }

    pub fn name(&self) -> &str {
        self.child.name()
    }

    pub fn pid(&self) -> u32 {
        self.child.pid()
    }

    pub fn keep(&mut self, run: &mut Run<'_>, newest: Option<u64>) -> Result<(), SuperviseError> {
        if self.has_ended || !self.child.has_exited() {
            return Ok(());
        }
        match self.restart_at {
            Some(restart_at) if Instant::now() < restart_at => return Ok(()),
            Some(_) => return self.respawn(run, newest),
            None => run.guardian.forget(self.child.pid()),
        }
        let death = self.child.death();
        let may_restart = self.child.may_restart(&death);
        let sentence = match may_restart {
            // It was asked to stop.
            _ if death.code == Some(0) => death.last_output.unwrap_or_default(),
            Err(error) => error.to_string(),
            Ok(()) => {
                self.restart_at = Some(Instant::now() + RESTART_BACKOFF);
                run.note(&format!(
                    "the recorder died ({}), and is started again: it continues in a different file",
                    death.cause
                ));
                return Ok(());
            }
        };
        self.has_ended = true;
        run.note(&sentence);
        Ok(())
    }

    fn respawn(&mut self, run: &mut Run<'_>, newest: Option<u64>) -> Result<(), SuperviseError> {
        (self.restart_at, self.has_ended) = (None, false);
        self.restarts += 1;
        let respawned = self.child.respawn(&run.starter(), newest);
        match respawned {
            Err(SuperviseError::Process(reason)) => {
                self.has_ended = true;
                run.note(&reason);
                Ok(())
            }
            respawned => respawned,
        }
    }

    /// Lets the recorder write all received messages, after the stages have ended.
    pub fn stop(
        &mut self,
        run: &mut Run<'_>,
        ending: Option<Ending>,
    ) -> Result<(), SuperviseError> {
        if self.restart_at.is_some() {
            run.note(
                "the recorder died, and the run ended before it was started again: the end of the recording is missing",
            );
        }
        let limit = match ending {
            Some(Ending::Complete) => END_TIMEOUT,
            _ => STOP_TIMEOUT,
        };
        self.end(run, limit)
    }

    /// Ends the recorder and starts it again, also one that has ended for good: its disk may have
    /// room again.
    pub fn restart(
        &mut self,
        run: &mut Run<'_>,
        newest: Option<u64>,
    ) -> Result<(), SuperviseError> {
        self.end(run, STOP_TIMEOUT)?;
        self.respawn(run, newest)
    }

    pub fn status(&self, run: &Run<'_>) -> ProcessStatus {
        let root = &run.manifest().root;
        ProcessStatus {
            restarts: self.restarts,
            missed: Some(observer::read_missed(root, self.child.pid())),
            // It beats from when it observes all topics.
            ..self.child.status(run, Activity::Starting)
        }
    }

    /// Asks the recorder to write its received messages, and kills it if it has not finished after
    /// `limit`.
    fn end(&mut self, run: &mut Run<'_>, limit: Duration) -> Result<(), SuperviseError> {
        if self.has_ended || self.restart_at.is_some() {
            return Ok(());
        }
        self.child.terminate();
        let since = Instant::now();
        while !self.child.has_exited() && since.elapsed() < limit {
            run.sleep(LOOK)?;
            run.say(Event::Watched);
        }
        let was_late = !self.child.has_exited();
        self.child.kill();
        // One that the kernel holds is left to it.
        let _ = self.child.await_end();
        run.guardian.forget(self.child.pid());
        let output = self.child.last_output().unwrap_or_default();
        let sentence = match was_late {
            true => format!(
                "the recorder had not written all after {limit:?}, and was killed: the end of the recording is missing"
            ),
            // A sentence follows, whether the recorder has missed messages or not.
            false if output.is_empty() => format!(
                "the recorder died ({}): the end of the recording is missing",
                self.child.death().cause
            ),
            false => output,
        };
        run.note(&sentence);
        Ok(())
    }
}
