//! Programs in the place of a stage: does one keep the contract of a stage, which is in
//! `docs/replace-a-stage.md`, and how do its results differ from the results of a running stage?
//!
//! The program runs alone, in runs of its own, as the supervisor would start it. This process
//! replaces the rest of such a run (`harness`): it feeds the program, and judges the program's
//! messages. For [`check`] the inputs are the results of Gyre's own stages for some scans, for
//! [`shadow`](mod@shadow) the items of a running run.

mod checks;
mod harness;
mod reference;
mod report;
mod result;
mod session;
pub mod shadow;

use std::{
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use clap::{Args, builder::PossibleValuesParser};
use gyre_client::{RunError, Signals};
use gyre_configuration::terminal::{Failure, inputs::Inputs, seconds};
use gyre_contract::StageId;
use gyre_supervise::{SuperviseError, rig::Rig};

pub use harness::Candidate;
pub use report::{Report, Rule, Verdict, Work};
pub use result::{Spread, Spreads};

use checks::Examination;
use reference::{Context, Reference};

#[derive(Debug, Args)]
pub struct ConformanceArguments {
    /// The stage that the program replaces.
    #[arg(value_parser = PossibleValuesParser::new(StageId::ALL.map(StageId::name)))]
    pub stage: String,
    /// The program and its arguments, as in 'python3 stage.py --fast'; no shell is involved.
    /// Default: the command of the stage in the configuration, else Gyre's own stage.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    #[command(flatten)]
    pub inputs: Inputs,
    /// Scans to test with, 8 or more.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u16).range(8..=1000))]
    pub scans: u16,
    /// The results must equal the results of Gyre's own stage, to the bit.
    #[arg(long)]
    pub same_as_own: bool,
    /// The 99th percentile of the work on an item must be at most this, ms; of fewer than a hundred
    /// items the maximum. The first four do not count.
    #[arg(long, value_name = "MS", value_parser = milliseconds)]
    pub budget_ms: Option<Duration>,
    /// Time for the program to open its topics, s.
    #[arg(long, default_value = "30", value_name = "S", value_parser = seconds)]
    pub start_timeout_s: Duration,
    /// Time for the program to answer an item, or to refuse it, s.
    #[arg(long, default_value = "10", value_name = "S", value_parser = seconds)]
    pub patience_s: Duration,
    /// Time for the program to exit after SIGTERM, s. A run gives it 2 s.
    #[arg(long, default_value = "2", value_name = "S", value_parser = seconds)]
    pub stop_timeout_s: Duration,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

fn milliseconds(text: &str) -> Result<Duration, &'static str> {
    seconds(text).map(|seconds| seconds / 1000)
}

/// Writes the other files of a run's root, as the list of a recording's files.
type Prepare = Box<dyn Fn(&Path) -> io::Result<()>>;

/// A program that is to keep the contract of a stage.
pub struct Test<'a> {
    /// The program. Each of its runs writes to a folder below its manifest's `out`.
    pub candidate: Candidate,
    pub stages: Vec<StageId>,
    pub prepare: Prepare,
    pub arguments: &'a ConformanceArguments,
}

impl Test<'_> {
    pub(crate) fn rig<'a>(
        &self,
        name: &str,
        signals: &'a Signals,
    ) -> Result<Rig<'a>, SuperviseError> {
        let out = self.candidate.manifest.out.join(name);
        let rig = self.candidate.rig(out, signals)?;
        let root = &rig.manifest().root;
        (self.prepare)(root).map_err(RunError::file(root))?;
        Ok(rig)
    }
}

/// Tests a program; `observe` receives the name of each scenario.
/// Breaches of the contract are in the report, not in the error. A signal ends the test with
/// [`RunError::Stopped`].
pub fn check(
    test: &Test<'_>,
    signals: &Signals,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, Failure> {
    observe("the inputs, by our own stages");
    let reference = Reference::compute(test, signals)?;
    let context = Context {
        test,
        reference: &reference,
        signals,
    };
    Examination::new(context, observe).run()
}
