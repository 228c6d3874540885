//! The pose-integration stage: composes motions and their covariances to poses, and journals each pose before it is published.

mod compose;
pub mod journal;

use gyre_messages::{Item, Motion, MotionHeader, PoseHeader, Refined, StageId, flag};
use gyre_stage::{Launch, Sink, StageCounters, StageError, clock, sink};

pub use compose::compose;
use journal::{Journal, JournalError};

/// Runs the stage until SIGTERM.
///
/// # Errors
/// A journal that cannot be used, or an error of [`sink::run`].
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let path = journal::path(&launch.manifest.out);
    let mut integration = Integration {
        journal: Journal::open(&path).map_err(unusable)?,
        last: None,
    };
    match launch.manifest.refines {
        true => sink::run::<Refined, _>(launch, &mut integration),
        false => sink::run::<Motion, _>(launch, &mut integration),
    }
}

struct Integration {
    journal: Journal,
    last: Option<PoseHeader>,
}

impl Sink for Integration {
    const HOP: StageId = StageId::PoseIntegration;

    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), StageError> {
        // One at least, to go on from.
        let (mut poses, ended) = self.journal.last(count.max(1)).map_err(unusable)?;
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
        self.journal.append(pose).map_err(unusable)
    }
}

fn unusable(error: JournalError) -> StageError {
    match error {
        // A process that was killed, and is not gone yet.
        JournalError::Busy { .. } => StageError::Transport {
            action: "open the journal".to_owned(),
            reason: error.to_string(),
        },
        _ => StageError::Input(error.to_string()),
    }
}
