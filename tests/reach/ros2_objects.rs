//! Tests of the messages to a peer in ROS 2 from a run that tracks objects.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    common::{Run, odometry, recording},
    reach::{
        only_if,
        ros2::{Program, can_speak, domain, has_ros, number, received, stamp_ns},
    },
};

/// The places of the objects by identity, of each scan that has some.
type Places = BTreeMap<String, [f64; 2]>;

/// Returns the places of `objects.csv`, in the order of the scans, as a car sees them whose radar,
/// a metre ahead of its origin, looks to the left.
fn expected(run: &Run) -> Vec<Places> {
    let names = ["stamp_ns", "object", "x_m", "y_m"];
    let mut scans: BTreeMap<i64, Places> = BTreeMap::new();
    for row in odometry::columns(&run.result("objects.csv"), &names) {
        let [x_m, y_m] = [2, 3].map(|column: usize| row[column].parse::<f64>().unwrap());
        let places = scans.entry(row[0].parse().unwrap()).or_default();
        places.insert(row[1].clone(), [1.0 - y_m, x_m]);
    }
    scans.into_values().collect()
}

fn seen(array: &Value) -> Places {
    assert_eq!(array["header"]["frame_id"], "odom");
    let place = |it: &Value| {
        let at = &it["bbox"]["center"]["position"];
        let id = it["id"].as_str().unwrap().to_owned();
        (id, [number(&at["x"]), number(&at["y"])])
    };
    let detections = array["detections"].as_array().unwrap();
    detections.iter().map(place).collect()
}

#[test]
fn a_node_of_ros_receives_the_objects_of_each_scan_as_detections_and_markers() {
    only_if!(can_speak() && has_ros());
    let run = Run::small().data(recording::around_a_block());
    let run = run.set("objects.kind=tracks").rate("10");
    let domain = domain(10);
    let options = ["--namespace", "/car", "--mounting", "1,0,90"];
    let mut bridge = Program::bridge(&run, &domain, &options);
    let peer = Program::peer("observer.py", &[&domain, "/car"]);
    let node = Program::node(&domain, &["/car"]);
    run.complete();
    let said = bridge.await_end();
    let mut topics = received(node);
    topics.extend(received(peer));
    let whole = "the objects of 0 scans and 0 poses missed; 0";
    assert!(said.contains(whole), "{said}");

    let (arrays, drawn) = (&topics["/car/objects"], &topics["/car/object_markers"]);
    assert_eq!(arrays.len(), topics["/car/odom"].len());
    assert_eq!(arrays.len(), drawn.len());
    let stamps = |messages: &[Value]| -> Vec<i64> {
        messages.iter().map(|it| stamp_ns(&it["header"])).collect()
    };
    assert_eq!(stamps(arrays), stamps(&topics["/car/odom"]));
    let expected = expected(&run);
    let of_all = expected.iter().map(BTreeMap::len).sum::<usize>();
    assert!(of_all > 20, "{of_all}");
    let pairs = arrays.iter().map(seen).zip(drawn);
    let pairs: Vec<_> = pairs.filter(|(places, _)| !places.is_empty()).collect();
    assert_eq!(pairs.len(), expected.len());
    for ((seen, drawn), expected) in pairs.iter().zip(&expected) {
        assert!(seen.keys().eq(expected.keys()), "{seen:?} {expected:?}");
        for (seen, expected) in seen.values().zip(expected.values()) {
            let is_near = (0..2).all(|axis| (seen[axis] - expected[axis]).abs() < 1e-3);
            assert!(is_near, "{seen:?} {expected:?}");
        }
        let markers = drawn["markers"].as_array().unwrap().iter();
        let boxes = markers.filter(|it| it["ns"] == "boxes").count();
        assert_eq!(boxes, expected.len());
    }
}
