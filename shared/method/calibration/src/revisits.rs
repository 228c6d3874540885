//! Places of the drive that are seen again.

use std::convert::Infallible;

use gyre_geometry::{OdometryMotion, Pose, UncertainMotion};
use gyre_slam::{
    ClosingError, Keyframe, KeyframeBuilder, KeyframeSource, LoopCloser, SUBMAP_REACH_M, ScanPose,
};

use crate::{CalibrationError, Drive, Track};

#[derive(Clone, Copy, Debug)]
pub struct Revisit {
    pub later: usize,
    pub earlier: usize,
    /// The pose of the later scan in the frame of the earlier one.
    pub pose: Pose,
}

struct Keyframes(Vec<Keyframe>);

impl KeyframeSource for &Keyframes {
    type Error = Infallible;

    fn keyframe(&mut self, index: usize) -> Result<Keyframe, Infallible> {
        Ok(self.0[index].clone())
    }
}

pub fn find(drive: &Drive, track: &Track) -> Result<Vec<Revisit>, CalibrationError> {
    let keyframes = Keyframes(keyframes(drive, track));
    let config = drive.config();
    let mut closer = LoopCloser::new(SUBMAP_REACH_M, &config.refinement, config.points.capacity)?;
    for keyframe in &keyframes.0 {
        closer.push(keyframe).map_err(ClosingError::from)?;
    }
    closer.finish();
    let mut source = &keyframes;
    while closer.describe(&mut source)?.is_some() {}
    let mut found = Vec::new();
    while let Some(query) = closer.close(&mut source)? {
        for (candidate, _) in query.loops() {
            found.push(Revisit {
                later: keyframes.0[query.keyframe].seq as usize,
                earlier: keyframes.0[candidate.place].seq as usize,
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
