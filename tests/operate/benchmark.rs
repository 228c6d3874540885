//! `gyre benchmark`: the drives of a list become a table and files, and the same command continues.

use std::{fs, path::Path};

use gyre_datasets::read_trajectory;
use serde_json::Value;

use crate::common::{finished, recording};

const FOMO: &str = "red_2025-10-14-11-41";

/// The list of a drive around a block and of one that is too short for the KITTI metric, with the
/// constants of their radar.
fn write_list(list: &Path) {
    let block = recording::around_a_block();
    let constants = fs::read_to_string(block.join("dataset.toml")).unwrap();
    let constants: toml::Table = constants.parse().unwrap();
    let set = |(key, value): (&String, &toml::Value)| format!(" dataset.{key}={value}");
    let set: String = constants.iter().map(set).collect();
    let row = |name, drive: &Path| format!("{name},{},raster.n=127{set}\n", drive.display());
    let rows = row(FOMO, block) + &row("short", recording::small());
    fs::write(list, format!("name,drive,set\n{rows}")).unwrap();
}

#[test]
fn a_list_becomes_a_table_and_files_that_repeat_its_figures() {
    let folder = crate::common::folder();
    let (list, out) = (folder.path().join("list.csv"), folder.path().join("out"));
    write_list(&list);
    let first = finished!["benchmark", "oxford", &list, "--out", &out];
    first.succeeded().says("short: KITTI errors are missing");
    let table = fs::read_to_string(out.join("benchmark.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!((rows[2][0], &rows[2][3..]), ("short", &[""; 4][..]));
    assert_eq!((rows[3][0], &rows[3][3..]), ("mean", &rows[1][3..]));
    let number = |row: usize, column: usize| rows[row][column].parse::<f64>().unwrap();
    let mean_m = (number(1, 2) + number(2, 2)) / 2.0;
    assert!((number(3, 2) - mean_m).abs() < 1e-4, "{table}");
    let [estimate, truth] = ["est", "gt"].map(|side| out.join("files").join(side).join("00.txt"));
    let again = finished!["evaluate", &estimate, &truth, "--step", "4", "--json"];
    let again: Value = serde_json::from_str(&again.succeeded().stdout).unwrap();
    let percent = again["kitti"]["translation_percent"].as_f64().unwrap();
    assert!(percent < 5.0, "{table}");
    assert!((percent - number(1, 3)).abs() < 1e-4, "{percent}\n{table}");
    let second = finished!["benchmark", "oxford", &list, "--out", &out];
    second.succeeded().prints("2 had been computed before");

    let fomo = finished!["benchmark", "fomo", &list, "--out", &out];
    fomo.succeeded().prints("rpe_percent");
    let file = out.join(format!("files/{FOMO}_{FOMO}.txt"));
    let stamps = read_trajectory(&file).unwrap().stamp_ns.unwrap();
    assert!(stamps.len() > 250 && stamps.windows(2).all(|it| it[1] - it[0] == 100_000_000));
}
