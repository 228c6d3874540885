//! Tests of the messages to a peer in ROS 2 from a run that tracks objects. That detections and
//! markers have all that the results have is a test of `input::bags`.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    common::{Run, odometry, recording},
    reach::{
        only_if,
        ros2::{Program, can_speak, domain, number, received, stamp_ns},
    },
};

/// Objects by their identities: x and y, m.
type Places = BTreeMap<String, [f64; 2]>;

/// The objects of a run by the times of their scans, by `objects.csv`.
fn rows(run: &Run) -> BTreeMap<i64, Places> {
    let names = ["stamp_ns", "object", "x_m", "y_m"];
    let mut scans: BTreeMap<i64, Places> = BTreeMap::new();
    for row in odometry::columns(&run.result("objects.csv"), &names) {
        let place = [2, 3].map(|column: usize| row[column].parse().unwrap());
        let scan = scans.entry(row[0].parse().unwrap()).or_default();
        scan.insert(row[1].clone(), place);
    }
    scans
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
    assert_eq!(arrays.len(), drawn.len());
    let stamps = |messages: &[Value]| -> Vec<i64> {
        messages.iter().map(|it| stamp_ns(&it["header"])).collect()
    };
    assert_eq!(stamps(arrays), stamps(&topics["/car/odom"]));
    let scans = rows(&run);
    let of_all = scans.values().map(BTreeMap::len).sum::<usize>();
    assert!(of_all > 20, "{of_all}");
    let is_empty = |it: &&Value| it["detections"].as_array().unwrap().is_empty();
    let arrays = arrays.iter().filter(|it| !is_empty(it));
    let arrays: Vec<&Value> = arrays.collect();
    assert_eq!(arrays.len(), scans.len());
    for (array, rows) in arrays.into_iter().zip(scans.values()) {
        assert_eq!(array["header"]["frame_id"], "odom");
        let detections = array["detections"].as_array().unwrap();
        assert_eq!(detections.len(), rows.len());
        for detection in detections {
            // From a car whose radar, a metre ahead of its origin, looks to the left.
            let [x_m, y_m] = rows[detection["id"].as_str().unwrap()];
            let at = &detection["bbox"]["center"]["position"];
            let apart = [number(&at["x"]) - (1.0 - y_m), number(&at["y"]) - x_m];
            assert!(
                apart.iter().all(|it| it.abs() < 1e-3),
                "{detection} {rows:?}"
            );
        }
    }
}
