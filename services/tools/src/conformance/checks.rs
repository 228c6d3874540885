//! The scenarios of a test, each in a run of its own.

mod absence;
mod feedback;
mod refusal;
mod restart;
mod standing_by;
mod steps;
mod stream;
mod timing;

use std::{collections::BTreeMap, time::Duration};

use gyre_messages::{Item, StageId, flag};
use gyre_supervise::rig::Recorded;

use crate::conformance::{
    ProgramError,
    item::work_ns,
    reference::Context,
    report::{Judged, Report, Work},
    result::{Differences, result_bytes},
    rule::{Findings, Rule},
    session::Session,
};

/// The test of one program.
pub(crate) struct Examination<'a> {
    context: Context<'a>,
    observe: &'a mut dyn FnMut(&str),
    findings: Findings,
    /// The messages of the first scenario.
    outputs: Vec<Recorded>,
    /// Their result bytes, by item.
    first_results: BTreeMap<u64, Vec<u8>>,
}

impl<'a> Examination<'a> {
    pub(crate) fn new(context: Context<'a>, observe: &'a mut dyn FnMut(&str)) -> Self {
        Self {
            context,
            observe,
            findings: Findings::default(),
            outputs: Vec::new(),
            first_results: BTreeMap::new(),
        }
    }

    fn stage(&self) -> StageId {
        self.context.test.candidate.stage
    }

    /// Runs all scenarios. If the program does not complete the first, the others would show
    /// nothing.
    pub(crate) fn run(mut self) -> Result<Report, ProgramError> {
        self.note_inapplicable_rules();
        (self.observe)("a start without topics");
        self.start_without_topics()?;
        (self.observe)("a whole stream");
        if !self.stream()? {
            return self.report(None, None);
        }
        (self.observe)("one item at a time, with observers");
        self.steps()?;
        (self.observe)("kill -9");
        self.restart()?;
        if self.stage() == StageId::Masking {
            (self.observe)("feedback");
            self.feedback()?;
        }
        if self.stage() == StageId::RadarReplay {
            (self.observe)("a full window");
            self.window()?;
        }
        (self.observe)("standing by");
        self.standing_by()?;
        self.refusals()?;
        let mut answers = None;
        if self.context.test.demands.budget.is_some() {
            (self.observe)("the time of its answers");
            answers = self.timing()?;
        }
        let own_work = self.own_work()?;
        self.report(answers, own_work)
    }

    fn note_inapplicable_rules(&mut self) {
        let (stage, demands) = (self.stage(), &self.context.test.demands);
        let lag = self.context.test.candidate.manifest.window.lag;
        let is_source = stage == StageId::RadarReplay;
        let is_masking = stage == StageId::Masking;
        let inapplicable = [
            (is_source, Rule::CopiesItem, "a source makes the items"),
            (!is_source, Rule::KeepsWindow, "it is no source"),
            (!is_masking, Rule::WaitsForMotion, "it is not masking"),
            (lag == 0, Rule::WaitsForMotion, "masking.lag is 0"),
            (
                stage != StageId::PoseIntegration,
                Rule::BeginsWithNewest,
                "it is not the sink",
            ),
            (!demands.same_as_own, Rule::SameAsOwn, "not asked for"),
            (demands.budget.is_none(), Rule::KeepsBudget, "not asked for"),
        ];
        for (_, rule, reason) in inapplicable.into_iter().filter(|it| it.0) {
            self.findings.not_for(rule, reason);
        }
    }

    /// Measures Gyre's own stage on the same inputs, unless it is the program.
    fn own_work(&mut self) -> Result<Option<Work>, ProgramError> {
        let (stage, candidate) = (self.stage(), &self.context.test.candidate);
        let own = candidate.own_command(stage);
        if candidate.command == own {
            return Ok(None);
        }
        (self.observe)("our own stage on the same inputs");
        let mut scratch = Findings::default();
        let mut session = Session::open(self.context, "measured", &mut scratch)?;
        session.start(&own)?;
        let waited = session.reach(self.context.reference.end())?;
        match waited.is_done() {
            true => Ok(Work::of(work_on(stage, &session.outputs))),
            false => Err(ProgramError::Own {
                stage: stage.name(),
                reason: waited.to_string(),
            }),
        }
    }

    fn report(
        mut self,
        answers: Option<Work>,
        own_work: Option<Work>,
    ) -> Result<Report, ProgramError> {
        let Context {
            test, reference, ..
        } = self.context;
        let (stage, topic) = (self.stage(), test.candidate.topics().output);
        let work = Work::of(work_on(stage, &self.outputs));
        let own = reference.topic(topic);
        if test.demands.same_as_own && !self.outputs.is_empty() {
            self.compare_with_own(topic, own)?;
        }
        if let Some(budget) = test.demands.budget {
            self.judge_times("by its own stamps", work, budget);
            self.judge_times("by our clock, until its answer,", answers, budget);
        }
        let deviation = match self.outputs.is_empty() {
            true => None,
            false => Some(deviation(topic, own, &self.outputs)?),
        };
        let judged = |(rule, verdict): (Rule, _)| Judged {
            rule,
            section: rule.section(),
            says: rule.says(),
            verdict,
        };
        Ok(Report {
            stage: stage.name(),
            command: test.candidate.command.clone(),
            scans: reference.end() as usize,
            rules: self.findings.verdicts().into_iter().map(judged).collect(),
            work,
            answers,
            own_work,
            deviation,
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

    fn compare_with_own(&mut self, topic: &str, own: &[Recorded]) -> Result<(), ProgramError> {
        for own in own {
            let seq = own.item().seq;
            let same = self.first_results.get(&seq) == Some(&result_bytes(topic, own)?);
            self.findings.require(Rule::SameAsOwn, same, || {
                format!("item {seq} has other bytes than that of our own stage")
            });
        }
        Ok(())
    }
}

/// Returns the times of a stage's work on items by its own stamps, ns.
fn work_on(stage: StageId, outputs: &[Recorded]) -> impl Iterator<Item = i64> {
    let items = outputs.iter().map(Recorded::item);
    let worked_on = items.filter(|it: &Item| !it.is(flag::END) && !it.is(flag::BASE));
    worked_on.map(move |it| work_ns(stage, &it))
}

/// Returns a sentence with the difference between results and the results of Gyre's own stage.
/// Items that one of them lacks are left out.
fn deviation(topic: &str, own: &[Recorded], other: &[Recorded]) -> Result<String, ProgramError> {
    let (mut items, mut equal, mut differences) = (0, 0, Differences::default());
    for own in own.iter().filter(|own| !own.item().is(flag::END)) {
        let seq = own.item().seq;
        let is_same = |it: &&Recorded| it.item().seq == seq && !it.item().is(flag::BASE);
        let Some(other) = other.iter().find(is_same) else {
            continue;
        };
        items += 1;
        match result_bytes(topic, own)? == result_bytes(topic, other)? {
            true => equal += 1,
            false => drop(differences.add(topic, own, other)?),
        }
    }
    let same = format!("{equal} of {items} items are the same bytes");
    let rows = differences.spreads().rows();
    Ok([vec![same], rows].concat().join("\n                 "))
}
