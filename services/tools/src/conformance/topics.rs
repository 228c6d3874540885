//! The topics of each stage.

use gyre_messages::{Masked, Message, Motion, Pose, Refined, Rotation, Scan, StageId, TopicSizes};
use gyre_stage::Manifest;

/// The direction of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// Down the stream: item `seq` is sent for the stage to answer with its item `seq`.
    Forward,
    /// Back to an earlier stage: item `seq` is sent after the stage has answered it.
    Feedback,
}

/// The topics of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StageTopics {
    /// The topics that it may subscribe to. Of several that lead
    /// forward, the last comes from farthest down the stream.
    pub inputs: Vec<(&'static str, Direction)>,
    /// The topic that it publishes.
    pub output: &'static str,
    /// The sizes of that topic's queues.
    pub sizes: TopicSizes,
}

impl StageTopics {
    /// The topics of a stage in a run with this manifest.
    pub(crate) fn of(stage: StageId, manifest: &Manifest) -> Self {
        use Direction::{Feedback, Forward};
        let motions = match manifest.refines {
            true => Refined::TOPIC,
            false => Motion::TOPIC,
        };
        let (inputs, output) = match stage {
            StageId::RadarReplay => (vec![(Pose::TOPIC, Feedback)], Scan::TOPIC),
            StageId::Masking => (
                vec![
                    (Scan::TOPIC, Forward),
                    (Motion::TOPIC, Feedback),
                    (Pose::TOPIC, Feedback),
                ],
                Masked::TOPIC,
            ),
            StageId::RotationSearch => (vec![(Masked::TOPIC, Forward)], Rotation::TOPIC),
            StageId::TranslationSearch => (
                vec![(Masked::TOPIC, Forward), (Rotation::TOPIC, Forward)],
                Motion::TOPIC,
            ),
            StageId::JointSearch => (vec![(Masked::TOPIC, Forward)], Motion::TOPIC),
            StageId::Refinement => (
                vec![(Masked::TOPIC, Forward), (Motion::TOPIC, Forward)],
                Refined::TOPIC,
            ),
            StageId::PoseIntegration if manifest.window.slam => (
                vec![(Masked::TOPIC, Forward), (motions, Forward)],
                Pose::TOPIC,
            ),
            StageId::PoseIntegration => (vec![(motions, Forward)], Pose::TOPIC),
        };
        let topics = gyre_messages::topics(&manifest.window);
        let sizes = topics.into_iter().find(|topic| topic.name == output);
        Self {
            sizes: sizes.map_or_else(
                || Pose::sizes(&manifest.window),
                |topic| (topic.sizes)(&manifest.window),
            ),
            inputs,
            output,
        }
    }

    /// Returns the inputs that lead in this direction.
    pub(crate) fn leading(
        &self,
        direction: Direction,
    ) -> impl Iterator<Item = &'static str> + use<> {
        let inputs = self.inputs.clone();
        inputs
            .into_iter()
            .filter(move |(_, its)| *its == direction)
            .map(|(topic, _)| topic)
    }

    /// Returns the topic whose items the stage copies; `None` for a source.
    pub(crate) fn copied(&self) -> Option<&'static str> {
        self.leading(Direction::Forward).last()
    }
}
