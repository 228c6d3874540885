//! Bad input: one clear sentence and a failure before anything starts, or a scan that is skipped,
//! counted, and no more.

use std::{fs, path::Path};

use gyre_stage::run::SHARED_MEMORY;

use crate::common::{Ended, Run, STAGES, odometry, recording};

/// A run of another folder than the recording's.
fn run_of(folder: &Path) -> Run {
    Run::configured("[raster]\nn = 127\ncell_m = 0.8\n").data(folder)
}

fn configured(text: &str) -> Ended {
    Run::configured(text).data(recording::small()).finish()
}

// Data.

#[test]
fn no_data_are_named() {
    Run::configured("")
        .finish()
        .refused_with(&["--data", "source.data"]);
}

#[test]
fn the_data_are_missing() {
    run_of(Path::new("/nowhere/at/all"))
        .finish()
        .refused_with(&["/nowhere/at/all", "no such folder"]);
}

#[test]
fn the_data_are_a_file() {
    let run = Run::configured("");
    let file = run.folder().join("scan.png");
    fs::write(&file, "").unwrap();
    run.data(&file)
        .finish()
        .refused_with(&["scan.png is a file", "folder"]);
}

#[test]
fn the_folder_is_empty() {
    let folder = tempfile::tempdir().unwrap();
    run_of(folder.path())
        .finish()
        .refused_with(&[folder.path().to_str().unwrap(), "no PNG images"]);
}

#[test]
fn the_folder_holds_other_things() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "buy milk").unwrap();
    run_of(folder.path())
        .finish()
        .refused_with(&["not a known dataset", "no PNG images"]);
}

#[test]
fn one_scan_makes_no_motion() {
    let recording = recording::copy(1);
    run_of(recording.path())
        .finish()
        .refused_with(&["has 1 scan:", "a motion is between two"]);
    Run::of_recording()
        .set("source.first=23")
        .finish()
        .refused_with(&["has 1 scan:", "a motion is between two"]);
    let beyond = Run::of_recording().set("source.first=24").finish();
    beyond.refused_with(&["source.first is 24", "24 scans, from 0 to 23"]);
}

#[test]
fn an_image_that_is_not_an_image_is_reported() {
    let recording = recording::copy(3);
    for image in recording::images(recording.path()) {
        recording::truncate(&image, 0);
    }
    run_of(recording.path())
        .finish()
        .refused_with(&["first image", ".png"]);
}

#[test]
fn a_dataset_of_truncated_images_alone_is_reported() {
    let recording = recording::copy(3);
    for image in recording::images(recording.path()) {
        recording::truncate(&image, 5000);
    }
    run_of(recording.path())
        .finish()
        .failed_with(&["only 0 of the 3 scans", "log.jsonl"]);
}

// A bad scan among good ones.

/// Damages scan `bad` of eight, and asserts that it alone is left out.
fn skips(bad: usize, reason: &str, damage: impl FnOnce(&Path)) {
    let recording = recording::copy(8);
    damage(&recording::images(recording.path())[bad]);
    let run = run_of(recording.path());
    run.finish().succeeded();
    let summary = run.summary();
    assert_eq!(
        (
            &summary["published"],
            &summary["processed"],
            &summary["unreadable"]
        ),
        (&7.into(), &7.into(), &1.into())
    );
    assert_eq!(
        (&summary["dropped"], &summary["breaks"]),
        (&0.into(), &0.into())
    );
    let rows = odometry::rows(&run.odometry());
    odometry::assert_unbroken(&rows);
    assert!(
        rows.len() == 6 && rows.iter().all(|row| row.scan != bad as u64),
        "{rows:?}"
    );
    let log = run.result("log.jsonl");
    let reported = log
        .lines()
        .filter(|line| line.contains("WARN") && line.contains(reason))
        .count();
    assert_eq!(reported, 1, "{log}");
}

#[test]
fn a_truncated_first_image_is_skipped() {
    skips(0, "truncated", |image| recording::truncate(image, 100_000));
}

#[test]
fn an_empty_first_image_is_skipped() {
    skips(0, "", |image| recording::truncate(image, 0));
}

#[test]
fn a_truncated_image_in_the_middle_is_skipped() {
    skips(4, "truncated", |image| recording::truncate(image, 100_000));
}

#[test]
fn a_truncated_last_image_is_skipped() {
    skips(7, "truncated", |image| recording::truncate(image, 100_000));
}

#[test]
fn an_image_of_another_size_is_skipped() {
    skips(4, "most images of the dataset are", |image| {
        recording::resize(image, 1000, 400)
    });
}

#[test]
fn an_image_on_its_side_is_skipped_and_called_so() {
    skips(4, "rotated by 90 degrees", |image| {
        recording::resize(image, 400, 587)
    });
}

// Configuration.

#[test]
fn an_unknown_key_is_named_with_the_nearest_right_one() {
    configured("[masking]\ntreshold = 3").refused_with(&[
        "[masking]",
        "`treshold`",
        "did you mean `threshold`?",
    ]);
}

#[test]
fn an_unknown_section_is_named_with_the_nearest_right_one() {
    configured("[rotatoin]\nform = 'eq7'")
        .refused_with(&["`rotatoin`", "did you mean `rotation`?"]);
    configured("[stages.maskin]\ncommand = ['x']")
        .refused_with(&["`maskin`", "did you mean `masking`?"]);
}

#[test]
fn an_impossible_value_is_reported_with_what_is_possible() {
    for (text, words) in [
        ("[run]\nwindow = 0", ["run.window is 0", "1 to 64"]),
        ("[run]\nwindow = -3", ["[run]", "-3"]),
        ("[run]\nrate = 'fast'", ["rate is `fast`", "`realtime`"]),
        ("[run]\nmode = 'live'", ["live", "rate"]),
        ("[raster]\nn = 0", ["raster", "n"]),
        ("[raster]\ncell_m = -1.0", ["raster", "cell_m"]),
        ("[masking]\nkind = 'magic'", ["magic", "threshold"]),
        ("[masking]\nthreshold = 300", ["[masking]", "300"]),
        ("[masking]\nlag = 99", ["masking.lag is 99", "16"]),
        ("[rotation]\nband_high = 7.0", ["rotation", "band_high"]),
        (
            "[points]\ncapacity = 0",
            ["points.capacity is 0", "1 or more"],
        ),
        (
            "[refinement]\nkind = 'global-map'",
            ["global-map", "local-map"],
        ),
        (
            "[refinement]\nkeyframes = 0",
            ["refinement.keyframes = 0", "1 to 64"],
        ),
        (
            "[refinement]\ncell_m = -0.4",
            ["refinement.cell_m = -0.4", "0.05 to 10"],
        ),
        (
            "[refinement]\nreach_m = 1.0",
            ["refinement.reach_m = 1", "8 to 1000 cells"],
        ),
        (
            "[refinement]\nmin_overlap = 1.5",
            ["refinement.min_overlap = 1.5", "0 to 1"],
        ),
        (
            "[refinement]\nvariance_scale = nan",
            ["refinement.variance_scale = NaN", "positive"],
        ),
        ("[dataset]\nformat = 'oxfort'", ["oxfort", "oxford"]),
        ("[simulation]\nscans = 0", ["simulation", "scans"]),
        ("[simulation.drive]\nspeed_mps = 1e9", ["speed_mps", "40"]),
        (
            "[stages.masking]\nrestart = { limit = -1 }",
            ["masking", "-1"],
        ),
        (
            "[stages.masking]\nrestart = { window_s = -1.0 }",
            ["stages.masking", "window_s is -1"],
        ),
        (
            "[run]\nstall_timeout_s = inf",
            ["stall_timeout_s is inf", "0 or more"],
        ),
    ] {
        let ended = configured(text);
        assert_ne!(ended.code(), Some(0), "accepted: {text}");
        ended.refused_with(&words);
    }
}

#[test]
fn a_time_longer_than_any_run_is_no_limit() {
    let run = Run::of_recording()
        .set("run.stall_timeout_s=1e300")
        .set("stages.masking.restart.window_s=1e300");
    run.finish().succeeded();
}

#[test]
fn a_value_of_the_wrong_type_is_reported_with_its_section() {
    configured("[masking]\nthreshold = 'high'").refused_with(&["[masking]", "threshold"]);
    configured("masking = 3").refused_with(&["masking"]);
}

#[test]
fn an_override_without_key_or_value_is_reported() {
    for sentence in ["masking", "threshold=3", "=", "masking.threshold"] {
        Run::of_recording().set(sentence).finish().refused_with(&[
            "--set",
            sentence,
            "section.key=value",
        ]);
    }
    Run::of_recording()
        .set("masking.treshold=3")
        .finish()
        .refused_with(&["did you mean `threshold`?"]);
    Run::of_recording()
        .set("masking.threshold=300")
        .finish()
        .refused_with(&["300"]);
}

#[test]
fn a_missing_configuration_is_reported() {
    Run::of_file(Path::new("no/such.toml"))
        .finish()
        .refused_with(&["no/such.toml", "No such file"]);
}

#[test]
fn a_configuration_that_is_not_toml_is_reported_with_the_place() {
    configured("[raster]\nn = = 3").refused_with(&["test.toml", "line 2"]);
}

#[test]
fn a_bad_rate_on_the_command_line_is_reported() {
    let ended = Run::of_recording().rate("fast").finish();
    assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("--rate") && ended.stderr.contains("`realtime`"),
        "{}",
        ended.stderr
    );
}

// The machine.

#[test]
fn a_stage_command_that_does_not_exist_is_reported() {
    for stage in STAGES {
        let run =
            Run::of_recording().set(&format!("stages.{stage}.command=['/no/such/program', 'x']"));
        run.finish()
            .failed_with(&["cannot start", stage, "/no/such/program x", "No such file"]);
    }
}

#[test]
fn an_unknown_stage_and_a_stage_without_a_run_are_reported() {
    let stage = |name| {
        let mut command = crate::common::gyre();
        command.args(["stage", name]).env_remove("GYRE_RUN");
        Ended::of(command)
    };
    stage("maskin").refused_with(&["`maskin`", "masking"]);
    let ended = stage("masking");
    assert_eq!(ended.code(), Some(2));
    assert!(
        ended.stderr.lines().count() == 1 && ended.stderr.contains("gyre run"),
        "{}",
        ended.stderr
    );
}

#[test]
fn results_that_cannot_be_written_are_reported() {
    let run = Run::of_recording();
    let file = run.folder().join("file");
    fs::write(&file, "").unwrap();
    run.into(&file.join("out"))
        .finish()
        .refused_with(&["cannot write to", "file/out"]);
}

#[test]
fn a_journal_of_another_program_is_reported() {
    let run = Run::of_recording();
    fs::create_dir_all(run.out().join("journal")).unwrap();
    fs::write(
        run.out().join("journal/poses.journal"),
        "dear diary, today I drove around the block",
    )
    .unwrap();
    run.finish()
        .refused_with(&["poses.journal", "not a journal", "--out"]);
}

#[test]
fn a_journal_of_another_version_is_refused_until_it_may_be_replaced() {
    let run = Run::of_recording();
    let undisturbed = run.complete();
    let path = run.out().join("journal/poses.journal");
    let mut bytes = fs::read(&path).unwrap();
    bytes[..16].copy_from_slice(b"gyre journal v9 ");
    fs::write(&path, bytes).unwrap();
    run.finish()
        .refused_with(&["poses.journal", "another version", "--fresh"]);
    assert_eq!(run.option("--fresh").complete(), undisturbed);
}

#[test]
fn too_little_shared_memory_is_reported_with_the_need_before_the_first_scan() {
    let run = Run::of_recording();
    let Some(command) = run.with_tmpfs(Path::new(SHARED_MEMORY), "size=1m") else {
        return;
    };
    let ended = run.start_as(command).finish();
    ended.refused_with(&[
        "/dev/shm has 1.0 MB free",
        "the run needs",
        "MB of shared memory",
        "--shm-size",
    ]);
    assert!(!run.out().join("journal").exists(), "before the first scan");
}

#[test]
fn shared_memory_that_cannot_be_written_is_reported() {
    let run = Run::of_recording();
    let Some(command) = run.with_tmpfs(Path::new(SHARED_MEMORY), "ro,size=1g") else {
        return;
    };
    run.start_as(command)
        .finish()
        .refused_with(&["/dev/shm", "writable tmpfs"]);
}

#[test]
fn just_enough_shared_memory_suffices() {
    let run = Run::of_recording();
    let Some(small) = run.with_tmpfs(Path::new(SHARED_MEMORY), "size=1m") else {
        return;
    };
    let said = run.start_as(small).finish().stderr;
    let needed: f64 = said
        .split("needs ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let size = format!("size={}k", (needed * 1e6 / 1024.0) as u64 + 200);
    run.start_as(run.with_tmpfs(Path::new(SHARED_MEMORY), &size).unwrap())
        .finish()
        .succeeded();
}
