use std::{f64::consts::TAU, iter::successors};

use gyre_contract::{Gnss, GnssHeader};
use gyre_geometry::{
    Pose, UncertainMotion, pose,
    samples::{GnssFix, Sample},
};
use gyre_recording::received_fixes;
use gyre_slam::{LoopCandidate, LoopOutcome, RecordLog};
use gyre_transport::{
    numbers::Numbers,
    rig::{self, Run},
};
use nalgebra::{Matrix3, Vector3};

use super::*;

fn uncertain(x_m: f64, y_m: f64, yaw_rad: f64) -> UncertainMotion {
    UncertainMotion {
        motion: pose(x_m, y_m, yaw_rad),
        covariance: Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.0001)),
    }
}

/// Laps of 40 keyframes whose odometry turns too little.
fn keyframe(index: usize) -> Keyframe {
    let motion = uncertain(3.0, 0.0, TAU / 40.0 - 0.0005);
    let poses = successors(Some(pose(0.0, 0.0, 0.0)), |at| Some(at * motion.motion));
    let [x_m, y_m, yaw_rad] = poses.skip(index).map(|at| xy_yaw(&at)).next().unwrap();
    let pose = uncertain(x_m, y_m, yaw_rad);
    Keyframe {
        scan: 5 * index as u64,
        stamp_ns: 7 * index as i64,
        motion,
        path_m: 3.0 * index as f64,
        ..Keyframe::standing(2 * index as u64, pose, Vec::new())
    }
}

/// Each keyframe is at the place of the one a lap before.
fn query(keyframe: usize) -> Query {
    let candidate = |place| LoopCandidate {
        place,
        similarity: 0.9,
        motion: uncertain(0.1, -0.05, 0.0),
        correlation: 0.9,
        searched: 0.9,
        runner_up: 0.3,
        chi_square: 1.0,
        outcome: LoopOutcome::Accepted,
    };
    let candidates = keyframe.checked_sub(40).map(candidate);
    Query {
        keyframe,
        candidates: candidates.into_iter().collect(),
    }
}

struct Logs {
    out: tempfile::TempDir,
    fixes: Fixes,
    keyframes: RecordLog<Keyframe>,
    queries: RecordLog<Query>,
}

impl Logs {
    fn new() -> Self {
        let out = tempfile::tempdir().unwrap();
        Self {
            keyframes: RecordLog::open(out.path()).unwrap(),
            queries: RecordLog::open(out.path()).unwrap(),
            fixes: Fixes::default(),
            out,
        }
    }

    fn append(&mut self, keyframes: usize, queries: usize) {
        for index in self.keyframes.len()..keyframes {
            self.keyframes.append(&keyframe(index)).unwrap();
        }
        for index in self.queries.len()..queries {
            self.queries.append(&query(index)).unwrap();
        }
    }

    /// Ends the logs. The last correction is the same as after a restart.
    fn end_and_compare(&mut self, trajectory: &mut Trajectory) -> CorrectionHeader {
        self.keyframes.end().unwrap();
        self.queries.end().unwrap();
        let (correction, has_ended) = follow(trajectory);
        assert!(has_ended);
        let (restarted, _) = follow(&mut self.trajectory());
        assert_eq!(text(restarted), text(correction));
        correction.unwrap()
    }

    fn trajectory(&self) -> Trajectory {
        Trajectory::open(self.out.path(), EstimatorKind::Graph, self.fixes.clone()).unwrap()
    }
}

fn follow(trajectory: &mut Trajectory) -> (Option<CorrectionHeader>, bool) {
    let mut last = None;
    loop {
        match trajectory.step().unwrap() {
            Step::Worked(correction) => last = correction.or(last),
            Step::Idle => return (last, false),
            Step::Ended => return (last, true),
        }
    }
}

fn text(correction: Option<CorrectionHeader>) -> String {
    format!("{:?}", correction.unwrap())
}

#[test]
fn without_loops_odometry_is_not_corrected() {
    let mut logs = Logs::new();
    logs.append(30, 20);
    let (correction, has_ended) = follow(&mut logs.trajectory());
    let correction = correction.unwrap();
    let identity = xy_yaw(&correction.map_from_odometry());
    assert!(identity.iter().all(|it| it.abs() < 1e-9), "{identity:?}");
    assert!(!has_ended && correction.loops == 0 && correction.keyframes == 30);
    assert_eq!((correction.item.scan, correction.keyframe_seq), (145, 58));
}

#[test]
fn the_last_correction_is_the_same_whenever_the_logs_were_read() {
    let mut logs = Logs::new();
    let mut trajectory = logs.trajectory();
    assert!(follow(&mut trajectory).0.is_none());
    for (keyframes, queries) in [(10, 0), (45, 41), (70, 41), (70, 70), (90, 85)] {
        logs.append(keyframes, queries);
        follow(&mut trajectory);
    }
    logs.append(120, 120);
    let standing = follow(&mut trajectory).0.unwrap().map_from_odometry();
    let restarted = follow(&mut logs.trajectory()).0.unwrap();
    let apart = standing.inv_mul(&restarted.map_from_odometry());
    assert!(apart.translation.vector.norm() < 0.001, "{apart}");
    assert!(apart.rotation.angle().abs() < 1e-5, "{apart}");
    let correction = logs.end_and_compare(&mut trajectory);
    assert_eq!(correction.item.seq, 240);
    assert!(correction.loops > 0 && correction.yaw_rad.abs() > 0.001);
}

#[test]
fn what_is_cut_off_the_logs_is_taken_back() {
    let mut logs = Logs::new();
    logs.append(90, 85);
    let mut trajectory = logs.trajectory();
    follow(&mut trajectory);
    logs.queries.cut(60).unwrap();
    logs.keyframes.cut(80).unwrap();
    logs.append(81, 70);
    let (correction, _) = follow(&mut trajectory);
    let (restarted, _) = follow(&mut logs.trajectory());
    assert_eq!(text(correction), text(restarted));
    assert_eq!(correction.unwrap().keyframes, 81);
}

/// The places of the laps as they are, without the error of odometry.
fn fixes() -> Fixes {
    let step = pose(3.0, 0.0, TAU / 40.0);
    let laps = successors(Some(pose(70.0, -20.0, 1.0)), |at| Some(at * step));
    let fix = |(index, at): (i64, Pose)| GnssFix {
        stamp_ns: 7 * index,
        east_m: at.translation.x,
        north_m: at.translation.y,
        sigma_m: 0.1,
    };
    let fixes = (0..120).zip(laps).map(fix).collect();
    Fixes::new(fixes, &GnssConfig::default())
}

#[test]
fn fixes_correct_as_keyframes_come_and_the_last_correction_is_that_of_the_results() {
    let mut logs = Logs {
        fixes: fixes(),
        ..Logs::new()
    };
    let mut trajectory = logs.trajectory();
    for keyframes in [10, 50, 90, 119] {
        logs.append(keyframes, 0);
        follow(&mut trajectory);
    }
    logs.append(120, 120);
    let turned_rad = follow(&mut trajectory).0.unwrap().yaw_rad;
    // Odometry turns by 0.0005 rad too little at each keyframe.
    assert!((turned_rad - 0.06).abs() < 0.02, "{turned_rad}");
    logs.end_and_compare(&mut trajectory);
}

#[test]
fn messages_are_logged_once_whoever_is_restarted_and_the_missing_ones_are_counted() {
    let run = Run::begin();
    let manifest = &run.manifest;
    let log = received_fixes(&manifest.out);
    std::fs::create_dir(log.parent().unwrap()).unwrap();
    let sender = rig::writer::<Gnss>(manifest);
    let send = |seq, mut message: GnssHeader| {
        message.item.seq = seq;
        sender.publish(message, None).unwrap();
    };
    let fix = |seq| {
        let fix = Sample::fix(seq as i64, [2.0, 3.0], 0.0, 0.5);
        send(seq, GnssHeader::of(seq as i64, Some(fix)));
    };
    let node = rig::node(manifest);
    let open = || LiveFixes::open(GnssConfig::default(), &node, manifest).unwrap();
    assert!(!LiveFixes::have_begun(manifest));
    let mut killed = open();
    [0, 1].into_iter().for_each(fix);
    killed.take().unwrap();
    drop(killed);
    // It was killed within a row.
    let text = std::fs::read_to_string(&log).unwrap();
    std::fs::write(&log, format!("{text}2,2,")).unwrap();
    fix(2);
    let mut restarted = open();
    send(3, GnssHeader::of(17, None));
    send(5, GnssHeader::counts(2, 3));
    let mut logs = Logs::new();
    logs.append(1, 0);
    let mut trajectory = logs.trajectory();
    restarted.take().unwrap();
    trajectory.live_fixes = Some(restarted);
    fix(6);
    follow(&mut trajectory);
    // A step takes the fixes that have arrived, before the end.
    let text = std::fs::read_to_string(&log).unwrap();
    assert!(text.ends_with("\n6,2,3,0,0.5\n"), "{text}");
    // The source has died before it has sent the eighth.
    let mut sent = Numbers::open(manifest, "source.fixes").unwrap();
    sent.write([8]).unwrap();
    trajectory.sync().unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let rows = "0,2,3,0,0.5\n1,2,3,0,0.5\n\n2,2,3,0,0.5\n17,,,,0\nunreadable,2\nlost,4\n\
                6,2,3,0,0.5\nlost,1\n";
    assert_eq!(text.split_once('\n').unwrap().1, rows);
    let faults = gyre_datasets::SampleLog::received(&log).faults;
    let counts = (faults.lost, faults.unreadable, faults.without_fix);
    assert_eq!(counts, (5, 2, 1));
}
