//! A program that stands by, as for a swap, reports when it is ready, opens nothing before its
//! standard input ends, and then works as after a normal start.

use std::{
    fs::File,
    path::{Path, PathBuf},
};

use gyre_stage::{StageError, run::STANDBY};
use rustix::fs::{CWD, FileType, Mode, mknodat};

use super::Examination;
use crate::conformance::{
    ProgramError,
    rule::Rule,
    session::{Session, Waited},
};

/// A program need not stand by.
const DOES_NOT: &str = "it does not stand by: `gyre swap` needs --cold";
/// Becomes the program behind it, with the pipe as its standard input.
const WITH_INPUT: &str = "exec \"$@\" < \"$0\"";

impl Examination<'_> {
    pub(super) fn standing_by(&mut self) -> Result<(), ProgramError> {
        let mut session = Session::open(self.context, "standing-by", &mut self.findings)?;
        let candidate = &session.test.candidate;
        let root = session.harness.rig.manifest().root.clone();
        let ready = root.join(format!("{}.ready", candidate.stage.name()));
        let input = StandardInput::create(&root)?;
        session.admit()?;
        session.spawn(&input.command(&candidate.command))?;
        let limit = session.demands().start_timeout;
        let waited = session.wait(limit, |session| ready.exists() || session.has_joined())?;
        let lives = session.rest(session.demands().quiet)?;
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
        session.compare(&self.first_results, all, Rule::StandsBy, when)
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
        (false, Waited::Done) => "told to stand by it ended at once".to_owned(),
        (false, waited) => format!("told to stand by {waited}"),
    }
}

/// Requires that the program works as at any start.
fn takes_over(session: &mut Session<'_>) -> Result<(), ProgramError> {
    session.findings.checked(Rule::StandsBy);
    let limit = session.demands().start_timeout;
    let mut waited = session.wait(limit, |session| session.harness.has_publisher())?;
    let until = session.reference.end() / 3;
    if waited.is_done() {
        session.harness.connect()?;
        waited = session.reach(until)?;
    }
    session
        .findings
        .require(Rule::StandsBy, waited.is_done(), || {
            format!("its standard input has ended, and it has not come to item {until}: {waited}")
        });
    Ok(())
}

/// The standard input of a program that stands by: a named pipe, which ends when this is dropped.
struct StandardInput {
    path: PathBuf,
    _end: File,
}

impl StandardInput {
    fn create(root: &Path) -> Result<Self, ProgramError> {
        let path = root.join("standing-by.input");
        let created = mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0);
        // Opened for both, it does not wait for the program.
        let open = |()| File::options().read(true).write(true).open(&path);
        match created.map_err(Into::into).and_then(open) {
            Ok(end) => Ok(Self { path, _end: end }),
            Err(source) => Err(StageError::File { path, source }.into()),
        }
    }

    /// Returns the command that starts the program with this input and lets it stand by.
    fn command(&self, program: &[String]) -> Vec<String> {
        let told = format!("{STANDBY}=1");
        let path = self.path.display().to_string();
        let shell = ["env", &told, "sh", "-c", WITH_INPUT, &path].map(str::to_owned);
        [&shell, program].concat()
    }
}
