//! `gyre masks` as a whole: figures and pictures of the parts of a small simulated drive that each
//! kind of mask keeps.

use std::{
    fs::{self, File},
    io::BufReader,
    path::Path,
};

use crate::common::{Ended, Run, folder, gyre, names_in, recording, runtime_is_installed};
use crate::method::learned_masks::card;
use gyre_geometry::Twist;
use nalgebra::{Isometry2, Vector2};

/// Pixels a side of a panel, each cell of 127 two wide; and around it.
const PANEL: u32 = 254;
const MARGIN: u32 = 6;

fn masks(folder: &Path, arguments: &[&str]) -> Ended {
    masks_of(recording::small(), folder, arguments)
}

fn masks_of(data: &Path, folder: &Path, arguments: &[&str]) -> Ended {
    let mut command = gyre();
    command
        .current_dir(folder)
        .args(["masks", "small.toml", "--out", "out"])
        .arg(data)
        .args(arguments);
    Ended::of(command)
}

/// The size of a picture. Its content is tested beside its drawing.
fn size(path: &Path) -> (u32, u32) {
    let file = BufReader::new(File::open(path).unwrap());
    png::Decoder::new(file).read_info().unwrap().info().size()
}

fn size_of(scans: u32, views: u32) -> (u32, u32) {
    let height = views * (PANEL + MARGIN) + MARGIN;
    (4 * PANEL + 5 * MARGIN, scans * height)
}

fn figures(ended: &Ended) -> Vec<Vec<f64>> {
    let figure = |text: &str| text.parse().unwrap_or(f64::NAN);
    ended
        .stdout
        .lines()
        .skip(1)
        .map(|line| line.split_whitespace().map(figure).collect())
        .collect()
}

#[test]
fn a_threshold_keeps_or_takes_and_no_mask_keeps_all() {
    let folder = folder();
    let ended = masks(folder.path(), &["--scans", "12,3"]);
    ended.succeeded();
    let json = masks(folder.path(), &["--scans", "12,3", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json.succeeded().stdout).unwrap();
    for (row, object) in figures(&ended).iter().zip(json.as_array().unwrap()) {
        assert_eq!(object["scan"].as_f64(), Some(row[0]));
        let percent = object["power_percent"].as_f64().unwrap();
        assert!((percent - row[1]).abs() < 0.051, "{percent} {}", row[1]);
    }
    assert_eq!(
        names_in(&folder.path().join("out")),
        ["masks.png", "scan-000003.png", "scan-000012.png"]
    );
    let out = folder.path().join("out");
    assert_eq!(size(&out.join("scan-000003.png")), size_of(1, 1));
    assert_eq!(size(&out.join("masks.png")), size_of(2, 1));
    for line in figures(&ended) {
        let [power, above_floor, cells, points] = line[1..5] else {
            panic!("{line:?}")
        };
        let keeps_some = [power, cells].iter().all(|it| (1.0..60.0).contains(it));
        assert!(keeps_some, "{line:?}");
        assert_eq!((above_floor, points), (100.0, 100.0));
    }

    let arguments = ["--scans", "3", "--set", "masking.kind=none"];
    let ended = masks(folder.path(), &arguments);
    let all = [3.0, 100.0, 100.0, 100.0, 100.0];
    assert_eq!(figures(ended.succeeded())[0][..5], all);
}

#[test]
fn a_network_weighs_one_scan_or_both_of_a_pair_and_the_points() {
    if !runtime_is_installed() {
        return;
    }
    let folder = folder();
    for (model, views) in [("single-127", 1), ("pair-127", 2)] {
        let kind = "--set=masking.kind=learned";
        let model = format!("--set=masking.model='{}'", card(model).display());
        // The first one of the chain stands for its own scan before. The whole mask counts: by its
        // root no point of this model has a factor below 0.5.
        let set = "--set=masking.point_exponent=1";
        let arguments = [
            "--scans=0,20",
            kind,
            &model,
            "--set=masking.threshold=20",
            set,
        ];
        let ended = masks(folder.path(), &arguments);
        let figures = figures(ended.succeeded());
        assert_eq!((figures[0][0], figures[1][0]), (0.0, 20.0));
        for line in figures {
            let mut percents = line[1..5].iter();
            let weighs = percents.all(|percent| (0.1..99.9).contains(percent));
            assert!(weighs && line[1] < line[2], "{line:?}");
        }
        for name in ["scan-000000.png", "scan-000020.png"] {
            let path = folder.path().join("out").join(name);
            assert_eq!(size(&path), size_of(1, views), "{model}");
        }
    }
}

#[test]
fn sweeps_are_undone_by_the_motions_that_a_run_undoes_them_by() {
    let folder = folder();
    let printed = figures(masks(folder.path(), &["--every", "1"]).succeeded());
    assert_eq!(printed.len(), recording::SCANS);
    // Nothing is known two scans before the third.
    assert!(
        printed[..3].iter().all(|line| line[5].is_nan())
            && printed[3..].iter().all(|line| line[5].is_finite())
    );

    let csv = Run::of_recording().set("refinement.kind=none").complete();
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let places = ["x_m", "y_m", "yaw_rad", "interval_ns"]
        .map(|name| header.iter().position(|column| *column == name).unwrap());
    for (row, line) in lines.zip(&printed[3..]) {
        let [x, y, yaw, interval_ns] = places.map(|place| row[place].parse::<f64>().unwrap());
        let twist =
            Twist::from_motion(&Isometry2::new(Vector2::new(x, y), yaw), interval_ns * 1e-9);
        let found = [twist.vx_mps, twist.yaw_rate_radps.to_degrees()];
        let mut both = found.iter().zip(&line[5..]);
        let is_near = both.all(|(run, here)| (run - here).abs() < 0.0051);
        assert!(is_near, "{found:?}: {line:?}");
    }

    // Where the scans are far apart those between them are not all looked at: the motions differ by
    // their noise.
    let far_apart = figures(masks(folder.path(), &["--scans", "0,23"]).succeeded());
    let all = &printed[23];
    let near = |figure: usize, most: f64| (far_apart[1][figure] - all[figure]).abs() < most;
    assert!(
        near(1, 0.2) && near(3, 0.5) && near(5, 0.5) && near(6, 3.0),
        "{far_apart:?}: {all:?}"
    );
}

#[test]
fn scans_that_lost_azimuths_are_drawn_as_they_are_matched() {
    let folder = folder();
    let lossy = recording::of_radiate(true);
    let all = ["--every", "1", "--set", "masking.kind=none"];
    let printed = figures(masks_of(&lossy, folder.path(), &all).succeeded());
    assert_eq!(printed.len(), recording::SCANS);
    for row in printed {
        assert_eq!(row[1], 100.0, "scan {}: no mask keeps all", row[0]);
    }
}

#[test]
fn a_simulation_is_drawn_as_it_is_rendered() {
    let folder = folder();
    let simulated = "[raster]\nn = 127\ncell_m = 0.8\n[simulation]\nscans = 5\n";
    fs::write(folder.path().join("simulated.toml"), simulated).unwrap();
    let mut command = gyre();
    command
        .current_dir(folder.path())
        .args(["masks", "simulated.toml", "--every", "2"]);
    Ended::of(command).succeeded();
    for name in ["masks.png", "scan-000004.png"] {
        let file = folder.path().join("out/masks").join(name);
        assert!(file.is_file(), "{name}");
    }
}

#[test]
fn unreadable_scans_are_left_out_and_reported() {
    let folder = folder();
    let damaged = recording::copy(8);
    recording::truncate(&recording::images(damaged.path())[4], 100_000);
    let ended = masks_of(damaged.path(), folder.path(), &["--scans", "4,5"]);
    let said = &ended.succeeded().stderr;
    assert!(said.starts_with("left out: "), "{said}");
    let drawn = names_in(&folder.path().join("out"));
    assert_eq!(drawn, ["masks.png", "scan-000005.png"]);
    masks_of(damaged.path(), folder.path(), &["--scans", "4"])
        .failed_with(&["none of the chosen scans can be read"]);
}
