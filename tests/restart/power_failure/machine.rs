//! The writers of a run in one process: the files of the stages and of `gyre run`, in their order.

use std::{fs, path::Path, sync::OnceLock, time::Duration};

use gyre::{
    earlier::{self, Begun, Earlier},
    plan,
};
use gyre_configuration::{Configuration, terminal::Failure};
use gyre_contract::{Item, MotionEstimate, MotionHeader, PoseHeader, compose, flag, run::Ending};
use gyre_datasets::DatasetOptions;
use gyre_geometry::{SparsePoint, samples::SensorConfigs};
use gyre_journal::{
    self as journal, Journal, PoseLog,
    checkpoint::{self, Checkpoint},
    keyframes::Keyframes,
};
use gyre_matching::{Refiner, Searched};
use gyre_results::{Identity, Out, Programs, Session};
use gyre_slam::{Keyframe, records_path};
use nalgebra::{Isometry2, Vector2};

/// Scans of the drive: three groups of synchronised changes.
pub const SCANS: u64 = 52;
const WINDOW: usize = 4;
const STEP_M: f64 = 1.0;
const INTERVAL_NS: i64 = 250_000_000;
const POINTS: usize = 200;
/// The results that must be the same bytes.
const RESULTS: [&str; 3] = ["odometry.csv", "trajectory.tum", "trajectory.svg"];
/// Additional results of a run with SLAM.
const SLAM_RESULTS: [&str; 3] = ["trajectory_slam.tum", "graph.g2o", "map.png"];

/// A machine on which one run is begun, resumed and completed.
pub struct Machine {
    configuration: Configuration,
    programs: Programs,
    /// The results of a run that nothing disturbs.
    undisturbed: OnceLock<Vec<Vec<u8>>>,
}

impl Machine {
    /// A machine whose runs have this kind of SLAM.
    pub fn new(slam: &str) -> Self {
        // A small map, whose slots are used again within the drive; and a small picture, because
        // each of thousands of runs draws one.
        let overrides = [
            "points.max_range_m=10.0",
            "refinement.keyframes=3",
            "refinement.cell_m=1.0",
            "refinement.reach_m=30.0",
            &format!("slam.kind={slam}"),
        ]
        .map(str::to_owned);
        let configuration = Configuration::of_overrides(&overrides).unwrap();
        let programs = plan::programs(&configuration).unwrap();
        Self {
            configuration,
            programs,
            undisturbed: OnceLock::new(),
        }
    }

    pub fn undisturbed(&self) -> &[Vec<u8>] {
        self.undisturbed.get_or_init(|| {
            let folder = super::folder();
            self.run(folder.path()).unwrap();
            self.results(folder.path())
        })
    }

    pub fn results(&self, out: &Path) -> Vec<Vec<u8>> {
        let mut paths: Vec<_> = RESULTS.iter().map(|name| out.join(name)).collect();
        if self.configuration.slam.is_on() {
            paths.push(records_path::<Keyframe>(out));
            paths.extend(SLAM_RESULTS.iter().map(|name| out.join(name)));
        }
        paths.iter().map(|path| fs::read(path).unwrap()).collect()
    }

    /// Acts as the command, to the end of the run.
    pub fn run(&self, folder: &Path) -> Result<(), Failure> {
        let out = Out::lock(folder)?;
        let resumed = match Earlier::of(&out, &self.configuration, &self.programs, false)? {
            Earlier::Foreign(reason) => return Err(reason),
            Earlier::Ended(begun) => begun.poses,
            Earlier::Unfinished(begun) => self.go_on(&out, Some(begun))?,
            Earlier::Nothing | Earlier::WithoutPoses(_) | Earlier::Complete(_) => {
                self.go_on(&out, None)?
            }
        };
        let session = Session {
            scans: Some(SCANS as usize),
            resumed: resumed as usize,
            damage: None,
            needs_all: false,
            wall: Duration::ZERO,
            footprint: None,
            ending: Some(Ending::Complete),
            report: None,
        };
        let make_way = |poses| earlier::make_way(&out, poses);
        let written = gyre_results::write(&self.configuration, &out, &session, &make_way)?;
        assert!(written.ended);
        earlier::end(&out, written.poses, true)
    }

    /// Returns whether the run in this folder is complete. A new run removes the journal first:
    /// without the journal the mark is invalid.
    pub fn is_complete(&self, folder: &Path) -> bool {
        folder.join("journal/complete").exists() && journal::path(folder).exists()
    }

    fn go_on(&self, out: &Out, begun: Option<Begun>) -> Result<u64, Failure> {
        let resumed = begun.as_ref().map_or(0, |begun| begun.poses);
        match &begun {
            Some(begun) => earlier::resume(out, begun)?,
            None => {
                let resolved = self.configuration.to_toml()?;
                earlier::begin(out, &self.identity(), &resolved, false)?;
            }
        }
        let mut stages = Stages::start(out.path(), &self.configuration)?;
        stages.play()?;
        Ok(resumed)
    }

    fn identity(&self) -> Identity {
        Identity::of(
            &self.configuration,
            &self.programs,
            DatasetOptions::default(),
            Some(SCANS as usize),
            None,
        )
        .unwrap()
    }
}

/// Refinement and pose-integration.
struct Stages {
    refiner: Refiner,
    checkpoint: Checkpoint,
    journal: Journal,
    keyframes: Option<Keyframes>,
    last: Option<PoseHeader>,
    /// The journal has its end: a continued run then waits only for its followers, and this machine
    /// has no followers.
    ended: bool,
}

impl Stages {
    fn start(out: &Path, configuration: &Configuration) -> Result<Self, Failure> {
        let config = &configuration.odometry.refinement;
        let refiner = Refiner::new(config, &SensorConfigs::default(), POINTS)?;
        let cells = refiner.keyframe_cells();
        let checkpoint = Checkpoint::open(&checkpoint::path(out), WINDOW, config.keyframes, cells)?;
        let mut journal = Journal::open(out)?;
        let (mut poses, ended) = journal.last(1)?;
        let last = poses.pop();
        let slam = &configuration.slam;
        let poses = last.map_or(0, |last| last.item.seq + 1);
        let keyframes = slam
            .is_on()
            .then(|| Keyframes::open(out, poses, ended, POINTS));
        Ok(Self {
            refiner,
            checkpoint,
            journal,
            keyframes: keyframes.transpose()?,
            last,
            ended,
        })
    }

    fn play(&mut self) -> Result<(), Failure> {
        if self.ended {
            return Ok(());
        }
        let first = self.last.map_or(0, |last| last.item.seq + 1);
        if let Some(before) = first.checked_sub(1) {
            self.checkpoint.restore(before, &mut self.refiner)?;
        }
        for seq in first..SCANS {
            let motion = MotionHeader {
                item: item(seq),
                motion: self.refined(seq),
            };
            self.checkpoint
                .write(seq, checkpoint::checksum(&motion.motion), &self.refiner)?;
            let pose = compose(self.last.as_ref(), &motion);
            if let Some(keyframes) = &mut self.keyframes {
                keyframes.add(&pose, &scan(seq))?;
            }
            self.journal.append(&pose)?;
            self.last = Some(pose);
        }
        if let Some(keyframes) = &mut self.keyframes {
            keyframes.end()?;
        }
        let end = PoseHeader {
            item: item(SCANS).flagged(flag::END),
            ..PoseHeader::default()
        };
        Ok(self.journal.append(&end)?)
    }

    fn refined(&mut self, seq: u64) -> MotionEstimate {
        let Some(before) = seq.checked_sub(1) else {
            return MotionEstimate::default();
        };
        // Where nothing matches, a new map begins, with a scan that may be in the old one too.
        let (later, earlier) = (scan(seq), scan(before));
        let searched = Isometry2::new(Vector2::new(STEP_M, 0.0), 0.0);
        let interval_s = INTERVAL_NS as f64 * 1e-9;
        let refined = self.refiner.refine(&Searched::by_radar(
            seq, &later, &earlier, &searched, interval_s,
        ));
        let found = MotionEstimate {
            x_m: STEP_M,
            interval_ns: INTERVAL_NS,
            ..MotionEstimate::default()
        };
        gyre_stages::estimates::refined(&found, &refined)
    }
}

fn item(seq: u64) -> Item {
    let stamp_ns = 1_700_000_000_000_000_000 + seq as i64 * INTERVAL_NS;
    Item {
        published: seq,
        previous_scan: seq.saturating_sub(1),
        flags: if seq == 0 { flag::BREAK } else { 0 },
        ..Item::recorded(seq, seq, stamp_ns)
    }
}

/// The scan of posts along a road; from scan 26 on the posts are different and match no earlier
/// scan.
fn scan(seq: u64) -> Vec<SparsePoint> {
    let world = seq / 26;
    let metres = seq as f64 * STEP_M;
    let mixed = |k: u64, salt: u64| {
        let word = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15 ^ salt ^ world << 40);
        (word ^ word >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40
    };
    let share = |k: u64, salt: u64| mixed(k, salt) as f64 / f64::from(1 << 24);
    let place = |k: u64| {
        [
            300.0 * share(k, 1) - 100.0 - metres,
            50.0 * share(k, 7) - 25.0,
        ]
    };
    (0..900)
        .map(place)
        .filter(|[x, y]| x.hypot(*y) < 28.0)
        .map(|[x, y]| [x as f32, y as f32, 0.0, 0.7, 0.0].into())
        .take(POINTS)
        .collect()
}
