//! The folder of the results: whole files, one run at a time, nothing lost and nothing of others
//! removed.

use std::{
    fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
};

use crate::{
    common::{
        Ended, Run, finished, names_in,
        recording::{self, MIDDLE, MODERATE},
        undisturbed, with_mount,
    },
    restart::faults::configurations,
};

pub fn interrupted() -> Run {
    let run = Run::of_recording();
    run.interrupt(MODERATE, MIDDLE);
    run
}

/// The results could not be written at the first attempt: an earlier summary does not make the run
/// complete.
#[test]
fn results_that_could_not_be_written_are_written_by_the_next_run_from_the_journal() {
    let run = interrupted();
    let csv = run.out().join("odometry.csv");
    fs::remove_file(&csv).unwrap();
    fs::create_dir(&csv).unwrap();
    run.finish()
        .failed_with(&["cannot write", "odometry.csv", "Is a directory"]);
    assert!(
        run.out().join("summary.json").exists(),
        "of the interrupted run"
    );
    fs::remove_dir(&csv).unwrap();
    let ended = run.finish();
    ended.succeeded().says("all 24 poses");
    ended.does_not_say("pid");
    assert_eq!(run.odometry(), undisturbed());
    run.assert_counts("processed=24 resumed_after=24");
    let summary = run.summary();
    assert_eq!(summary["ending"], "complete");
    assert!(summary["evaluation"]["rpe"].is_object());
}

/// Makes the journal one of another version.
fn age(journal: &Path) {
    let mut bytes = fs::read(journal).unwrap();
    bytes[..16].copy_from_slice(b"gyre journal v9 ");
    fs::write(journal, bytes).unwrap();
}

#[test]
fn results_without_a_journal_or_of_another_version_are_replaced_only_if_that_is_asked_for() {
    let run = Run::of_recording();
    run.complete();
    age(&run.out().join("journal/poses.journal"));
    run.finish()
        .refused_with(&["poses.journal", "another version", "--fresh"]);
    assert_eq!(run.clone().option("--fresh").complete(), undisturbed());
    fs::remove_dir_all(run.out().join("journal")).unwrap();
    run.finish()
        .refused_with(&["summary.json", "journal is missing", "--fresh"]);
}

#[test]
fn a_live_run_that_cannot_continue_the_earlier_one_keeps_it_under_its_time() {
    let run = Run::of_recording().set("run.mode=live").rate("20");
    run.complete();
    run.clone()
        .set("run.earlier=refuse")
        .finish()
        .refused_with(&["complete live run", "another --out", "--fresh"]);
    let other = run.clone().set("masking.threshold=70");
    let journal = run.out().join("journal/poses.journal");
    for (number, run) in [run.clone(), other.clone(), other].iter().enumerate() {
        if number == 2 {
            age(&journal);
        }
        let odometry = run.odometry();
        let ended = run.finish();
        let kept = kept(ended.succeeded());
        let kept = fs::read_to_string(kept.join("odometry.csv")).unwrap();
        assert_eq!(kept, odometry);
    }
}

/// Returns the folder of the earlier run that a run has reported, whose name ends with a time.
fn kept(ended: &Ended) -> PathBuf {
    let (_, rest) = ended.stderr.split_once("that run is kept as ").unwrap();
    let (kept, _) = rest.split_once(", and a new one begins").unwrap();
    let (_, time) = kept.rsplit_once('.').unwrap();
    assert!(time.starts_with("20") && time.contains('T'), "{kept}");
    PathBuf::from(kept)
}

/// A robot whose power failed, and that has a new program or configuration when it is on again.
#[test]
fn a_killed_live_run_that_cannot_be_continued_has_its_results() {
    let run = Run::of_recording().set("run.mode=live").rate("20");
    let running = run.started(5);
    running.kill_supervisor();
    assert!(!run.out().join("summary.json").exists());
    let ended = run.clone().set("masking.threshold=70").finish();
    let kept = kept(ended.succeeded());
    let rows = fs::read_to_string(kept.join("odometry.csv")).unwrap();
    assert!(rows.lines().count() > 4, "{rows}");
    let summary = fs::read_to_string(kept.join("summary.json")).unwrap();
    assert!(summary.contains("interrupted"), "{summary}");
    let config = fs::read_to_string(kept.join("config.toml")).unwrap();
    assert!(!config.contains("threshold = 70"), "{config}");
}

/// A run that begins in the folder of a complete one and computes nothing.
fn futile(run: &Run, masking: &str) -> Run {
    run.clone()
        .stage_script("masking", masking)
        .set("masking.threshold=70")
        .option("--fresh")
}

#[test]
fn a_complete_run_stays_until_another_one_has_results() {
    let run = Run::of_recording();
    run.complete();
    let config = fs::read(run.out().join("config.toml")).unwrap();
    let is_there = || {
        assert_eq!(run.odometry(), undisturbed());
        assert_eq!(run.summary()["processed"], recording::SCANS);
        assert_eq!(fs::read(run.out().join("config.toml")).unwrap(), config);
        assert!(run.out().join("journal/complete").exists());
        assert!(!run.out().join("journal.replaced").exists());
    };
    let ended = futile(&run, "exit 7").finish();
    ended.failed_with(&["masking"]);
    let note = "has the results of the complete run before";
    ended.says(note);
    is_there();

    // The supervisor is killed: the next command restores all results that are not yet replaced.
    let mut running = futile(&run, "exec sleep 60").start();
    running.await_stage("radar-replay");
    running.kill_supervisor();
    assert_eq!(run.odometry(), undisturbed());
    assert!(!run.out().join("journal/complete").exists());
    let other = run.clone().set("masking.threshold=71");
    other
        .finish()
        .failed_with(&["complete run of another configuration"]);
    is_there();
    run.complete();
    is_there();
    assert_eq!(run.summary()["resumed_after"], 0, "it is begun anew");
}

#[test]
fn a_killed_run_is_not_reported_with_the_results_of_the_run_before() {
    let complete = Run::of_recording();
    complete.complete();
    for (run, reason) in [(complete, "has not ended"), (interrupted(), "summary.json")] {
        let mut running = futile(&run, "exec sleep 60").start();
        running.await_stage("radar-replay");
        running.kill_supervisor();
        finished!["report", run.out()].refused_with(&[reason]);
    }
}

/// A new run ends, as by a kill, when it has removed the old results.
#[test]
fn results_of_a_run_are_not_taken_for_those_of_an_unknown_one_while_another_begins() {
    let run = interrupted();
    let log = run.out().join("log.jsonl.old");
    fs::create_dir(&log).unwrap();
    let ended = run.clone().option("--fresh").finish();
    ended.failed_with(&["cannot remove", "log.jsonl.old"]);
    assert!(run.out().join("summary.json").exists());
    assert!(!run.out().join("journal/poses.journal").exists());
    fs::remove_dir(&log).unwrap();
    assert_eq!(run.complete(), undisturbed());
}

#[test]
fn an_empty_or_missing_config_is_restored_and_the_run_resumes() {
    for damage in [
        |path: &Path| fs::write(path, ""),
        |path: &Path| fs::remove_file(path),
    ] {
        let run = interrupted();
        let config = run.out().join("config.toml");
        damage(&config).unwrap();
        assert_eq!(run.complete(), undisturbed());
        for folder in [run.out().to_owned(), run.out().join("journal")] {
            let names = names_in(&folder);
            let has_draft = names.iter().any(|name| name.ends_with(".tmp"));
            assert!(!has_draft, "{names:?}");
        }
        assert!(run.count("resumed_after") >= MIDDLE as u64);
        assert_eq!(Run::of_file(&config).complete(), undisturbed());
    }
}

#[test]
fn a_damaged_record_of_what_a_run_was_begun_with_is_named_and_not_discarded() {
    let run = interrupted();
    let path = run.out().join("journal/run.toml");
    let whole = fs::read(&path).unwrap();
    let damages: [(&str, Option<&[u8]>); 3] = [
        ("is empty", Some(b"")),
        ("is damaged", Some(&whole[..whole.len() / 2])),
        ("is missing", None),
    ];
    for (state, content) in damages {
        match content {
            Some(content) => fs::write(&path, content).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        run.finish().refused_with(&[
            "run.toml",
            state,
            "restore it from a backup",
            "another --out",
        ]);
    }
    fs::write(&path, whole).unwrap();
    assert_eq!(run.complete(), undisturbed());
}

#[test]
fn a_journal_that_was_damaged_on_the_disk_is_refused_and_kept() {
    let run = Run::of_recording();
    // Two seconds, so that the first poses are known to be on the disk when later ones are written.
    run.interrupt("2", 2 * MIDDLE);
    let journal = run.out().join("journal/poses.journal");
    let mut bytes = fs::read(&journal).unwrap();
    bytes[1000] ^= 4;
    fs::write(&journal, &bytes).unwrap();
    run.finish().refused_with(&[
        "poses.journal is damaged at record 1,",
        "kept as",
        "poses.journal.damaged",
        "another --out",
        "--fresh",
    ]);
    assert_eq!(fs::read(&journal).unwrap(), bytes, "it is left as it is");
    assert_eq!(run.clone().option("--fresh").complete(), undisturbed());
    let kept = run.out().join("journal/poses.journal.damaged");
    assert_eq!(fs::read(kept).unwrap(), bytes);
}

#[test]
fn a_journal_that_is_removed_during_the_run_ends_it_and_is_named() {
    for (slam, name, is_replaced) in [
        ("none", "poses.journal", false),
        ("none", "poses.journal", true),
        ("graph", "keyframes.log", false),
    ] {
        let run = Run::of_recording().set(&format!("slam.kind={slam}"));
        let running = run.clone().rate(MODERATE).started(MIDDLE);
        let journal = run.out().join("journal").join(name);
        fs::remove_file(&journal).unwrap();
        if is_replaced {
            fs::write(&journal, "").unwrap();
        }
        running.finish().failed_with(&[name, "removed or replaced"]);
        assert!(!run.out().join("journal/complete").exists());
        if slam == "graph" {
            run.complete();
            configurations::slam().assert_undisturbed(&run, name);
        }
    }
}

#[test]
fn a_second_run_with_the_same_results_is_refused_whatever_it_calls_them() {
    let run = Run::of_recording().rate("2");
    let mut running = run.started(1);
    let [link, mounted] = ["link", "mounted"].map(|name| run.folder().join(name));
    symlink(run.out(), &link).unwrap();
    fs::create_dir(&mounted).unwrap();
    let named = |out: &Path| run.clone().into(out).command();
    let mut seconds = vec![
        run.command(),
        named(&link),
        named(&run.out().join("log/..")),
    ];
    let bound = format!("--bind '{}' '{}'", run.out().display(), mounted.display());
    seconds.extend(with_mount(&bound, &named(&mounted)));
    seconds.extend(with_mount("-t tmpfs tmpfs /dev/shm", &run.command()));
    for second in seconds {
        Ended::of(second).refused_with(&["another command is writing to", "--out"]);
    }
    assert!(!running.is_over(), "the first run ended before the second");
    assert_eq!(running.complete(), undisturbed());
}
