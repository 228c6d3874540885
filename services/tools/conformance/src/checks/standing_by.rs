//! Told to stand by, as for a swap: the program says when it is ready, opens nothing before its standard input ends, and then goes on as at
//! any start.

use std::{
    fs::File,
    path::{Path, PathBuf},
};

use gyre_messages::StageId;
use gyre_stage::run::STANDBY;
use rustix::fs::{CWD, FileType, Mode, mknodat};

use super::{Examination, compare, how};
use crate::{
    ConformanceError,
    rule::Rule,
    session::{Session, Waited},
};

/// A program need not stand by.
const DOES_NOT: &str = "it does not stand by: `gyre swap` needs --cold";
/// Becomes the program behind it, with the pipe as its standard input.
const WITH_INPUT: &str = "exec \"$@\" < \"$0\"";

impl Examination<'_> {
    pub(super) fn standing_by(&mut self) -> Result<(), ConformanceError> {
        let subject = self.subject;
        let rig = subject.rig(self.signals, "standing-by")?;
        let ready = ready_file(&rig.manifest().root, subject.stage);
        let input = Input::create(&rig.manifest().root)?;
        let mut session = Session::open(subject, &rig, self.tape, &mut self.findings)?;
        session.send_history()?;
        session.spawn(&input.command(&subject.command))?;
        let limit = subject.demands.start_timeout;
        let waited = session.wait(limit, |session| ready.exists() || session.has_joined())?;
        let lives = session.rest(subject.demands.quiet)?;
        match (ready.exists(), session.has_joined()) {
            (false, true) => {
                session.findings.not_for(Rule::StandsBy, DOES_NOT);
                return Ok(());
            }
            (true, false) if lives => {}
            (is_ready, has_joined) => {
                let sentence = breach(is_ready && has_joined, &waited);
                session.findings.broken(Rule::StandsBy, sentence);
                return Ok(());
            }
        }
        drop(input);
        takes_over(&mut session)?;
        let all = 0..session.outputs.len();
        let when = "after it has stood by";
        compare(&mut session, &self.reference, all, Rule::StandsBy, when)
    }
}

fn breach(has_joined: bool, waited: &Waited) -> String {
    match (has_joined, waited) {
        (true, _) => {
            "told to stand by it opens its topics before its standard input ends: the program before it is still there".to_owned()
        }
        (false, Waited::TimedOut) => {
            "told to stand by it neither says that it does nor starts, within the start timeout".to_owned()
        }
        (false, Waited::Done) => "told to stand by it said that it does, and ended".to_owned(),
        (false, waited) => format!("told to stand by {}", how(waited)),
    }
}

/// Requires that the program works as at any start.
fn takes_over(session: &mut Session<'_>) -> Result<(), ConformanceError> {
    let (limit, patience) = (
        session.subject.demands.start_timeout,
        session.subject.demands.patience,
    );
    let stage = session.subject.stage;
    session.findings.checked(Rule::StandsBy);
    let mut waited = session.wait(limit, |session| session.rig.has_publisher(stage))?;
    let until = session.tape.end() / 3;
    if matches!(waited, Waited::Done) {
        session.connect_all()?;
        waited = session.wait(patience, |session| session.newest() >= Some(until))?;
    }
    let has_taken_over = matches!(waited, Waited::Done);
    session
        .findings
        .require(Rule::StandsBy, has_taken_over, || {
            format!(
                "its standard input has ended, and it has not come to item {until}: {}",
                how(&waited)
            )
        });
    Ok(())
}

/// Returns the file by which a program says that it stands by.
fn ready_file(root: &Path, stage: StageId) -> PathBuf {
    root.join(format!("{}.ready", stage.name()))
}

/// The standard input of a program that stands by: a named pipe, which ends when this is dropped.
struct Input {
    path: PathBuf,
    _end: File,
}

impl Input {
    fn create(root: &Path) -> Result<Self, ConformanceError> {
        let path = root.join("standing-by.input");
        let created = mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0);
        // Opened for both, it does not wait for the program.
        let open = |()| File::options().read(true).write(true).open(&path);
        match created.map_err(Into::into).and_then(open) {
            Ok(end) => Ok(Self { path, _end: end }),
            Err(source) => Err(ConformanceError::File { path, source }),
        }
    }

    /// Returns the command that becomes the program with this input, told to stand by.
    fn command(&self, program: &[String]) -> Vec<String> {
        let told = format!("{STANDBY}=1");
        let path = self.path.display().to_string();
        let shell = ["env", &told, "sh", "-c", WITH_INPUT, &path].map(str::to_owned);
        [&shell, program].concat()
    }
}
