//! A run as a child process, from its start to its results.

use std::{
    fs::{self, File},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{self, Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use gyre_client::{Observer, Run, RunError, last_line, run::sweep};
use gyre_configuration::terminal::{Failure, own};
use gyre_contract::{Pose, PoseHeader, run::Scenario};
use gyre_storage::create_folder;
use rustix::process::{Pid, Signal, kill_process};

use super::{Setup, TICK, drain};
use crate::{operate::status_of, stress::TestedPipeline};

/// Poses before the measurement: buffers grow, and memory is touched for the first time.
const WARM_UP: u64 = 8;
/// Time for a run to make its first poses. It may load a model.
const START_LIMIT: Duration = Duration::from_secs(300);
/// Time for a run to write its results.
const END_LIMIT: Duration = Duration::from_secs(120);
/// Time between two polls of a run that starts or ends.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// A run as a child process. It is ended, and has written its results, when this is dropped.
pub(super) struct Running<'a> {
    setup: &'a Setup,
    process: Child,
    pub out: PathBuf,
    log: PathBuf,
    /// The latest time of its first poses.
    deadline: Instant,
}

impl<'a> Running<'a> {
    pub fn start(tested: &TestedPipeline, setup: &'a Setup) -> Result<Self, Failure> {
        let out = tested.run_out(&setup.name);
        let log = tested.run_out(&format!("{}.txt", setup.name));
        create_folder(&tested.out.join("runs"))?;
        let output = File::create(&log).map_err(RunError::file(&log))?;
        let errors = output.try_clone().map_err(RunError::file(&log))?;
        // Removes the leftovers of an earlier killed run.
        sweep();
        let run = Command::new(own())
            .args(words(tested, setup, &out))
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(errors)
            .spawn();
        Ok(Self {
            setup,
            process: run.map_err(|error| format!("cannot start a run: {error}"))?,
            out,
            log,
            deadline: Instant::now() + START_LIMIT,
        })
    }

    pub fn pid(&self) -> u32 {
        self.process.id()
    }

    pub fn has_ended(&mut self) -> bool {
        !matches!(self.process.try_wait(), Ok(None))
    }

    /// Returns the reason why it has ended, in its own words, which are complete when its process
    /// has ended too.
    pub fn last_words(&mut self) -> String {
        self.await_end(Instant::now() + END_LIMIT);
        match self.process.try_wait() {
            Ok(None) => return "its stream has ended, and its process continues".to_owned(),
            Ok(Some(status)) if let Some(signal) = status.signal() => {
                return format!("its supervisor was killed by signal {signal}");
            }
            _ => {}
        }
        let said = fs::read_to_string(&self.log).unwrap_or_default();
        last_line(&said).unwrap_or("it said nothing").to_owned()
    }

    fn await_end(&mut self, deadline: Instant) {
        while !self.has_ended() && Instant::now() < deadline {
            thread::sleep(POLL_PERIOD);
        }
    }

    pub fn attach(&mut self) -> Result<Run, Failure> {
        // A supervisor of the same results may still be there, if an earlier run was killed.
        while status_of(&self.out, self.pid()).is_none() {
            self.require_life()?;
            thread::sleep(POLL_PERIOD);
        }
        let run = Run::open(&self.out)?;
        match run.manifest().window.observers {
            0 => Err("run.observers is 0, and the stress test looks on as an observer: set run.observers to 1 or more".into()),
            _ => Ok(run),
        }
    }

    fn require_life(&mut self) -> Result<(), Failure> {
        let setup = self.setup;
        let scenario = &setup.name;
        if self.has_ended() {
            let said = self.last_words();
            let reason = format!("the run of {scenario} ended before it could be measured: {said}");
            return Err(reason.into());
        }
        let (limit_s, log) = (START_LIMIT.as_secs(), self.log.display());
        match Instant::now() < self.deadline {
            true => Ok(()),
            false => Err(format!(
                "the run of {scenario} has made no pose within {limit_s} s; {log} shows the reason"
            )
            .into()),
        }
    }

    /// Waits for the first poses, and returns the newest of them; where hardly a scan comes, for
    /// one.
    pub fn warm_up(&mut self, poses: &mut Observer<Pose>) -> Result<PoseHeader, Failure> {
        let enough = match self.setup.scenario {
            Scenario::Idle => 1,
            _ => WARM_UP,
        };
        let (mut count, mut newest) = (0, PoseHeader::default());
        while count < enough {
            let has_ended = drain(poses, TICK, &mut |pose| {
                count += 1;
                newest = *pose;
            })?;
            if has_ended {
                // Its output is complete when its process has ended too.
                self.await_end(self.deadline);
            }
            self.require_life()?;
        }
        Ok(newest)
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        if let Some(pid) = Pid::from_raw(self.process.id() as i32)
            && !self.has_ended()
        {
            let _ = kill_process(pid, Signal::TERM);
        }
        self.await_end(Instant::now() + END_LIMIT);
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn words(tested: &TestedPipeline, setup: &Setup, out: &Path) -> Vec<String> {
    // Relative to the sensor's own pace.
    let rate = tested.relative_rate(setup.rate_hz);
    let set = ["run.mode=live", "source.repeat=true"].map(str::to_owned);
    let set = set.iter().chain(&setup.set);
    let named = [
        "run".to_owned(),
        format!("--parent={}", process::id()),
        tested.out.join("config.toml").display().to_string(),
        "--fresh".to_owned(),
        format!("--out={}", out.display()),
        format!("--rate={rate}"),
    ];
    let set = set.map(|sentence| format!("--set={sentence}"));
    named.into_iter().chain(set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_words_of_a_run_that_is_ending_are_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("steady.txt");
        let setup = Setup::undisturbed(Scenario::Steady, 4.0, Duration::from_secs(1));
        let process = Command::new("sh")
            .args(["-c", "echo not yet; sleep 0.3; echo the end"])
            .stdout(File::create(&log).unwrap())
            .spawn();
        let mut run = Running {
            setup: &setup,
            process: process.unwrap(),
            out: folder.path().to_owned(),
            log,
            deadline: Instant::now() + START_LIMIT,
        };
        assert_eq!(run.last_words(), "the end");
        assert!(run.has_ended());
    }
}
