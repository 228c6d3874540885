//! Places of the drive that are seen again.

use std::convert::Infallible;

use gyre_geometry::{OdometryMotion, Pose, UncertainMotion};
use gyre_slam::{ClosingError, Keyframe, KeyframeBuilder, LoopCloser, SUBMAP_REACH_M, ScanPose};

use crate::{CalibrationError, Drive, Track};

#[derive(Clone, Copy, Debug)]
pub struct Revisit {
    pub later: usize,
    pub earlier: usize,
    /// The pose of the later scan in the frame of the earlier one.
    pub pose: Pose,
}

pub fn find(drive: &Drive, track: &Track) -> Result<Vec<Revisit>, CalibrationError> {
    let keyframes = keyframes(drive, track);
    let config = drive.config();
    let mut closer = LoopCloser::new(SUBMAP_REACH_M, &config.refinement, config.points.capacity)?;
    for keyframe in &keyframes {
        closer.push(keyframe).map_err(ClosingError::from)?;
    }
    closer.finish();
    let mut read = |index: usize| Ok::<_, Infallible>(keyframes[index].clone());
    while closer.describe(&mut read)?.is_some() {}
    let mut found = Vec::new();
    while let Some(query) = closer.close(&mut read)? {
        for (candidate, _) in query.loops() {
            found.push(Revisit {
                later: keyframes[query.keyframe].seq as usize,
                earlier: keyframes[candidate.place].seq as usize,
                pose: candidate.motion.motion,
            });
        }
    }
    Ok(found)
}

fn keyframes(drive: &Drive, track: &Track) -> Vec<Keyframe> {
    let mut builder = KeyframeBuilder::default();
    let mut pose = UncertainMotion::identity();
    let mut keyframes = Vec::new();
    for (scan, sweep) in drive.sweeps.iter().enumerate() {
        let motion = track.motions[scan];
        pose = pose.then(&motion).normalized();
        let made = builder.next(&ScanPose {
            seq: scan as u64,
            scan: scan as u64,
            stamp_ns: sweep.stamp_ns,
            pose,
            motion: OdometryMotion::independent(motion),
            interval_s: sweep.interval_s,
        });
        if let Some(mut keyframe) = made {
            keyframe.points = drive.points(scan, &track.change);
            keyframe.twist = track.twists[scan];
            keyframes.push(keyframe);
        }
    }
    keyframes
}
