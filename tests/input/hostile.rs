//! Files made to exhaust the memory: each is refused in a sentence by a process that may not have
//! much.

use std::{
    fs::{self, File},
    os::unix::fs::symlink,
    path::Path,
    process::Command,
};

use gyre_journal as journal;
use gyre_slam::{Keyframe, Place, Query, records_path};

use crate::common::{Ended, Run, recording, undisturbed, wrapped};

/// Address space of the process, kB: twice what the program and its libraries map.
const LIMIT_KB: usize = 4_000_000;

/// `gyre` with these arguments and a limit on its memory.
fn limited(arguments: &[&str]) -> Ended {
    let mut command = Command::new(crate::PROGRAM);
    command.args(arguments);
    Ended::of(with_limit(&command))
}

fn with_limit(command: &Command) -> Command {
    let limit = format!("ulimit -v {LIMIT_KB}; exec \"$0\" \"$@\"");
    wrapped(&["sh", "-c", &limit], command)
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A file of this length that takes no room on the disk.
fn sparse(file: &Path, gigabytes: u64) {
    File::create(file)
        .unwrap()
        .set_len(gigabytes << 30)
        .unwrap();
}

#[test]
fn a_configuration_without_end_is_refused() {
    limited(&["run", "/dev/zero"]).refused_with(&["/dev/zero", "it is a device, not a file"]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.toml");
    sparse(&file, 100);
    limited(&["run", path(&file)]).refused_with(&["run.toml", "16 MB"]);
}

#[test]
fn a_configuration_of_many_brackets_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.toml");
    for text in [
        "a = ".to_owned() + &"[".repeat(1_000_000),
        "[".to_owned() + &"a.".repeat(1_000_000) + "b]",
    ] {
        fs::write(&file, text).unwrap();
        let ended = limited(&["run", path(&file)]);
        ended.refused_with(&["run.toml", "TOML parse error"]);
        assert!(ended.stderr.len() < 1000, "{}", ended.stderr);
    }
}

#[test]
fn options_of_a_recording_without_end_are_refused() {
    let copy = recording::copy(2);
    let file = copy.path().join("dataset.toml");
    let _ = fs::remove_file(&file);
    symlink("/dev/zero", &file).unwrap();
    limited(&["inspect", path(copy.path())]).refused_with(&["dataset.toml", "a device"]);
    fs::remove_file(&file).unwrap();
    sparse(&file, 100);
    limited(&["inspect", path(copy.path())]).refused_with(&["dataset.toml", "16 MB"]);
}

/// Nobody writes to these pipes, so that to open one waits for ever.
#[test]
fn a_pipe_in_place_of_a_file_is_refused_at_once() {
    let at_once = |arguments: &[&str]| {
        let mut command = Command::new(crate::PROGRAM);
        command.args(arguments);
        Ended::of(wrapped(&["timeout", "20"], &command))
    };
    let folder = tempfile::tempdir().unwrap();
    let configuration = folder.path().join("run.toml");
    fs::write(&configuration, "").unwrap();
    let out = folder.path().join("out");
    let run = |data: &str| {
        let [configuration, out] = [&configuration, &out].map(|file| path(file));
        at_once(&["run", configuration, "--data", data, "--out", out])
    };
    let is_pipe = "it is a pipe, not a file";
    let copy = recording::copy(2);
    let data = path(copy.path());
    replace_by_pipe(&copy.path().join("dataset.toml"));
    at_once(&["inspect", data]).refused_with(&["dataset.toml", is_pipe]);
    run(data).refused_with(&["dataset.toml", is_pipe]);
    let copy = recording::copy(2);
    for image in recording::images(copy.path()) {
        replace_by_pipe(&image);
    }
    at_once(&["inspect", path(copy.path())]).refused_with(&["holds no PNG images"]);
    let recorded = folder.path().join("drive.mcap");
    replace_by_pipe(&recorded);
    at_once(&["inspect", path(&recorded)]).refused_with(&["drive.mcap", is_pipe]);
    run(path(&recorded)).refused_with(&["drive.mcap", is_pipe]);
    fs::remove_file(&recorded).unwrap();
    fs::create_dir(&recorded).unwrap();
    run(path(&recorded)).refused_with(&["there is no recording", "drive.mcap"]);
    replace_by_pipe(&configuration);
    run(path(&recorded)).refused_with(&["run.toml", is_pipe]);
}

fn replace_by_pipe(file: &Path) {
    let _ = fs::remove_file(file);
    let made = Command::new("mkfifo").arg(file).status();
    assert!(made.unwrap().success(), "{}", file.display());
}

#[test]
fn the_configuration_of_a_simulated_recording_without_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    symlink("/dev/zero", folder.path().join("simulation.toml")).unwrap();
    let out = path(folder.path());
    let ended = limited(&["simulate", "--scans", "2", "--out", out]);
    ended.failed_with(&["simulation.toml", "a device"]);
}

#[test]
fn an_image_that_claims_to_be_huge_is_refused() {
    let copy = recording::copy(2);
    let images = fs::read_dir(copy.path().join("radar")).unwrap();
    for image in images.map(|entry| entry.unwrap().path()) {
        let mut bytes = fs::read(&image).unwrap();
        fs::remove_file(&image).unwrap();
        bytes[16..20].copy_from_slice(&(1_u32 << 31).to_be_bytes());
        fs::write(&image, bytes).unwrap();
    }
    limited(&["inspect", path(copy.path())]).refused_with(&["png", "too large"]);
}

#[test]
fn trajectories_and_motions_without_end_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [truth, motions] = ["truth.tum", "odometry.csv"].map(|name| folder.path().join(name));
    let estimate = folder.path().join("trajectory.tum");
    fs::write(&estimate, "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n").unwrap();
    sparse(&truth, 100);
    let evaluate = ["evaluate", "--estimate", path(&estimate), "--ground-truth"];
    limited(&[&evaluate[..], &[path(&truth)]].concat()).refused_with(&["truth.tum"]);
    sparse(&motions, 100);
    let odometry = [path(&estimate), "--odometry", path(&motions)];
    limited(&[&evaluate[..], &odometry].concat()).failed_with(&["odometry.csv", "line"]);
}

#[test]
fn a_model_and_a_card_without_end_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(crate::PROJECT).join("shared/method/masking/tests/models");
    let run = |card: &Path| {
        let model = format!("masking.model='{}'", card.display());
        let out = folder.path().join("out");
        let small = ["--set", "raster.n=127", "--set", "raster.cell_m=0.8"];
        let learned = ["--set", "masking.kind=learned", "--set", &model];
        let run = [
            "run",
            path(&folder.path().join("run.toml")),
            "--data",
            path(recording::small()),
            "--out",
            path(&out),
        ]
        .map(str::to_owned);
        let arguments: Vec<&str> = run
            .iter()
            .map(String::as_str)
            .chain(small)
            .chain(learned)
            .collect();
        limited(&arguments)
    };
    fs::write(folder.path().join("run.toml"), "").unwrap();
    run(Path::new("/dev/zero")).failed_with(&["/dev/zero", "a device"]);
    let card = folder.path().join("single-127.toml");
    fs::copy(models.join("single-127.toml"), &card).unwrap();
    sparse(&folder.path().join("single-127.onnx"), 100);
    run(&card).failed_with(&["single-127.onnx", "MB"]);
}

#[test]
fn a_journal_and_logs_of_impossible_lengths_are_refused_and_a_mended_run_goes_on() {
    let run = Run::of_recording().rate("6").set("slam.kind=graph");
    let mut running = run.start();
    running.await_poses(recording::SCANS / 2);
    running.kill_supervisor();
    let out = run.out();
    for log in [
        journal::path(out),
        records_path::<Keyframe>(out),
        records_path::<Query>(out),
        // Last: loop-closure alone reads it, and odometry goes on to its end meanwhile.
        records_path::<Place>(out),
    ] {
        let whole = fs::read(&log).unwrap();
        let file = File::options().write(true).open(&log).unwrap();
        file.set_len(1 << 40).unwrap();
        let name = log.file_name().unwrap().to_str().unwrap();
        Ended::of(with_limit(&run.command())).failed_with(&[name, "is damaged at"]);
        fs::write(&log, whole).unwrap();
    }
    assert_eq!(run.complete(), undisturbed());
}
