//! The scenarios in which a program is tested, each in a run of its own.

mod absence;
mod feedback;
mod refusal;
mod restart;
mod standing_by;
mod steps;
mod stream;
mod timing;

use std::{collections::BTreeMap, time::Duration};

use gyre_messages::{StageId, flag};
use gyre_stage::wake::Signals;
use gyre_supervise::rig::Recorded;

use crate::{
    ConformanceError,
    content::{deviation, essence, work_ns},
    report::{Judged, Report, Work},
    rule::{Findings, Rule},
    session::{Session, Waited},
    subject::Subject,
    tape::Tape,
};

/// The test of one program.
pub(crate) struct Examination<'a> {
    subject: &'a Subject,
    tape: &'a Tape,
    signals: &'a Signals,
    observe: &'a mut dyn FnMut(&str),
    findings: Findings,
    /// What it sent in the first scenario.
    outputs: Vec<Recorded>,
    /// The bytes of it that its inputs determine, by item.
    reference: BTreeMap<u64, Vec<u8>>,
}

impl<'a> Examination<'a> {
    pub(crate) fn new(
        subject: &'a Subject,
        tape: &'a Tape,
        signals: &'a Signals,
        observe: &'a mut dyn FnMut(&str),
    ) -> Self {
        Self {
            subject,
            tape,
            signals,
            observe,
            findings: Findings::default(),
            outputs: Vec::new(),
            reference: BTreeMap::new(),
        }
    }

    /// Runs all scenarios. If the program does not get through the first, the others could say nothing.
    pub(crate) fn run(mut self) -> Result<Report, ConformanceError> {
        self.note_what_does_not_apply();
        (self.observe)("a start without topics");
        self.start_without_topics()?;
        (self.observe)("a whole stream");
        let has_streamed = self.stream()?;
        if has_streamed {
            (self.observe)("one item at a time, with observers");
            self.steps()?;
            (self.observe)("kill -9");
            self.restart()?;
            if self.subject.stage == StageId::Masking {
                (self.observe)("feedback");
                self.feedback()?;
            }
            if self.subject.stage == StageId::RadarReplay {
                (self.observe)("a full window");
                self.window()?;
            }
            (self.observe)("standing by");
            self.standing_by()?;
            self.refusals()?;
        }
        let answers = match self.subject.demands.budget.is_some() && has_streamed {
            true => {
                (self.observe)("the time of its answers");
                self.timing()?
            }
            false => None,
        };
        let own_work = match self.is_own() || !has_streamed {
            true => None,
            false => self.own_work()?,
        };
        self.report(answers, own_work)
    }

    fn is_own(&self) -> bool {
        self.subject.command == self.subject.own(self.subject.stage)
    }

    fn note_what_does_not_apply(&mut self) {
        let findings = &mut self.findings;
        let stage = self.subject.stage;
        if stage == StageId::RadarReplay {
            findings.not_for(Rule::CopiesItem, "a source makes the items");
        } else {
            findings.not_for(Rule::KeepsWindow, "it is no source");
        }
        if stage != StageId::Masking {
            findings.not_for(Rule::WaitsForMotion, "it is not masking");
        } else if self.subject.manifest.window.lag == 0 {
            findings.not_for(Rule::WaitsForMotion, "masking.lag is 0");
        }
        if stage != StageId::PoseIntegration {
            findings.not_for(Rule::BeginsWithNewest, "it is not the sink");
        }
        if !self.subject.demands.same_as_own {
            findings.not_for(Rule::SameAsOwn, "not asked for");
        }
        if self.subject.demands.budget.is_none() {
            findings.not_for(Rule::KeepsBudget, "not asked for");
        }
    }

    /// Measures Gyre's own stage on the same inputs.
    fn own_work(&mut self) -> Result<Option<Work>, ConformanceError> {
        (self.observe)("our own stage on the same inputs");
        let stage = self.subject.stage;
        let rig = self.subject.rig(self.signals, "measured")?;
        let mut scratch = Findings::default();
        let mut session = Session::open(self.subject, &rig, self.tape, &mut scratch)?;
        session.start(&self.subject.own(stage))?;
        let (patience, end) = (self.subject.demands.patience, self.tape.end());
        match session.wait(patience, |session| session.newest() >= Some(end))? {
            Waited::Done => Ok(Work::of(work_on(stage, &session.outputs))),
            other => Err(ConformanceError::Own {
                stage: stage.name(),
                reason: how(&other),
            }),
        }
    }

    fn report(
        mut self,
        answers: Option<Work>,
        own_work: Option<Work>,
    ) -> Result<Report, ConformanceError> {
        let (subject, topic) = (self.subject, self.subject.ports().output);
        let work = Work::of(work_on(subject.stage, &self.outputs));
        let own = self.tape.topic(topic);
        if subject.demands.same_as_own && !self.outputs.is_empty() {
            self.compare_with_own(topic, own)?;
        }
        if let Some(budget) = subject.demands.budget {
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
            stage: subject.stage.name(),
            command: subject.command.clone(),
            scans: self.tape.end() as usize,
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

    fn compare_with_own(&mut self, topic: &str, own: &[Recorded]) -> Result<(), ConformanceError> {
        for own in own {
            let seq = own.item().seq;
            let same = self.reference.get(&seq) == Some(&essence(topic, own)?);
            self.findings.require(Rule::SameAsOwn, same, || {
                format!("item {seq} has other bytes than that of our own stage")
            });
        }
        Ok(())
    }
}

/// The times of a stage's work on items as it stamps them, ns.
fn work_on(stage: StageId, outputs: &[Recorded]) -> impl Iterator<Item = i64> {
    let is_worked_on = |it: &&Recorded| !it.item().is(flag::END) && !it.item().is(flag::BASE);
    let outputs = outputs.iter().filter(is_worked_on);
    outputs.map(move |it| work_ns(stage, it))
}

/// Notes each item whose bytes are not those of the first scenario.
fn compare(
    session: &mut Session<'_>,
    reference: &BTreeMap<u64, Vec<u8>>,
    outputs: std::ops::Range<usize>,
    rule: Rule,
    when: &str,
) -> Result<(), ConformanceError> {
    session.findings.checked(rule);
    for i in outputs {
        let output = &session.outputs[i];
        let item = output.item();
        if item.is(flag::BASE) {
            continue;
        }
        let bytes = essence(session.ports.output, output)?;
        if reference
            .get(&item.seq)
            .is_some_and(|known| *known != bytes)
        {
            let sentence = format!("item {} has other bytes {when}", item.seq);
            session.findings.broken(rule, sentence);
        }
    }
    Ok(())
}

/// Says why a wait ended in vain.
fn how(waited: &Waited) -> String {
    match waited {
        Waited::Done => "it did".to_owned(),
        Waited::Died(death) => death.to_string(),
        Waited::TimedOut => "it lives and sends nothing".to_owned(),
    }
}
