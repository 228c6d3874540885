//! `Odometry` in one process finds the bits that the processes of a run find.

use std::{collections::BTreeSet, path::Path};

use gyre_configuration::Configuration;
use gyre_contract::{PoseHeader, flag};
use gyre_journal as journal;
use gyre_matching::odometry::{Odometry, OdometryConfig, Outcome, Registered};

use crate::{
    common::{Run, real_data, runtime_is_installed},
    method::{learned_masks::card, refinement::names},
};

fn register_all(run: &Run) -> Vec<Registered> {
    let resolved = run.out().join("config.toml");
    let configuration = Configuration::read(&resolved, &[]).unwrap();
    let config: OdometryConfig = toml::from_str(&run.result("config.toml")).unwrap();
    assert_eq!(config, configuration.odometry);
    let played = gyre_configuration::open(&configuration).unwrap();
    let (mut dataset, samples) = (played.dataset, played.samples);
    let mut odometry = Odometry::new(&config).unwrap();
    let scans = configuration.source.played(dataset.scans());
    scans
        .map(|index| {
            let scan = dataset.scan(index).unwrap();
            let samples = samples.of(dataset.as_ref(), scan.view().span_ns());
            odometry.register(&scan.view(), &samples).unwrap()
        })
        .collect()
}

pub fn assert_same_bits(run: &Run) -> usize {
    run.complete();
    let journal = journal::poses(run.out())
        .unwrap()
        .collect::<Result<Vec<_>, _>>()
        .unwrap();
    let poses: Vec<&PoseHeader> = journal
        .iter()
        .filter(|pose| !pose.item.is(flag::END))
        .collect();
    let registered = register_all(run);
    assert_eq!(poses.len(), registered.len());
    let mut start = 0;
    for (pose, registered) in poses.iter().zip(&registered) {
        let seq = pose.item.seq;
        if pose.item.is(flag::BREAK) {
            start = seq;
        }
        assert_eq!(seq - start, registered.seq);
        assert_eq!(pose.motion.motion(), registered.motion, "motion {seq}");
        assert_eq!(pose.pose(), registered.pose, "pose {seq}");
        assert_eq!(pose.motion.interval_ns, registered.interval_ns);
        assert_eq!(
            pose.item.is(flag::BREAK),
            registered.outcome == Outcome::Start
        );
    }
    poses.len()
}

pub fn configuration(name: &str) -> Run {
    Run::of_file(&Path::new(crate::PROJECT).join("configs").join(name))
}

#[test]
fn on_the_demo() {
    let run = Run::of_demo();
    let run = run.sets("simulation.scans=24 simulation.sensor.profile=cts350x-radiate");
    assert_eq!(assert_same_bits(&run), 24);
}

#[test]
fn with_the_gyro_of_a_real_drive() {
    if let Some(data) = real_data("radiate-2019-02-12") {
        let log = data.join("imu_as_logged.csv");
        let run = configuration("radiate.toml").data(&data);
        let run = run.sets("gyro.kind=log gyro.delay_s=1.58 gyro.up=-z source.scans=80");
        let run = run.set(&format!("gyro.file={}", log.display()));
        assert_eq!(assert_same_bits(&run), 80);
        let summary = run.summary();
        assert!(summary["gyro"]["motions"].as_u64() > Some(50), "{summary}");
    }
}

#[test]
fn with_every_angle_tried() {
    let run = Run::of_recording().sets("search.kind=exhaustive source.scans=10");
    assert_eq!(assert_same_bits(&run), 10);
    let summary = run.summary();
    let stages = [
        "radar-replay",
        "masking",
        "joint-search",
        "refinement",
        "pose-integration",
    ];
    let stages = BTreeSet::from(stages.map(str::to_owned));
    assert_eq!(names(&summary["stages"]), stages);
    assert_eq!(names(&summary["latency"]["stages"]), stages);
    let allocations = &summary["stages"]["joint-search"]["allocations_after_five"];
    assert_eq!(*allocations, 0);
}

/// With a network of two scans: see `input::breaks`.
#[test]
fn with_a_network_of_one_scan() {
    if runtime_is_installed() {
        assert_same_bits(&Run::of_recording().masked_by(&card("single-127")));
    }
}
