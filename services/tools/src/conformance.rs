//! Programs in the place of a stage: does one keep the contract of a stage, which is in
//! `docs/replace-a-stage.md`, and how do its results differ from the results of a running stage?
//!
//! The program runs alone, in runs of its own, as the supervisor would start it. This process
//! replaces the rest of such a run (`harness`): it feeds the program, and judges the program's
//! messages. For [`check`] the inputs are the results of Gyre's own stages for some scans, for
//! [`shadow`](mod@shadow) the items of a running run.

mod feedback;
mod harness;
mod lives;
mod reference;
mod refusal;
mod report;
mod result;
mod session;
pub mod shadow;
mod stream;

use std::{
    io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::{Args, builder::PossibleValuesParser};
use gyre_client::{RunError, Signals};
use gyre_configuration::terminal::{Failure, inputs::Inputs, print, seconds};
use gyre_contract::{StageId, flag};
use gyre_supervise::{
    SuperviseError,
    rig::{Recorded, Rig},
};

pub use harness::Candidate;
pub use report::{Report, Rule, Verdict, Work};
pub use result::{Spread, Spreads};

use reference::{Context, POLL_PERIOD, Reference};
use report::Findings;
use result::{result_bytes, work_ns};
use session::{Pace, Session};

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
    fn announce(&self, scenario: &str) {
        if !self.arguments.json {
            print::note(format_args!("gyre: testing {scenario}"));
        }
    }

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

/// Tests a program. Breaches of the contract are in the report, not in the error. A signal ends the
/// test with [`RunError::Stopped`].
pub fn check(test: &Test<'_>, signals: &Signals) -> Result<Report, Failure> {
    test.announce("the inputs, by our own stages");
    let reference = Reference::compute(test, signals)?;
    let examination = Examination {
        context: Context {
            test,
            reference: &reference,
            signals,
        },
        findings: Findings::default(),
        outputs: Vec::new(),
    };
    examination.run()
}

/// Items between two observers.
const BETWEEN: u64 = 3;

type Scenario<'a> = fn(&mut Examination<'a>) -> Result<(), Failure>;

/// The scenarios of a test, each in a run of its own.
struct Examination<'a> {
    context: Context<'a>,
    findings: Findings,
    /// The messages of the first scenario.
    outputs: Vec<Recorded>,
}

impl<'a> Examination<'a> {
    fn stage(&self) -> StageId {
        self.context.test.candidate.stage
    }

    /// Opens a run, and starts the program in it with items sent at a pace and up to one; returns
    /// also whether it has opened its topic.
    fn begin(&mut self, name: &str, pace: Pace, end: u64) -> Result<(Session<'_>, bool), Failure> {
        let mut session = Session::open(self.context, name, &mut self.findings)?;
        (session.pace, session.until) = (pace, end);
        let is_open = session.starts()?;
        session.harness.connect()?;
        Ok((session, is_open))
    }

    /// Runs all scenarios. If the program does not complete the first, the others would show
    /// nothing.
    fn run(mut self) -> Result<Report, Failure> {
        self.note_inapplicable_rules();
        self.context.test.announce("a start without topics");
        self.start_without_topics()?;
        self.context.test.announce("a whole stream");
        if !self.stream()? {
            return self.report(None);
        }
        let is_masking = self.stage() == StageId::Masking;
        let is_source = self.stage() == StageId::RadarReplay;
        let scenarios: [(bool, &str, Scenario<'a>); 5] = [
            (true, "one item at a time, with observers", Self::steps),
            (true, "kill -9", Self::restart),
            (is_masking, "feedback", Self::feedback),
            (is_source, "a full window", Self::window),
            (true, "standing by", Self::standing_by),
        ];
        for (_, name, scenario) in scenarios.into_iter().filter(|it| it.0) {
            self.context.test.announce(name);
            scenario(&mut self)?;
        }
        self.refusals()?;
        let mut answers = None;
        if self.context.test.arguments.budget_ms.is_some() {
            self.context.test.announce("the time of its answers");
            answers = self.timing()?;
        }
        self.report(answers)
    }

    fn note_inapplicable_rules(&mut self) {
        let (stage, arguments) = (self.stage(), self.context.test.arguments);
        let lag = self.context.test.candidate.manifest.window.lag;
        let is_source = stage == StageId::RadarReplay;
        let is_masking = stage == StageId::Masking;
        let is_sink = stage == StageId::PoseIntegration;
        let has_budget = arguments.budget_ms.is_some();
        for (applies, rule, reason) in [
            (!is_source, Rule::CopiesItem, "a source makes the items"),
            (is_source, Rule::KeepsWindow, "it is no source"),
            (is_masking, Rule::WaitsForMotion, "it is not masking"),
            (lag > 0, Rule::WaitsForMotion, "masking.lag is 0"),
            (is_sink, Rule::BeginsWithNewest, "it is not the sink"),
            (arguments.same_as_own, Rule::SameAsOwn, "not asked for"),
            (has_budget, Rule::KeepsBudget, "not asked for"),
        ] {
            if !applies {
                self.findings.not_for(rule, reason);
            }
        }
    }

    /// A start where the supervisor has created nothing: all that exists afterwards is the
    /// program's.
    fn start_without_topics(&mut self) -> Result<(), Failure> {
        let test = self.context.test;
        let rig = test.rig("absence", self.context.signals)?;
        let (command, scheduling) = (&test.candidate.command, &test.candidate.scheduling);
        let mut process = rig.start(self.stage().name(), command, scheduling, false)?;
        let since = Instant::now();
        let has_created = || !rig.services().is_empty();
        // It may wait for its topics as long as it likes.
        while process.death().is_none()
            && !has_created()
            && since.elapsed() <= test.arguments.patience_s
        {
            rig.sleep(&[], POLL_PERIOD)?;
        }
        self.findings
            .require(Rule::CreatesNothing, !has_created(), || {
                "it creates topics that are missing: open them, so that the supervisor's sizes hold"
                    .to_owned()
            });
        Ok(process.kill()?)
    }

    /// One item at a time, while observers come and go and one never reads; then SIGTERM in the
    /// middle. The results must equal the results of the whole stream.
    fn steps(&mut self) -> Result<(), Failure> {
        let items = self.context.reference.end() * 2 / 3;
        let (mut session, true) = self.begin("steps", Pace::Single, u64::MAX)? else {
            return Ok(());
        };
        let output = session.output_topic();
        let never_read = session.harness.rig.tap(output)?;
        session.findings.checked(Rule::IgnoresObservers);
        for seq in 0..items {
            let waited = session.reach(seq)?;
            if !waited.is_done() {
                let sentence = format!(
                    "while observers came and went it sent nothing about item {seq}: {waited}"
                );
                session.findings.broken(Rule::IgnoresObservers, sentence);
                break;
            }
            if seq % BETWEEN == 0 {
                // The observer takes a message, if there is one, and leaves.
                let _ = session.harness.rig.tap(output)?.receive();
            }
        }
        // Items are on their way when the request comes.
        session.pace = Pace::Window;
        session.admit()?;
        session.stops("in the middle of the stream")?;
        drop(never_read);
        let when = "when the items come one at a time";
        Ok(session.compare(0.., Rule::Deterministic, when)?)
    }

    /// The time of its answers by the clock of this process: one item at a time, from when it is
    /// sent to when its answer is read. The stamps in the answers are the program's own. A source
    /// answers no item: it is asked for the next by a pose.
    fn timing(&mut self) -> Result<Option<Work>, Failure> {
        if self.stage() == StageId::RadarReplay {
            return Ok(None);
        }
        let end = self.context.reference.end();
        let (mut session, true) = self.begin("timing", Pace::Single, u64::MAX)? else {
            return Ok(None);
        };
        let waited = session.reach(end)?;
        session
            .findings
            .require(Rule::KeepsBudget, waited.is_done(), || {
                format!("it has not come to the end when the items come one at a time: {waited}")
            });
        Ok(Work::of((0..end).filter_map(|seq| session.answer_ns(seq))))
    }

    fn report(mut self, answers: Option<Work>) -> Result<Report, Failure> {
        let Context {
            test, reference, ..
        } = self.context;
        let (stage, topic) = (self.stage(), test.candidate.topics().output);
        let work = Work::of(work_on(stage, &self.outputs));
        if test.arguments.same_as_own && !self.outputs.is_empty() {
            for own in reference.topic(topic) {
                let seq = own.item().seq;
                let bytes = result_bytes(topic, own)?;
                let same = self.findings.first_results.get(&seq) == Some(&bytes);
                self.findings.require(Rule::SameAsOwn, same, || {
                    format!("item {seq} has different bytes from the item of our own stage")
                });
            }
        }
        if let Some(budget) = test.arguments.budget_ms {
            self.judge_times("by its own stamps", work, budget);
            self.judge_times("by our clock, until its answer,", answers, budget);
        }
        Ok(Report {
            stage: stage.name(),
            command: test.candidate.command.clone(),
            scans: reference.end() as usize,
            rules: self.findings.judged(),
            work,
            answers,
        })
    }

    fn judge_times(&mut self, clock: &str, times: Option<Work>, budget: Duration) {
        let Some(times) = times else {
            return;
        };
        let budget_ms = budget.as_secs_f64() * 1e3;
        let ((ms, figure), items) = (times.judged(), times.items);
        self.findings.require(Rule::KeepsBudget, ms <= budget_ms, || {
            format!("{clock} the {figure} of {items} items is {ms:.2} ms, and {budget_ms} ms are allowed")
        });
    }
}

fn work_on(stage: StageId, outputs: &[Recorded]) -> impl Iterator<Item = i64> {
    let items = outputs.iter().map(Recorded::item);
    let worked_on = items.filter(|it| !it.is(flag::END) && !it.is(flag::BASE));
    worked_on.map(move |it| work_ns(stage, &it))
}
