//! The configurations of the table, and the results that must be the same bytes.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    ops::Range,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock},
};

use gyre_contract::FollowerId;
use serde_json::Value;

use crate::{
    common::{Run, real_data, recording, runtime_is_installed},
    input::breaks,
    method::{learned_masks::card, standstill},
    observers::record,
    reach::python_stage,
    slam::gnss,
};

const LOOP_CLOSURE: &str = FollowerId::LoopClosure.name();
const TRAJECTORY: &str = FollowerId::Trajectory.name();
const OBJECTS: &str = FollowerId::Objects.name();

const CORRECTED: &[&str] = &[
    "trajectory_slam.tum",
    "loops.csv",
    "graph.g2o",
    "map.png",
    "journal/keyframes.log",
    "journal/loops.log",
];

/// A recording, the configuration of its runs, and their results.
#[derive(Clone, Copy)]
pub struct Configuration {
    name: &'static str,
    can: fn() -> bool,
    recording: fn() -> PathBuf,
    run: fn(&Path) -> Run,
    pub poses: usize,
    /// The poses between which faults strike.
    pub moments: Option<(usize, usize)>,
    rate: &'static str,
    /// The processes of a run beside its stages.
    followers: &'static [&'static str],
    /// The process whose state of many scans a restart restores.
    pub stateful: &'static str,
    /// Results beside `odometry.csv` and `trajectory.tum`.
    results: &'static [&'static str],
    /// Figures of the summary that must be the same.
    figures: &'static [&'static str],
    /// Figures of the summary that exceed these values: the run exercises the feature of its name.
    shows: &'static [(&'static str, f64)],
    /// A run whose motions are the same: followers change no byte of odometry.
    same_as: Option<fn() -> Run>,
    differs_from: Option<fn() -> Run>,
}

pub struct Undisturbed {
    pub results: Results,
    /// The size of its folder of results.
    pub bytes: u64,
    /// The stages and followers of the run.
    pub processes: BTreeSet<String>,
}

#[derive(PartialEq, Eq)]
pub struct Results(BTreeMap<&'static str, Vec<u8>>);

impl Results {
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        let mut names = self.0.keys();
        names
            .find(|name| self.0.get(*name) != other.0.get(*name))
            .copied()
    }
}

impl Configuration {
    /// Returns whether the machine can compute the run; prints the missing tools or data.
    pub fn is_possible(&self) -> bool {
        (self.can)()
    }

    pub fn run(&self) -> Run {
        self.run_of(&(self.recording)(), self.rate)
    }

    /// A run of another recording of the same kind.
    pub fn run_of(&self, recording: &Path, rate: &str) -> Run {
        (self.run)(recording).rate(rate)
    }

    pub fn rate(&self) -> &str {
        self.rate
    }

    /// The poses between which faults strike.
    pub fn moments(&self) -> Range<usize> {
        let (first, end) = self.moments.unwrap_or((1, self.poses));
        first..end
    }

    /// A copy of the recording that may be damaged, with the images that are kept by their numbers.
    pub fn copy(&self, keep: impl Fn(usize) -> bool) -> tempfile::TempDir {
        recording::linked(&(self.recording)(), keep)
    }

    pub fn results(&self, run: &Run) -> Results {
        let names = ["odometry.csv", "trajectory.tum"].iter();
        let files = names.chain(self.results);
        let files = files.map(|name| (*name, fs::read(run.out().join(name)).unwrap()));
        let summary = run.summary();
        let figure = |place: &&'static str| {
            let value = summary.pointer(place).unwrap_or(&Value::Null);
            (*place, value.to_string().into_bytes())
        };
        Results(files.chain(self.figures.iter().map(figure)).collect())
    }

    /// The run that nothing disturbs. All rows of a configuration share it.
    pub fn undisturbed(&self) -> Arc<Undisturbed> {
        type Cell = Arc<OnceLock<Arc<Undisturbed>>>;
        static RUNS: Mutex<BTreeMap<&str, Cell>> = Mutex::new(BTreeMap::new());
        let cell = RUNS.lock().unwrap().entry(self.name).or_default().clone();
        cell.get_or_init(|| Arc::new(self.run_undisturbed()))
            .clone()
    }

    /// Asserts that a run has the results of the undisturbed run.
    pub fn assert_undisturbed(&self, run: &Run, case: &str) {
        let undisturbed = self.undisturbed();
        let difference = undisturbed.results.difference(&self.results(run));
        assert_eq!(difference, None, "{case}");
    }

    fn run_undisturbed(&self) -> Undisturbed {
        let run = self.run_of(&(self.recording)(), "max");
        run.complete();
        let summary = run.summary();
        for (place, least) in self.shows {
            let shown = summary.pointer(place).and_then(Value::as_f64);
            assert!(shown > Some(*least), "{}: {place} is {shown:?}", self.name);
        }
        if let Some(same) = self.same_as {
            assert!(same().complete() == run.odometry(), "{}", self.name);
        }
        if let Some(other) = self.differs_from {
            let other = other();
            other.finish();
            assert!(other.odometry() != run.odometry(), "{}", self.name);
        }
        let stages = summary["stages"].as_object().unwrap().keys().cloned();
        let followers = self.followers.iter().map(|name| (*name).to_owned());
        Undisturbed {
            results: self.results(&run),
            bytes: size(run.out()),
            processes: stages.chain(followers).collect(),
        }
    }
}

fn size(path: &Path) -> u64 {
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let below: u64 = entries.map(|entry| size(&entry.path())).sum();
    below + fs::metadata(path).map_or(0, |file| file.len())
}

const SMALL: Configuration = Configuration {
    name: "",
    can: || true,
    recording: || recording::small().to_owned(),
    run: |recording| Run::small().data(recording),
    poses: recording::SCANS,
    moments: None,
    rate: "6",
    followers: &[],
    stateful: "rotation-search",
    results: &[],
    figures: &[],
    shows: &[],
    same_as: None,
    differs_from: None,
};

/// Defines configurations, each by the one that it is like and its other fields.
macro_rules! configurations {
    ($($(#[$doc:meta])* $name:ident: $base:expr => { $($field:ident: $value:expr,)* })*) => {
        $(
            $(#[$doc])*
            pub fn $name() -> Configuration {
                Configuration {
                    name: stringify!($name),
                    $($field: $value,)*
                    ..$base
                }
            }
        )*
    };
}

configurations! {
    plain: SMALL => {}
    /// A map whose slots of keyframes are used again.
    small_map: SMALL => {
        run: |recording| {
            let run = Run::small().data(recording);
            run.sets("run.window=1 refinement.keyframes=2")
        },
        stateful: "refinement",
    }
    /// Keyframes every few scans.
    slam: SMALL => {
        run: |recording| Run::small().data(recording).set("slam.kind=graph"),
        followers: &[LOOP_CLOSURE, TRAJECTORY],
        stateful: "pose-integration",
        results: CORRECTED,
        same_as: Some(Run::of_recording),
    }
    loops: slam() => {
        recording: || recording::around_a_block().to_owned(),
        poses: recording::SCANS_AROUND,
        rate: "10",
        stateful: LOOP_CLOSURE,
        shows: &[("/slam/loops_used", 0.0)],
        same_as: Some(|| Run::small().data(recording::around_a_block())),
    }
    /// The same with the fixes of a GNSS receiver.
    gnss: loops() => {
        run: |_| gnss::run(),
        stateful: TRAJECTORY,
        figures: &["/gnss/used", "/gnss/refused", "/gnss/faults", "/gnss/origin"],
        shows: &[("/gnss/used", 60.0)],
    }
    /// Once around a block, with objects.
    objects: loops() => {
        run: |recording| Run::small().data(recording).set("objects.kind=tracks"),
        followers: &[OBJECTS],
        stateful: OBJECTS,
        results: &["objects.csv"],
        shows: &[],
    }
    /// A gap of a year in the recording.
    gap: SMALL => {
        recording: breaks::with_a_gap,
        moments: Some((breaks::BREAK - 1, breaks::BREAK + 4)),
        shows: &[("/breaks", 0.0)],
    }
    unreadable: SMALL => {
        recording: || {
            recording::damaged("unreadable", |images| {
                recording::truncate(&images[UNREADABLE], 100_000);
            })
        },
        poses: recording::SCANS - 1,
        moments: Some((UNREADABLE - 2, UNREADABLE + 6)),
        shows: &[("/unreadable", 0.0)],
    }
    /// Scans that have lost azimuths. The source takes each loss to the next scan.
    lost_azimuths: SMALL => {
        recording: || recording::of_radiate(true),
        shows: &[("/lost/azimuths", 0.0)],
        differs_from: Some(|| {
            let run = Run::small().data(&recording::of_radiate(true));
            run.set("dataset.lost_azimuths=ignore")
        }),
        rate: "2",
        stateful: "masking",
    }
    /// A vehicle that stops, stands and drives off.
    standstill: SMALL => {
        recording: standstill::recording,
        poses: standstill::SCANS,
        moments: Some((14, 47)),
        rate: "8",
        stateful: "refinement",
        shows: &[("/motions/stationary", 20.0)],
    }
    /// The exhaustive search, which is one process in place of two.
    joint_search: SMALL => {
        run: |recording| {
            let run = Run::small().data(recording);
            run.sets("raster.n=63 search.kind=exhaustive")
        },
        rate: "3",
    }
    /// Samples of a gyro and of wheels, which travel with the scans.
    gyro_and_wheels: SMALL => {
        recording: with_logs,
        run: |_| {
            let run = with_gyro().set("wheels.kind=auto");
            run.set(&format!("wheels.delay_s={WHEELS_LATE_S}"))
        },
        shows: &[
            ("/gyro/motions", 15.0),
            ("/wheels/motions", 15.0),
            ("/wheels/predicted", 3.0),
        ],
        differs_from: Some(with_gyro),
    }
    /// Velocities by Doppler, each from one scan.
    doppler: SMALL => {
        recording: in_a_tunnel,
        run: |recording| Run::small().data(recording).set("doppler.kind=auto"),
        shows: &[("/doppler/motions", 15.0)],
        differs_from: Some(without_doppler),
    }
    /// A network that takes the scan before, too.
    network_of_two_scans: SMALL => {
        can: runtime_is_installed,
        run: |recording| Run::small().data(recording).masked_by(&card("pair-127")),
        stateful: "masking",
        differs_from: Some(Run::of_recording),
    }
    /// The same, computed by rten.
    network_in_rten: network_of_two_scans() => {
        can: || true,
        run: |recording| (network_of_two_scans().run)(recording).set("masking.backend=rten"),
    }
    /// Such a network, and a scan between two that cannot be read.
    network_at_an_unreadable_scan: unreadable() => {
        run: network_of_two_scans().run,
        can: runtime_is_installed,
        moments: Some((UNREADABLE - 1, UNREADABLE + 3)),
    }
    /// A simulation that is rendered while it is played.
    simulation: SMALL => {
        run: |_| Run::simulated(24).set("simulation.sensor.profile=cts350x-radiate"),
    }
    /// A recording of a run, from its masked scans on.
    replayed: SMALL => {
        recording: recorded,
        run: |recording| Run::small().data(recording).argument("--from", "masked"),
        stateful: "refinement",
        same_as: Some(Run::of_recording),
    }
    python: SMALL => {
        can: python_stage::can_start,
        run: |recording| python_stage::with_python(Run::small().data(recording)),
        stateful: "masking",
    }
    /// A RADIATE sequence with refinement, learned masks and loops, where there is one.
    radiate: loops() => {
        can: || real_data("radiate-2019-02-12").is_some() && runtime_is_installed(),
        recording: || real_data("radiate-2019-02-12").unwrap(),
        run: |recording| {
            let project = Path::new(crate::PROJECT);
            Run::of_file(&project.join("configs/radiate.toml"))
                .masked_by(&project.join("models/gyre-255.toml"))
                .data(recording)
                .set("slam.kind=graph")
        },
        poses: 466,
        rate: "max",
        same_as: None,
    }
}

/// The image that cannot be read.
const UNREADABLE: usize = 6;

/// The delays of the logs of the gyro and of the wheels, s.
const LATE_S: f64 = 0.75;
const WHEELS_LATE_S: f64 = 0.2;

/// A recording as RADIATE has them, with the log of a gyro whose clock is late and whose host
/// stalls and loses samples, and with the log of wheels, which slip. The radar goes blind.
fn with_logs() -> PathBuf {
    let gyro = format!("{{ profile = 'asm330lhh', delay_s = {LATE_S}, faults = true }}");
    let wheels = format!("{{ rate_hz = 20.0, delay_s = {WHEELS_LATE_S}, faults = true }}");
    let settings = format!(
        "{}sensor.lost_azimuths = true\nblind_s = [2.5, 4.5]\ngyro = {gyro}\nwheels = {wheels}\n",
        recording::RADIATE
    );
    recording::configured("gyro-and-wheels", &settings)
}

pub fn with_gyro() -> Run {
    let run = Run::small().data(&with_logs()).set("gyro.kind=auto");
    run.set(&format!("gyro.delay_s={LATE_S}"))
}

/// A recording of a radar whose chirps alternate, in a tunnel from the third second on.
fn in_a_tunnel() -> PathBuf {
    let settings = "scans = 24\nsensor.profile = 'ras6'\noutput.format = 'boreas'\n\
        drive.speed_mps = 8.0\ntunnel_m = [24.0, 100.0]\n";
    recording::configured("chirps-alternate", settings)
}

/// The run of the same recording without its velocities.
pub fn without_doppler() -> Run {
    Run::small().data(&in_a_tunnel())
}

fn recorded() -> PathBuf {
    let folder = recording::prepared("recorded", |folder| {
        fs::create_dir(folder).unwrap();
        let file = folder.join("drive.mcap");
        let run = record::played().argument("--record", file.to_str().unwrap());
        run.set(record::ALL).complete();
    });
    folder.join("drive.mcap")
}
