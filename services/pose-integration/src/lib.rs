//! The pose-integration stage: composes motions and their covariances to poses, and journals each pose before it is published.

mod compose;
pub mod journal;

use gyre_messages::{Item, Motion, MotionHeader, PoseHeader, Refined, StageId, flag};
use gyre_stage::{Launch, Sink, StageCounters, StageError, clock, sink};

pub use compose::compose;
use journal::Journal;

/// Runs the stage until SIGTERM.
///
/// # Errors
/// A journal that cannot be used, or an error of [`sink::run`].
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let path = journal::path(&launch.manifest.out);
    let (journal, records) =
        Journal::open(&path).map_err(|error| StageError::Input(error.to_string()))?;
    let mut integration = Integration {
        journal,
        records,
        last: None,
    };
    match launch.manifest.refines {
        true => sink::run::<Refined, _>(launch, &mut integration),
        false => sink::run::<Motion, _>(launch, &mut integration),
    }
}

struct Integration {
    journal: Journal,
    /// The content of the journal at the start.
    records: Vec<PoseHeader>,
    last: Option<PoseHeader>,
}

impl Sink for Integration {
    const HOP: StageId = StageId::PoseIntegration;

    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), StageError> {
        let mut poses = std::mem::take(&mut self.records);
        let ended = poses.pop_if(|last| last.item.is(flag::END)).is_some();
        self.last = poses.last().copied();
        poses.drain(..poses.len().saturating_sub(count));
        Ok((poses, ended))
    }

    fn integrate(&mut self, motion: &MotionHeader) -> Result<PoseHeader, StageError> {
        let mut pose = compose(self.last.as_ref(), motion);
        pose.item.hop_mut(Self::HOP).finished_ns = clock::now_ns();
        self.write(&pose)?;
        self.last = Some(pose);
        Ok(pose)
    }

    fn end(&mut self, item: &Item) -> Result<(), StageError> {
        self.write(&PoseHeader {
            item: Item {
                flags: flag::END,
                ..*item
            },
            ..PoseHeader::default()
        })
    }
}

impl Integration {
    fn write(&mut self, pose: &PoseHeader) -> Result<(), StageError> {
        self.journal
            .append(pose)
            .map_err(|error| StageError::Input(error.to_string()))
    }
}
