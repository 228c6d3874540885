//! The topics of each stage.

use crate::{
    Masked, Message, Motion, Pose, Refined, Rotation, Scan, StageId, Topic, limits::Window,
};

/// The topics that a stage reads and sends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageTopics {
    /// The inputs that lead down the stream: item `seq` is sent for the stage to answer with its
    /// item `seq`. The last one comes from farthest down the stream.
    pub forward: Vec<&'static str>,
    /// The inputs that lead back to an earlier stage: item `seq` is sent after the stage has
    /// answered it.
    pub feedback: Vec<&'static str>,
    pub output: &'static str,
}

impl StageId {
    /// Returns the stages between source and sink, which are functions of their inputs.
    pub fn between() -> impl Iterator<Item = Self> {
        let is_end = |it: &Self| matches!(it, Self::RadarReplay | Self::PoseIntegration);
        Self::ALL.into_iter().filter(move |it| !is_end(it))
    }
}

/// Returns the topic whose motions are composed to poses, in a run with refinement or without.
pub fn composed(refines: bool) -> &'static Topic {
    match refines {
        true => Refined::ENTRY,
        false => Motion::ENTRY,
    }
}

impl StageTopics {
    pub fn of(stage: StageId, window: &Window, refines: bool) -> Self {
        const SCAN: &str = Scan::TOPIC;
        const MASKED: &str = Masked::TOPIC;
        const MOTION: &str = Motion::TOPIC;
        let motions = composed(refines).name;
        let mut feedback = Vec::new();
        let (forward, output) = match stage {
            StageId::RadarReplay => {
                feedback = vec![Pose::TOPIC];
                (vec![], SCAN)
            }
            StageId::Masking => {
                feedback = vec![MOTION, Pose::TOPIC];
                (vec![SCAN], MASKED)
            }
            StageId::RotationSearch => (vec![MASKED], Rotation::TOPIC),
            StageId::TranslationSearch => (vec![MASKED, Rotation::TOPIC], MOTION),
            StageId::JointSearch => (vec![MASKED], MOTION),
            StageId::Refinement => (vec![MASKED, MOTION], Refined::TOPIC),
            StageId::PoseIntegration if window.slam => (vec![MASKED, motions], Pose::TOPIC),
            StageId::PoseIntegration => (vec![motions], Pose::TOPIC),
        };
        Self {
            forward,
            feedback,
            output,
        }
    }

    pub fn inputs(&self) -> impl Iterator<Item = &'static str> {
        self.forward.iter().chain(&self.feedback).copied()
    }

    /// Returns the topic whose items the stage copies; `None` for a source.
    pub fn copied(&self) -> Option<&'static str> {
        self.forward.last().copied()
    }
}
