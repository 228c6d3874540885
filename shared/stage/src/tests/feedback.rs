//! What masking learns of motions does not depend on who tells it first.

use gyre_messages::{Header, Item, Message, Motion, MotionEstimate, Pose, SearchedMotion, Stage};

use super::{Run, node, writer};
use crate::{feedback::Feedback, writer::Writer};

const SEARCHED: SearchedMotion = SearchedMotion {
    x_m: 1.5,
    y_m: -0.25,
    yaw_rad: 0.125,
    interval_ns: 250_000_000,
};

/// A motion that was searched as above, and then moved to `x_m`.
fn refined_to(x_m: f64) -> MotionEstimate {
    let SearchedMotion {
        x_m: searched_x_m,
        y_m,
        yaw_rad,
        interval_ns,
    } = SEARCHED;
    MotionEstimate {
        x_m,
        searched: [searched_x_m, y_m, yaw_rad],
        interval_ns,
        ..MotionEstimate::default()
    }
}

fn send<M: Message>(writer: &Writer<M>, seq: u64, stage: Stage, fill: impl FnOnce(&mut M::Header)) {
    let mut draft = writer.loan().unwrap();
    fill(draft.header());
    *draft.header().item_mut() = Item {
        seq,
        ..Item::default()
    };
    writer.send(draft, stage).unwrap();
}

#[test]
fn a_motion_is_the_searched_one_whether_it_comes_at_once_or_refined_with_its_pose() {
    let run = Run::new();
    let mut feedback = Feedback::open(&node(&run.manifest)).unwrap();
    let (motions, poses) = (
        writer::<Motion>(&run.manifest),
        writer::<Pose>(&run.manifest),
    );
    let motion = |seq| {
        send(&motions, seq, Stage::TranslationSearch, |header| {
            header.motion = refined_to(SEARCHED.x_m)
        });
    };
    let pose = |seq| {
        send(&poses, seq, Stage::PoseIntegration, |header| {
            header.motion = refined_to(1.75)
        })
    };
    motion(1);
    pose(2);
    feedback.update().unwrap();
    assert_eq!(
        (feedback.motion(1), feedback.motion(2)),
        (Some(Some(SEARCHED)), Some(Some(SEARCHED)))
    );
    pose(1);
    motion(2);
    feedback.update().unwrap();
    assert_eq!(
        (feedback.motion(1), feedback.motion(2)),
        (Some(Some(SEARCHED)), Some(Some(SEARCHED)))
    );
    assert_eq!(
        (feedback.motion(3), feedback.newest_pose()),
        (None, Some(2))
    );
}
