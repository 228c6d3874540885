//! The recorder of a run: a process beside the stages that nothing depends on. It is restarted alone, and the run goes on without one that
//! dies too often.

use std::time::{Duration, Instant};

use gyre_stage::{
    control::{Activity, ProcessStatus},
    observer,
};

use crate::{
    Ending, Event, SuperviseError, Supervisor,
    child::Child,
    requests::{activity, of_child},
    start::{Place, Starter},
};

/// The longest time for which the first scan waits until the recorder observes all topics.
const START_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between two looks at whether it does.
const LOOK: Duration = Duration::from_millis(10);
/// The longest time for which a complete run waits for the end of its recording.
const END_TIMEOUT: Duration = Duration::from_secs(30);
/// The same for a run that was interrupted or has failed.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// The process, and when it is to be started again.
pub(crate) struct Recorder {
    child: Child,
    /// `None` while it runs, and when it has ended for good.
    restart_at: Option<Instant>,
    has_ended: bool,
    restarts: usize,
}

impl Recorder {
    pub fn pid(&self) -> u32 {
        self.child.pid()
    }
}

impl Supervisor<'_> {
    /// Starts the recorder before any stage, and waits until it observes all topics, so that it misses nothing of the beginning.
    pub(crate) fn start_recorder(&mut self) -> Result<(), SuperviseError> {
        let Some(plan) = &self.plan.recorder else {
            return Ok(());
        };
        let starter = Starter::new(&self.signals, &self.guardian);
        let mut child = match Child::spawn(plan, &self.plan.manifest, &starter, Place::Free) {
            Err(error) if error.is_of_one_process() => {
                self.say_of_recording(&error.to_string());
                return Ok(());
            }
            spawned => spawned?,
        };
        let ready = observer::ready_file(&self.plan.manifest.root);
        let started = Instant::now();
        while started.elapsed() < START_TIMEOUT && !ready.exists() && !child.has_exited() {
            if self.signals.wait(&[], None, LOOK)?.stop {
                break;
            }
        }
        self.recorder = Some(Recorder {
            child,
            restart_at: None,
            has_ended: false,
            restarts: 0,
        });
        Ok(())
    }

    /// Starts a recorder again that has died.
    pub(crate) fn keep_recorder(&mut self) -> Result<(), SuperviseError> {
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
        if recorder.has_ended || !recorder.child.has_exited() {
            return Ok(());
        }
        let Some(restart_at) = recorder.restart_at else {
            return self.judge_recorder();
        };
        match Instant::now() < restart_at {
            true => Ok(()),
            false => self.respawn_recorder(),
        }
    }

    fn respawn_recorder(&mut self) -> Result<(), SuperviseError> {
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
        (recorder.restart_at, recorder.has_ended) = (None, false);
        recorder.restarts += 1;
        let newest = self.newest.map(|newest| newest.seq);
        let starter = Starter::new(&self.signals, &self.guardian);
        let manifest = &self.plan.manifest;
        match recorder.child.respawn(manifest, &starter, newest) {
            Err(error) if error.is_of_one_process() => {
                recorder.has_ended = true;
                self.say_of_recording(&error.to_string());
                Ok(())
            }
            respawned => respawned,
        }
    }

    /// Decides whether a recorder that has just died is started again.
    fn judge_recorder(&mut self) -> Result<(), SuperviseError> {
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
        self.guardian.forget(recorder.child.pid());
        let death = recorder.child.death();
        let sentence = match recorder.child.may_restart(&death) {
            // It was asked to stop.
            _ if death.code == Some(0) => {
                recorder.has_ended = true;
                death.last_output.unwrap_or_default()
            }
            Ok(()) => {
                recorder.restart_at = Some(Instant::now() + recorder.child.backoff());
                format!(
                    "the recorder died ({}), and is started again: it goes on in another file",
                    death.cause
                )
            }
            Err(error) => {
                recorder.has_ended = true;
                error.to_string()
            }
        };
        self.say_of_recording(&sentence);
        Ok(())
    }

    /// Lets the recorder write what it has received, before the stages end.
    pub(crate) fn stop_recorder(&mut self, ending: Option<Ending>) -> Result<(), SuperviseError> {
        let awaits_restart = |it: &Recorder| it.restart_at.is_some();
        if self.recorder.as_ref().is_some_and(awaits_restart) {
            self.say_of_recording(
                "the recorder died, and the run ended before it was started again: the end of the recording is missing",
            );
        }
        self.end_recorder(match ending {
            Some(Ending::Complete) => END_TIMEOUT,
            _ => STOP_TIMEOUT,
        })
    }

    /// Returns whether a process of this name is the recorder.
    pub(crate) fn is_recorder(&self, process: &str) -> bool {
        let recorder = self.recorder.as_ref();
        recorder.is_some_and(|recorder| recorder.child.name() == process)
    }

    /// Ends the recorder and starts it again, also one that has ended for good: its disk may have room again.
    pub(crate) fn restart_recorder(&mut self) -> Result<(), SuperviseError> {
        self.end_recorder(STOP_TIMEOUT)?;
        self.respawn_recorder()
    }

    /// Returns the state of the recorder, if the run has one.
    pub(crate) fn status_of_recorder(&self) -> Option<ProcessStatus> {
        let Recorder {
            child, restarts, ..
        } = self.recorder.as_ref()?;
        let manifest = &self.plan.manifest;
        let beat = child.heartbeat(manifest);
        let activity = match beat {
            _ if child.is_known_to_have_exited() => Activity::Ended,
            // It beats from when it observes all topics.
            None => Activity::Starting,
            Some(beat) => activity(beat),
        };
        Some(ProcessStatus {
            restarts: *restarts,
            missed: Some(observer::read_missed(&manifest.root, child.pid())),
            ..of_child(child, beat, activity)
        })
    }

    /// Tells the recorder to write what it has received, and kills it if it has not after `limit`.
    fn end_recorder(&mut self, limit: Duration) -> Result<(), SuperviseError> {
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
        if recorder.has_ended || recorder.restart_at.is_some() {
            return Ok(());
        }
        recorder.child.terminate();
        let since = Instant::now();
        while !recorder.child.has_exited() && since.elapsed() < limit {
            self.signals.wait(&[], None, LOOK)?;
            (self.observe)(Event::Watched);
        }
        let was_late = !recorder.child.has_exited();
        recorder.child.kill();
        // One that the kernel holds is left to it.
        let _ = recorder.child.await_end();
        self.guardian.forget(recorder.child.pid());
        let output = recorder.child.last_output().unwrap_or_default();
        let sentence = match was_late {
            true => format!(
                "the recorder had not written all after {limit:?}, and was killed: the end of the recording is missing"
            ),
            // It says something, whether it has missed messages or not.
            false if output.is_empty() => format!(
                "the recorder died ({}): the end of the recording is missing",
                recorder.child.death().cause
            ),
            false => output,
        };
        self.say_of_recording(&sentence);
        Ok(())
    }

    fn say_of_recording(&mut self, sentence: &str) {
        if !sentence.is_empty() {
            (self.observe)(Event::Recorder { sentence });
        }
    }
}
