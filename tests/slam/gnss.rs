//! GNSS: fixes change no byte of odometry, the corrected trajectory is the same after any kill, and
//! the map agrees with the fixes.

use std::{fs, path::PathBuf};

use gyre_datasets::read_trajectory;
use gyre_geometry::samples::{Geographic, LocalPlane};
use gyre_radar::Trajectory;
use gyre_slam::{
    estimation::G2o,
    mapping::{Map, Origin},
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use serde_json::Value;

use crate::{
    common::{
        Run, finished,
        recording::{around_a_block, linked},
    },
    live::gnss::assert_replays,
    observers::record::{WINDOW, recorded},
    reach::{only_if, python_has},
    slam::loops::by_gtsam,
};

/// Where the world of the simulation lies.
const PLACE: Geographic = Geographic {
    latitude_deg: 51.75,
    longitude_deg: -1.26,
};
/// The heading of its x axis, counter-clockwise from east.
const TURNED_RAD: f64 = 0.7;
const SIGMA_M: f64 = 0.4;
/// The antenna, ahead and to the left of the radar, m.
const LEVER_M: [f64; 2] = [-1.0, 0.3];

fn truth() -> Trajectory {
    read_trajectory(&around_a_block().join("ground_truth.tum")).unwrap()
}

/// The log of a receiver at 5 Hz, with one line without a fix and a reflection.
pub fn log() -> String {
    let (truth, mut random) = (truth(), StdRng::seed_from_u64(7));
    let plane = LocalPlane::new(PLACE, 0.0);
    let (first_ns, last_ns) = truth.span_ns().unwrap();
    let (sin, cos) = TURNED_RAD.sin_cos();
    let mut text = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n".to_owned();
    for (k, stamp_ns) in (first_ns..last_ns).step_by(200_000_000).enumerate() {
        let antenna = truth.at(stamp_ns).unwrap() * nalgebra::Point2::from(LEVER_M);
        let mut noise = || SIGMA_M * 3f64.sqrt() * random.random_range(-1.0..1.0);
        let reflected = if (60..75).contains(&k) { 20.0 } else { 0.0 };
        let place = plane.place([
            cos * antenna.x - sin * antenna.y + noise() + reflected,
            sin * antenna.x + cos * antenna.y + noise(),
        ]);
        let [latitude, longitude] = match k {
            3 => [0.0, 0.0],
            _ => [place.latitude_deg, place.longitude_deg],
        };
        text += &format!("{stamp_ns},{latitude},{longitude},{SIGMA_M}\n");
    }
    text
}

fn without() -> Run {
    Run::small().data(around_a_block()).set("slam.kind=graph")
}

pub fn run() -> Run {
    let run = without();
    let file = run.folder().join("gnss.csv");
    fs::write(&file, log()).unwrap();
    with_antenna(run.set("gnss.kind=log")).set(&format!("gnss.file={}", file.display()))
}

pub fn with_antenna(run: Run) -> Run {
    run.set("gnss.correlation_s=0")
        .set(&format!("gnss.lever_m=[{}, {}]", LEVER_M[0], LEVER_M[1]))
}

/// The results that must be the same to the byte.
pub fn left(run: &Run) -> ([String; 3], Value) {
    let mut gnss = run.summary()["gnss"].clone();
    // The runs have different logs.
    for key in ["log", "topic"] {
        gnss.as_object_mut().unwrap().remove(key);
    }
    let results = ["trajectory_slam.tum", "loops.csv", "graph.g2o"];
    (results.map(|name| run.result(name)), gnss)
}

fn origin(run: &Run) -> Origin {
    serde_json::from_value(run.summary()["gnss"]["origin"].clone()).unwrap()
}

/// The first pose of the truth on the earth.
fn true_origin() -> Origin {
    let plane = LocalPlane::new(PLACE, 0.0);
    let first = nalgebra::UnitComplex::new(TURNED_RAD) * truth().poses[0];
    let at = first.translation.vector.into();
    let place = plane.place(at);
    Origin {
        latitude_deg: place.latitude_deg,
        longitude_deg: place.longitude_deg,
        heading_deg: plane.heading_deg(at, first.rotation.angle()),
    }
}

fn apart(a: &Origin, b: &Origin) -> (f64, f64) {
    let place = |it: &Origin| Geographic {
        latitude_deg: it.latitude_deg,
        longitude_deg: it.longitude_deg,
    };
    let [east, north] = LocalPlane::new(place(a), 0.0).east_north(place(b));
    let turn = (a.heading_deg - b.heading_deg + 540.0).rem_euclid(360.0) - 180.0;
    (east.hypot(north), turn)
}

fn draw(run: &Run) -> PathBuf {
    let map = run.folder().join("map");
    finished!["map", run.out(), "--out", &map].succeeded();
    map
}

#[test]
fn odometry_is_the_same_and_the_map_lies_where_the_fixes_say() {
    let (run, without) = (run(), without());
    assert_eq!(run.complete(), without.complete());
    let gnss = &run.summary()["gnss"];
    assert_eq!(gnss["faults"]["zero"], 1, "{gnss}");
    let [used, refused] = ["used", "refused"].map(|name| gnss[name].as_u64().unwrap());
    // The reflection is beside eight keyframes.
    assert!(used > 60 && (6..=12).contains(&refused), "{gnss}");
    let (metres, degrees) = apart(&origin(&run), &true_origin());
    assert!(
        metres < 1.0 && degrees.abs() < 1.0,
        "{metres} m, {degrees} deg"
    );
    let drawn = Map::open(&draw(&run)).unwrap();
    assert_eq!(drawn.origin(), Some(origin(&run)));
    assert_eq!(Map::open(&draw(&without)).unwrap().origin(), None);
    assert!(without.summary().get("gnss").is_none());
}

#[test]
fn the_optimum_of_gtsam_has_the_same_poses_with_fixes() {
    only_if!(python_has("gtsam"));
    let run = run();
    run.complete();
    let [edges, _, _, _, _, apart_m] = by_gtsam(&run);
    let without_fixes = G2o::parse(&run.result("graph.g2o")).unwrap();
    assert!(edges > without_fixes.constraints.len() as f64 + 60.0);
    assert!(apart_m < 0.02, "{apart_m}");
}

#[test]
fn a_log_beside_the_scans_is_used_and_kept_beside_their_recording() {
    let drive = linked(around_a_block(), |_| true);
    fs::write(drive.path().join("gnss.csv"), log()).unwrap();
    let run = Run::small().data(drive.path()).set("slam.kind=graph");
    let run = recorded(&with_antenna(run.set("gnss.kind=auto")).set(WINDOW));
    run.complete();
    assert!(run.summary()["gnss"]["used"].as_u64() > Some(60));
    assert_replays(&run);
}
