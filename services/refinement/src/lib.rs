//! Refines the motions that the search found against a map of the last keyframes.

pub mod checkpoint;

use gyre_geometry::{SparsePoint, UncertainMotion, covariance::pack, pose};
use gyre_messages::{
    Item, Masked, MaskedHeader, Motion, MotionEstimate, Refined, Refinement as Record, flag,
    hypothesis, outcome,
};
use gyre_radar::PointsConfig;
use gyre_scan_matching::{InitialGuess, Outcome, RefinementConfig, Refiner};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    inputs::{Joined, JoinedView},
    reader::Received,
    stage,
    writer::Draft,
};

use checkpoint::{Checkpoint, CheckpointError};

/// The stage's name.
pub const NAME: &str = "refinement";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let points: PointsConfig = launch.section("points")?;
    let config: RefinementConfig = launch.section("refinement")?;
    let refinement = Refiner::new(&config, points.capacity)
        .map_err(|error| StageError::Configuration(error.to_string()))?;
    let manifest = &launch.manifest;
    let path = checkpoint::path(&manifest.out);
    let window = manifest.window.scans + manifest.window.look_back;
    let checkpoint = Checkpoint::open(&path, window, config.keyframes, refinement.keyframe_cells())
        .map_err(unusable)?;
    stage::run(
        launch,
        &mut Refining {
            refinement,
            checkpoint,
            next: None,
        },
    )
}

/// The stage: the refinement, and the file that keeps what it knows.
struct Refining {
    refinement: Refiner,
    checkpoint: Checkpoint,
    /// The item that what the refinement knows is for; `None` after a start.
    next: Option<u64>,
}

impl Stage for Refining {
    type Inputs = Joined<Masked, Motion>;
    type Output = Refined;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::Refinement;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Motion>,
        output: &mut Draft<Refined>,
    ) -> Result<(), StageError> {
        let item = *input.current.item();
        let motion = input.other.header().motion;
        self.stand_before(&item)?;
        output.header().motion = match input.before {
            Some(before) if !item.is(flag::BREAK) => refine(
                &mut self.refinement,
                item.seq,
                points(input.current)?,
                points(before)?,
                &motion,
            ),
            _ => motion,
        };
        self.next = Some(item.seq.saturating_add(1));
        self.checkpoint
            .write(item.seq, &self.refinement)
            .map_err(unusable)
    }
}

impl Refining {
    /// Makes the refinement know what it has to before this item.
    fn stand_before(&mut self, item: &Item) -> Result<(), StageError> {
        if item.is(flag::BREAK) {
            self.refinement.reset();
        } else if self.next != Some(item.seq) {
            self.checkpoint
                .restore(item.seq.saturating_sub(1), &mut self.refinement)
                .map_err(unusable)?;
        }
        Ok(())
    }
}

/// The motion as it is after refinement. The search's own findings stay in it.
pub fn refine(
    refinement: &mut Refiner,
    seq: u64,
    later: &[SparsePoint],
    earlier: &[SparsePoint],
    motion: &MotionEstimate,
) -> MotionEstimate {
    let searched = pose(motion.x_m, motion.y_m, motion.yaw_rad);
    let refined = refinement.refine(
        seq,
        later,
        earlier,
        &searched,
        motion.interval_ns as f64 * 1e-9,
    );
    let UncertainMotion {
        motion: refined_pose,
        covariance,
    } = &refined.motion;
    MotionEstimate {
        x_m: refined_pose.translation.x,
        y_m: refined_pose.translation.y,
        yaw_rad: refined_pose.rotation.angle(),
        covariance: pack(covariance),
        refinement: Record {
            outcome: match refined.outcome {
                Outcome::Refined => outcome::REFINED,
                Outcome::Weak => outcome::WEAK,
                Outcome::Predicted => outcome::PREDICTED,
            },
            hypothesis: match refined.guess {
                InitialGuess::Prediction => hypothesis::PREDICTION,
                InitialGuess::Search => hypothesis::SEARCH,
                InitialGuess::YawOffset => hypothesis::FAN,
            },
            overlap: refined.overlap,
            support: refined.support,
        },
        ..*motion
    }
}

fn points(masked: &Received<Masked>) -> Result<&[SparsePoint], StageError> {
    let header: &MaskedHeader = masked.header();
    header
        .points(masked.values())
        .ok_or_else(|| masked.malformed("its points do not fit its header"))
}

fn unusable(error: CheckpointError) -> StageError {
    StageError::Input(error.to_string())
}
