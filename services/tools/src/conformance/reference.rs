//! The inputs: the results of Gyre's own stages for the scans. The stages run as in a pipeline,
//! before a sink that is part of this process and loses nothing.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use gyre_client::{RunError, Signals, TopicWriter};
use gyre_configuration::terminal::{Failure, own};
use gyre_contract::{
    Item, Message, Motion, Pose, PoseHeader, StageId, StageTopics, compose, flag, run::StageConfig,
};
use gyre_supervise::rig::{Process, Recorded, Rig, Tap};

use crate::conformance::{Test, harness::start_of_trajectory};

/// Time between two polls of what does not wake the tester.
pub(crate) const POLL_PERIOD: Duration = Duration::from_millis(2);

/// The messages of a whole run by topic: item after item, then the end of the stream.
#[derive(Debug, Default)]
pub(crate) struct Reference(BTreeMap<&'static str, Vec<Recorded>>);

impl Reference {
    /// Returns the message of a topic about item `seq`; the message after the last item is the end.
    pub(crate) fn get(&self, topic: &str, seq: u64) -> Option<&Recorded> {
        self.0.get(topic)?.get(seq as usize)
    }

    pub(crate) fn topic(&self, topic: &str) -> &[Recorded] {
        self.0.get(topic).map_or(&[], Vec::as_slice)
    }

    /// Returns the number of the item that ends the stream, which is the number of scans.
    pub(crate) fn end(&self) -> u64 {
        self.topic(Pose::TOPIC).len().saturating_sub(1) as u64
    }

    pub(crate) fn compute(test: &Test<'_>, signals: &Signals) -> Result<Self, Failure> {
        let mut rig = test.rig("own", signals)?;
        rig.create_services()?;
        let mut reference = OwnPipeline::begin(test, &rig)?.run()?;
        let scans = reference.end();
        if scans < 2 {
            return Err(format!("{scans} scans are too few to test a stage with: name a recording of more, or raise --scans").into());
        }
        for message in reference.0.values_mut().flatten() {
            // Any but 0, which a stage may write that does not copy it.
            let generation = 1;
            let item = message.item();
            *message = message.about(&Item { generation, ..item });
        }
        Ok(reference)
    }

    fn push(&mut self, topic: &'static str, message: Recorded) {
        self.0.entry(topic).or_default().push(message);
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub test: &'a Test<'a>,
    pub reference: &'a Reference,
    pub signals: &'a Signals,
}

struct OwnPipeline<'a> {
    // Dropped in this order: processes, ports, run.
    processes: Vec<(StageId, Process)>,
    poses: TopicWriter,
    taps: Vec<(&'static str, Tap)>,
    rig: &'a Rig<'a>,
    /// Time without progress after which it has failed.
    stall_timeout: Duration,
    reference: Reference,
}

impl<'a> OwnPipeline<'a> {
    fn begin(test: &Test<'_>, rig: &'a Rig<'a>) -> Result<Self, Failure> {
        let manifest = rig.manifest();
        let mut stages = test.stages.clone();
        stages.retain(|it| *it != StageId::PoseIntegration);
        let mut taps = Vec::new();
        for stage in &stages {
            let topic = StageTopics::of(*stage, &manifest.window, manifest.refines).output;
            taps.push((topic, rig.tap(topic)?));
        }
        let poses = rig.feed(Pose::TOPIC)?;
        start_of_trajectory().send(&poses)?;
        let (gyre, mut processes) = (own().display().to_string(), Vec::new());
        for stage in stages {
            let command = StageConfig::own_command(&gyre, stage.name(), None);
            let scheduling = &test.candidate.scheduling;
            let process = rig.start(stage.name(), &command, scheduling, false)?;
            processes.push((stage, process));
        }
        Ok(Self {
            processes,
            poses,
            taps,
            rig,
            stall_timeout: test.arguments.start_timeout_s,
            reference: Reference::default(),
        })
    }

    fn run(mut self) -> Result<Reference, Failure> {
        let mut progress = Instant::now();
        while !self.has_ended() {
            self.poses.answer_handshakes()?;
            if self.receive()? | self.integrate()? {
                progress = Instant::now();
            } else {
                self.require_living(progress.elapsed())?;
                let taps: Vec<&Tap> = self.taps.iter().map(|(_, tap)| tap).collect();
                self.rig.sleep(&taps, POLL_PERIOD)?;
            }
        }
        Ok(self.reference)
    }

    fn has_ended(&self) -> bool {
        let has_end = |topic| {
            let last = self.reference.topic(topic).last();
            last.is_some_and(|last| last.item().is(flag::END))
        };
        has_end(Pose::TOPIC) && self.taps.iter().all(|(topic, _)| has_end(topic))
    }

    fn receive(&mut self) -> Result<bool, RunError> {
        let mut any = false;
        for (topic, tap) in &self.taps {
            while let Some(message) = Recorded::receive(tap)? {
                self.reference.push(topic, message);
                any = true;
            }
        }
        Ok(any)
    }

    /// Publishes the pose of an item that all stages have answered; returns whether there was one.
    fn integrate(&mut self) -> Result<bool, RunError> {
        let poses = self.reference.topic(Pose::TOPIC);
        let next = poses.len() as u64;
        let answers = self.taps.iter();
        let answers = answers.map(|(topic, _)| self.reference.get(topic, next));
        let Some(answers) = answers.collect::<Option<Vec<_>>>() else {
            return Ok(false);
        };
        // Poses are composed of the motions of the last stage.
        let Some(motion) = answers.last() else {
            return Ok(false);
        };
        let motion = motion.header::<Motion>()?;
        let mut pose = PoseHeader {
            item: motion.item,
            ..PoseHeader::default()
        };
        if !motion.item.is(flag::END) {
            let last = poses.last().map(Recorded::header::<Pose>).transpose()?;
            pose = compose(last.as_ref(), &motion);
            pose.item.flags |= flag::SYNC;
        }
        let pose = Recorded::of::<Pose>(&pose, &[], 0);
        pose.send(&self.poses)?;
        self.reference.push(Pose::TOPIC, pose);
        Ok(true)
    }

    fn require_living(&mut self, idle: Duration) -> Result<(), Failure> {
        let processes = self.processes.iter_mut();
        let mut dead = processes.filter_map(|(stage, it)| Some((stage.name(), it.death()?)));
        let (name, reason) = match dead.next() {
            Some((stage, death)) => (stage, death.last_output.unwrap_or(death.cause)),
            None if idle < self.stall_timeout => return Ok(()),
            None => ("pipeline", format!("it made no progress for {idle:.0?}")),
        };
        Err(format!("cannot compute the inputs: our own {name} ended: {reason}").into())
    }
}
