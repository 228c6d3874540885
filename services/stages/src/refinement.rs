//! The refinement stage: registers the searched motions against a map of the last keyframes.

use gyre_contract::{Item, Masked, Motion, Refined, StageId, flag, run::StageCounters};
use gyre_journal::{
    checkpoint::{self, Checkpoint},
    continue_when_full,
};
use gyre_matching::{RefinementConfig, Refiner, Searched};
use gyre_radar::PointsConfig;
use gyre_stage::{
    Launch, Stage,
    inputs::{Joined, JoinedView},
    sink, stage,
};
use gyre_transport::{Manifest, RunError, writer::Draft};

use crate::{estimates, points, unusable};

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let points: PointsConfig = launch.section("points")?;
    let config: RefinementConfig = launch.section("refinement")?;
    let refiner = Refiner::new(&config, &launch.sensors()?, points.capacity);
    let refiner = refiner.map_err(RunError::input)?;
    launch.take_place()?;
    let manifest = &launch.manifest;
    if manifest.live {
        continue_when_full();
    }
    let path = checkpoint::path(&manifest.out);
    let window = manifest.window.scans + manifest.window.look_back;
    let checkpoint = Checkpoint::open(&path, window, config.keyframes, refiner.keyframe_cells())
        .map_err(unusable)?;
    let mut stage = RefinementStage {
        manifest: manifest.clone(),
        refiner,
        checkpoint,
        next: None,
    };
    stage::run(launch, &mut stage)
}

struct RefinementStage {
    manifest: Manifest,
    refiner: Refiner,
    checkpoint: Checkpoint,
    /// The item that the refiner expects next; `None` after a start.
    next: Option<u64>,
}

impl Stage for RefinementStage {
    type Inputs = Joined<Masked, Motion>;
    type Output = Refined;
    const HOP: StageId = StageId::Refinement;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Motion>,
        output: &mut Draft<Refined>,
    ) -> Result<(), RunError> {
        let (item, motion) = (*input.pair.current.item(), input.other.header().motion);
        self.restore_state_before(&item)?;
        output.header().motion = match input.pair.previous {
            Some(previous) if !item.is(flag::BREAK) => {
                let (masked, before) = (input.pair.current.header(), previous.header());
                let refined = self.refiner.refine(&Searched {
                    scan: item.seq,
                    later: points(input.pair.current)?,
                    earlier: points(previous)?,
                    motion: motion.motion().motion,
                    interval_s: motion.interval_ns as f64 * 1e-9,
                    azimuth_variance_rad2: before.azimuth_variance_rad2
                        + masked.azimuth_variance_rad2,
                    evidence: [&before.evidence, &masked.evidence],
                });
                estimates::refined(&motion, &refined)
            }
            _ => motion,
        };
        self.next = Some(item.seq.saturating_add(1));
        let motion = checkpoint::checksum(&output.header().motion);
        self.checkpoint
            .write(item.seq, motion, &self.refiner)
            .map_err(unusable)
    }
}

impl RefinementStage {
    fn restore_state_before(&mut self, item: &Item) -> Result<(), RunError> {
        let starts_chain = item.is(flag::BREAK);
        if self.next != Some(item.seq) {
            let before = item.seq.saturating_sub(1);
            let restored = self.checkpoint.restore(before, &mut self.refiner);
            // A chain continues only with the filters of other sensors, which the first chain
            // lacks.
            restored.or_else(|error| match (starts_chain, sink::notice(&self.manifest)) {
                (true, _) => Ok(()),
                // The process before held the state in memory.
                (false, Some(notice)) => {
                    let loss = format!("{notice}; the refinement has died meanwhile");
                    Err(sink::poses_lost(&self.manifest, loss))
                }
                (false, None) => Err(unusable(error)),
            })?;
        }
        if starts_chain {
            self.refiner.reset();
        }
        Ok(())
    }
}
