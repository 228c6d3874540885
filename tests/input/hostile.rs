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

/// Address space of the process, kB: twice the mapped size of the program and its libraries.
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

/// A file of 100 GB that takes no room on the disk.
fn sparse(file: &Path) {
    File::create(file).unwrap().set_len(100 << 30).unwrap();
}

/// Files are opened by one reader, which has tests of its own; here, each command reads by it.
#[test]
fn files_without_end_are_refused_whatever_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let huge = |name: &str| {
        sparse(&file(name));
        file(name)
    };
    let (run, truth, motions) = (huge("run.toml"), huge("truth.tum"), huge("odometry.csv"));
    let estimate = file("trajectory.tum");
    fs::write(&estimate, "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n").unwrap();
    let endless = recording::copy(2);
    let settings = endless.path().join("dataset.toml");
    let _ = fs::remove_file(&settings);
    symlink("/dev/zero", &settings).unwrap();
    let simulated = tempfile::tempdir().unwrap();
    symlink("/dev/zero", simulated.path().join("simulation.toml")).unwrap();
    let models = Path::new(crate::PROJECT).join("shared/method/masking/tests/models");
    let card = file("single-127.toml");
    fs::copy(models.join("single-127.toml"), &card).unwrap();
    huge("single-127.onnx");
    let (out, small) = (file("out"), path(recording::small()));
    let learned = |card: &Path| {
        let run = ["run", small, "--out", path(&out)].join("\n");
        let model = format!(
            "masking.kind=learned\n--set\nmasking.model='{}'",
            path(card)
        );
        format!("{run}\n--set\nraster.n=127\n--set\nraster.cell_m=0.8\n--set\n{model}")
    };
    let evaluate = format!("evaluate\n{}", path(&estimate));
    let motions = format!("{}\n--odometry\n{}", path(&estimate), path(&motions));
    let simulate = format!("simulate\n--out\n{}", path(simulated.path()));
    let inspect = |data: &Path| format!("inspect\n{}", path(data));
    // The arguments by lines.
    for (arguments, expected) in [
        ("run\n/dev/zero".to_owned(), ["/dev/zero", "it is a device"]),
        (format!("run\n{}", path(&run)), ["run.toml", "16 MB"]),
        (inspect(endless.path()), ["dataset.toml", "a device"]),
        (simulate, ["simulation.toml", "a device"]),
        (format!("{evaluate}\n{}", path(&truth)), ["truth.tum", ""]),
        (format!("{evaluate}\n{motions}"), ["odometry.csv", "line"]),
        (learned(Path::new("/dev/zero")), ["/dev/zero", "a device"]),
        (learned(&card), ["single-127.onnx", "MB"]),
    ] {
        let arguments: Vec<&str> = arguments.lines().collect();
        limited(&arguments).failed_with(&expected);
    }
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
    let [configuration, recorded] = ["run.toml", "drive.mcap"].map(|name| folder.path().join(name));
    let (options, images) = (recording::copy(2), recording::copy(2));
    replace_by_pipe(&options.path().join("dataset.toml"));
    recording::images(images.path())
        .iter()
        .for_each(|image| replace_by_pipe(image));
    replace_by_pipe(&configuration);
    replace_by_pipe(&recorded);
    let is_pipe = "it is a pipe, not a file";
    for (command, file, words) in [
        ("inspect", options.path(), ["dataset.toml", is_pipe]),
        ("inspect", images.path(), ["holds no PNG images", ""]),
        ("inspect", &recorded, ["drive.mcap", is_pipe]),
        ("run", &configuration, ["run.toml", is_pipe]),
    ] {
        at_once(&[command, path(file)]).refused_with(&words);
    }
    for data in [options.path(), &recorded] {
        let out = folder.path().join("out");
        at_once(&["run", path(data), "--out", path(&out)]).refused_with(&[is_pipe]);
    }
}

fn replace_by_pipe(file: &Path) {
    let _ = fs::remove_file(file);
    let made = Command::new("mkfifo").arg(file).status();
    assert!(made.unwrap().success(), "{}", file.display());
}

#[test]
fn a_journal_and_logs_of_impossible_lengths_are_refused_and_a_mended_run_goes_on() {
    let run = Run::of_recording().rate("6").set("slam.kind=graph");
    let running = run.started(recording::SCANS / 2);
    running.kill_supervisor();
    let out = run.out();
    for log in [
        journal::path(out),
        records_path::<Keyframe>(out),
        records_path::<Query>(out),
        // Last: only loop-closure reads this log, and odometry continues to its end meanwhile.
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
