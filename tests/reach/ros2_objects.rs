//! Tests of the messages to a peer in ROS 2 from a run that tracks objects.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    common::{Run, odometry, recording},
    reach::{
        only_if,
        ros2::{Program, can_speak, domain, number, received, stamp_ns},
    },
};

/// An object of a scan, by `objects.csv`.
struct Row {
    object: String,
    /// x, y, length, width and the variances of x and y.
    values: [f64; 6],
    speed_mps: f64,
    moving: bool,
}

/// The objects of a run by the times of their scans.
fn rows(run: &Run) -> BTreeMap<i64, Vec<Row>> {
    let names = [
        "stamp_ns", "object", "moving", "vx_m_s", "vy_m_s", "x_m", "y_m", "length_m", "width_m",
        "cov_xx", "cov_yy",
    ];
    let mut scans: BTreeMap<i64, Vec<Row>> = BTreeMap::new();
    for row in odometry::columns(&run.result("objects.csv"), &names) {
        let at = |column: usize| row[column].parse::<f64>().unwrap();
        scans.entry(row[0].parse().unwrap()).or_default().push(Row {
            object: row[1].clone(),
            values: [5, 6, 7, 8, 9, 10].map(at),
            speed_mps: at(3).hypot(at(4)),
            moving: row[2] == "1",
        });
    }
    scans
}

/// Asserts that a detection is an object, seen from a car whose radar, a metre ahead of its origin,
/// looks to the left.
fn assert_is(detection: &Value, row: &Row) {
    let [result] = &detection["results"].as_array().unwrap()[..] else {
        panic!("{detection}");
    };
    let class = if row.moving { "moving" } else { "standing" };
    assert_eq!(result["hypothesis"]["class_id"], class);
    let (center, size) = (&detection["bbox"]["center"], &detection["bbox"]["size"]);
    assert_eq!(*center, result["pose"]["pose"]);
    let (at, of) = (&center["position"], &result["pose"]["covariance"]);
    let found = [&at["x"], &at["y"], &size["x"], &size["y"], &of[7], &of[0]];
    let [x_m, y_m, length_m, width_m, cov_xx, cov_yy] = row.values;
    let expected = [1.0 - y_m, x_m, length_m, width_m, cov_xx, cov_yy];
    for (found, expected) in found.map(number).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
    }
    assert_eq!(number(&size["z"]), 0.0);
}

#[test]
fn a_node_of_ros_receives_the_objects_of_each_scan_as_detections_and_markers() {
    only_if!(can_speak());
    let run = Run::small().data(recording::around_a_block());
    let run = run.set("objects.kind=tracks").rate("10");
    let domain = domain(10);
    let options = ["--namespace", "/car", "--mounting", "1,0,90"];
    let bridge = Program::bridge(&run, &domain, &options);
    let peer = Program::peer("observer.py", &[&domain, "/car"]);
    run.complete();
    let topics = received(peer);
    let said = bridge.interrupt();
    let is_whole = |line: &String| line.contains("the objects of 0 scans and 0 poses missed; 0");
    assert!(said.iter().any(is_whole), "{said:?}");

    let (arrays, drawn) = (&topics["/car/objects"], &topics["/car/object_markers"]);
    assert_eq!(arrays.len(), topics["/car/odom"].len());
    assert_eq!(arrays.len(), drawn.len());
    let stamps = |messages: &[Value]| -> Vec<i64> {
        messages.iter().map(|it| stamp_ns(&it["header"])).collect()
    };
    assert_eq!(stamps(arrays), stamps(&topics["/car/odom"]));
    let scans = rows(&run);
    let of_all = scans.values().map(Vec::len).sum::<usize>();
    assert!(of_all > 20, "{of_all}");
    let with_objects = arrays.iter().zip(drawn);
    let mut with_objects =
        with_objects.filter(|(array, _)| !array["detections"].as_array().unwrap().is_empty());
    for rows in scans.values() {
        let (array, drawn) = with_objects.next().unwrap();
        assert_eq!(array["header"]["frame_id"], "odom");
        let detections = array["detections"].as_array().unwrap();
        assert_eq!(detections.len(), rows.len());
        let markers = drawn["markers"].as_array().unwrap();
        for row in rows {
            let detection = detections.iter().find(|it| it["id"] == row.object.as_str());
            assert_is(detection.unwrap(), row);
        }
        let arrows = markers.iter().filter(|it| it["ns"] == "velocities");
        let mut lengths_m: Vec<f64> = arrows.map(|it| number(&it["scale"]["x"])).collect();
        let moving = rows.iter().filter(|row| row.moving);
        let mut speeds_mps: Vec<f64> = moving.map(|row| row.speed_mps).collect();
        lengths_m.sort_by(f64::total_cmp);
        speeds_mps.sort_by(f64::total_cmp);
        assert_eq!(lengths_m.len(), speeds_mps.len());
        let pairs = lengths_m.iter().zip(&speeds_mps);
        pairs.for_each(|(length, speed)| assert!((length - speed).abs() < 1e-3));
    }
    assert!(with_objects.next().is_none());
}
