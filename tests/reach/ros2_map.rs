//! Tests of the messages to a peer in ROS 2 from a run with SLAM: a frame of the map, and the map.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    common::{Run, finished, recording},
    reach::{
        only_if,
        ros2::{Program, can_speak, domain, has_ros, number, received, stamp_ns, transforms},
    },
};

#[test]
fn a_run_with_slam_has_a_map_frame_and_a_map() {
    only_if!(can_speak() && has_ros());
    let data = recording::around_a_block();
    let run = Run::small().data(data).set("slam.kind=graph").rate("20");
    let domain = domain(1);
    let options = [
        "--namespace",
        "/car",
        "--frames",
        "world,odo,car,top",
        "--mounting",
        "1,0,90",
        "--tf-ahead-s",
        "0.25",
    ];
    let mut bridge = Program::bridge(&run, &domain, &options);
    let peer = Program::peer("observer.py", &[&domain, "/car"]);
    let mut node = Program::node(&domain, &["/car"]);
    run.complete();
    bridge.await_end();
    node.await_words("\"topic\": \"/car/map\"");
    let mut topics = received(node);
    topics.extend(received(peer));

    let odometry = &topics["/car/odom"];
    assert_eq!(odometry[0]["header"]["frame_id"], "odo");
    let transformed = transforms(&topics["/tf"]);
    let stamps = |of: &str, ahead_ns| -> Vec<i64> {
        let found = transformed.iter().filter(|it| it.1 == of);
        found.map(|it| it.0 - ahead_ns).collect()
    };
    let of_odometry = stamps("odo -> car", 0);
    assert_eq!(of_odometry.len(), odometry.len());
    // The transform of the map is dated ahead.
    assert_eq!(stamps("world -> odo", 250_000_000), of_odometry);
    // The radar looks to the left of the car, which so drives to the right of the radar's first
    // scan.
    let (_, mounted, values) = &transforms(&topics["/tf_static"])[0];
    assert_eq!(mounted, "car -> top");
    let apart = [values[0] - 1.0, values[2] - values[3]];
    assert!(apart.iter().all(|it| it.abs() < 1e-12), "{values:?}");
    let message = topics["/car/map"].last().unwrap();
    assert_eq!(message["header"]["frame_id"], "world");
    let map = Grid::of(message);
    assert!(map.count(OCCUPIED) > 100 && map.count(FREE) > map.count(OCCUPIED));
    let places = occupied_in_pgm(&run);
    let share = |of_car: fn([f64; 2]) -> [f64; 2]| {
        let cells = places.iter().map(|place| map.at(of_car(*place)));
        cells.filter(|cell| *cell == Some(OCCUPIED)).count() as f64 / places.len() as f64
    };
    let (turned, as_of_radar) = (share(|[x, y]| [1.0 - y, x]), share(|place| place));
    assert!(turned > 0.8 && as_of_radar < 0.5, "{turned} {as_of_radar}");
}

#[test]
fn a_node_of_ros_receives_the_places_in_the_map_of_an_earlier_drive() {
    only_if!(has_ros());
    let data = recording::around_a_block();
    let earlier = Run::small().data(data).set("slam.kind=graph");
    earlier.complete();
    let map = earlier.folder().join("map");
    finished!["map", earlier.out(), "--format=folder", "--out", &map].succeeded();
    let run = Run::small().data(data).set("slam.kind=graph").rate("10");
    let run = run.set(&format!("slam.map='{}'", map.display()));
    let domain = domain(17);
    let mut bridge = Program::bridge(&run, &domain, &[]);
    let node = Program::node(&domain, &["/"]);
    run.complete();
    bridge.await_end();
    let topics = received(node);

    let fixes = &topics["/map_fix"];
    assert!(fixes.len() > 40, "{}", fixes.len());
    let place = |message: &Value| {
        let at = &message["pose"]["pose"]["position"];
        (
            stamp_ns(&message["header"]),
            ["x", "y"].map(|axis| number(&at[axis])),
        )
    };
    let poses: BTreeMap<i64, [f64; 2]> = topics["/odom"].iter().map(place).collect();
    for fix in fixes {
        assert_eq!(fix["header"]["frame_id"], "saved_map");
        // The drive is the same, and its first scan is the first keyframe of the map.
        let (stamp, at) = place(fix);
        let apart = [0, 1].map(|axis: usize| (at[axis] - poses[&stamp][axis]).abs());
        assert!(apart.iter().all(|it| *it < 1.5), "{fix} {apart:?}");
        let variance = number(&fix["pose"]["covariance"][0]);
        assert!(variance > 0.0 && variance < 1.0, "{variance}");
    }
}

const FREE: u8 = 0;
const OCCUPIED: u8 = 100;

/// The places of the occupied cells in the map of a run along the radar's axes.
fn occupied_in_pgm(run: &Run) -> Vec<[f64; 2]> {
    let folder = run.folder().join("map");
    finished!["map", run.out(), "--out", &folder, "--format", "pgm"].succeeded();
    let yaml = std::fs::read_to_string(folder.join("map.yaml")).unwrap();
    let value = |key: &str| yaml.split_once(key).unwrap().1.lines().next().unwrap();
    let cell_m: f64 = value("resolution: ").parse().unwrap();
    let origin = value("origin: [").split(", ");
    let origin: Vec<f64> = origin.filter_map(|number| number.parse().ok()).collect();
    let picture = std::fs::read(folder.join("map.pgm")).unwrap();
    let header = picture.split(|byte| *byte == b'\n').nth(1).unwrap();
    let size = String::from_utf8(header.to_vec()).unwrap();
    let size: Vec<usize> = size.split(' ').map(|side| side.parse().unwrap()).collect();
    let pixels = &picture[picture.len() - size[0] * size[1]..];
    let occupied = (0..pixels.len()).filter(|index| pixels[*index] == 0);
    occupied
        .map(|index| {
            let (column, row) = (index % size[0], size[1] - 1 - index / size[0]);
            [0, 1].map(|axis: usize| origin[axis] + ([column, row][axis] as f64 + 0.5) * cell_m)
        })
        .collect()
}

/// A map as Nav2 takes it, whose origin has no rotation.
struct Grid {
    origin: [f64; 2],
    cell_m: f64,
    width: usize,
    cells: Vec<u8>,
}

impl Grid {
    fn of(message: &Value) -> Self {
        let (info, origin) = (&message["info"], &message["info"]["origin"]);
        let turn = ["x", "y", "z", "w"].map(|part| number(&origin["orientation"][part]));
        assert_eq!(turn, [0.0, 0.0, 0.0, 1.0]);
        let runs = message["data"].as_array().unwrap();
        let runs = runs
            .iter()
            .map(|run| [0, 1].map(|part: usize| run[part].as_u64().unwrap()));
        let cells = runs.flat_map(|[value, count]| vec![value as u8; count as usize]);
        let cells: Vec<u8> = cells.collect();
        let width = info["width"].as_u64().unwrap() as usize;
        assert_eq!(number(&info["height"]) * width as f64, cells.len() as f64);
        Self {
            origin: ["x", "y"].map(|axis| number(&origin["position"][axis])),
            cell_m: number(&info["resolution"]),
            width,
            cells,
        }
    }

    fn count(&self, value: u8) -> usize {
        self.cells.iter().filter(|cell| **cell == value).count()
    }

    /// The cell at a place; `None` outside.
    fn at(&self, [x_m, y_m]: [f64; 2]) -> Option<u8> {
        let [column, row] =
            [x_m - self.origin[0], y_m - self.origin[1]].map(|at_m| (at_m / self.cell_m).floor());
        let is_inside = (0.0..self.width as f64).contains(&column) && row >= 0.0;
        let index = row as usize * self.width + column as usize;
        self.cells.get(index).copied().filter(|_| is_inside)
    }
}
