//! Recordings of runs: they change nothing, survive kills and full disks, report missing items, and
//! replay to the same bytes.

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use gyre_recording::{Recording, open_recording, parts};
use rustix::process::Signal;
use serde_json::Value;

use crate::{
    common::{
        Ended, Run, finished, odometry,
        recording::{SCANS, around_a_block},
        script, send, undisturbed, with_tmpfs,
    },
    operate::commands::{ask, await_status, process},
    reach::{only_if, python_has},
    restart::faults::configurations,
};

/// Every topic that a replay can begin with.
pub const ALL: &str = "record.topics=['scan','masked','rotation','motion','refined','pose','log']";
/// With so large a window the queues hold all scans of these tests: nothing is missed, however slow
/// the machine is.
pub const WINDOW: &str = "run.window=32";

/// A run of the small recording whose queues hold all of it.
pub fn played() -> Run {
    Run::of_recording().set(WINDOW)
}

pub fn file(run: &Run) -> PathBuf {
    run.folder().join("drive.mcap")
}

pub fn recorded(run: &Run) -> Run {
    let path = file(run);
    run.clone().argument("--record", path.to_str().unwrap())
}

/// A replay with the configuration that is in the recording.
pub fn replay(recording: &Path, arguments: &[&str]) -> String {
    let (run, ended) = replayed(recording, arguments);
    ended.succeeded();
    run.odometry()
}

pub fn replayed(recording: &Path, arguments: &[&str]) -> (Run, Ended) {
    let run = Run::configured("");
    let ended = finished!["run", recording, "--out", run.out(); arguments];
    (run, ended)
}

pub fn seqs(recording: &Recording, topic: &str) -> Vec<u64> {
    recording.entries(topic).map(|entry| entry.seq).collect()
}

#[test]
fn a_recorded_run_has_the_same_results_and_replays_to_them_from_every_topic() {
    let run = recorded(&played()).set(ALL);
    run.finish().succeeded().says("missed nothing");
    assert_eq!(run.odometry(), undisturbed());
    let recording = open_recording(&file(&run)).unwrap();
    for topic in ["scan", "masked", "rotation", "motion", "refined", "pose"] {
        let all: Vec<u64> = (0..SCANS as u64).collect();
        assert_eq!(seqs(&recording, topic), all, "{topic}");
    }
    assert_eq!(recording.damages().count(), 0);
    assert_eq!(replay(&file(&run), &[]), undisturbed());
    for topic in ["masked", "rotation", "motion", "refined"] {
        let odometry = replay(&file(&run), &["--from", topic]);
        assert_eq!(odometry, undisturbed(), "from {topic}");
    }
    let other = Run::configured("").data(&file(&run));
    let other = other.set("dataset.range_offset_m=0.5").finish();
    other.refused_with(&["range_offset_m", "that they were recorded with"]);
    let inspected = finished!["inspect", "--json", file(&run)];
    let report: Value = serde_json::from_str(&inspected.succeeded().stdout).unwrap();
    assert_eq!(report["format"], "mcap");
    assert_eq!(report["scans"], SCANS);
    assert_eq!(report["unreadable"].as_array().unwrap().len(), 0);
}

#[test]
fn a_run_that_ended_before_its_first_pose_goes_on_with_its_recording() {
    for (mode, rate) in [("lossless", "max"), ("live", "4")] {
        let settings = format!("run.mode={mode} source.scans=6 stages.refinement.delay_ms=800");
        let run = recorded(&played().rate(rate)).set(ALL).sets(&settings);
        let mut running = run.start();
        running.await_stages();
        await_file(&file(&run));
        assert_eq!(running.poses(), 0);
        running.signal(Signal::INT);
        running.end();
        let other = run.clone().set("points.max_range_m=70");
        other.finish().failed_with(&["drive.mcap exists"]);
        run.finish().succeeded();
        assert_eq!(parts(&file(&run)).len(), 2, "{mode}");
        let recording = open_recording(&file(&run)).unwrap();
        assert_eq!(seqs(&recording, "scan"), [0, 1, 2, 3, 4, 5], "{mode}");
        let replayed = replay(&file(&run), &["--from", "masked"]);
        assert_eq!(replayed, run.odometry(), "{mode}");
    }
}

fn await_file(path: &Path) {
    while !path.exists() {
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_recorder_that_is_stopped_for_long_says_exactly_what_it_missed() {
    let run = recorded(&played()).set(ALL).rate("1").set("run.window=1");
    let mut running = run.started(SCANS / 4);
    let recorder = running.await_child("record", None);
    send(recorder, Signal::STOP);
    running.await_poses(SCANS - 4);
    send(recorder, Signal::CONT);
    let ended = running.finish();
    assert_eq!(run.odometry(), played().set("run.window=1").complete());
    let missed = counted_as_missed(&run, &ended);
    let recording = open_recording(&file(&run)).unwrap();
    // The scans that are there are played, and those that are not are named; what needs every
    // message is refused.
    let again = Run::configured("").data(&file(&run));
    let again = again.set("source.max_unreadable=100");
    let sentence = format!("{missed} of the {SCANS} scans");
    again.finish().failed_with(&[&sentence, "cannot be read"]);
    let masked = seqs(&recording, "masked");
    let lost = (0..).find(|seq| !masked.contains(seq)).unwrap();
    let lacks = format!("lacks message {lost} of topic `masked`");
    let from = Run::configured("").data(&file(&run));
    let from = from.argument("--from", "masked");
    from.finish().refused_with(&[&lacks]);
}

/// Returns the number of missing scans, four or more. The recorder must have printed and written
/// this number.
fn counted_as_missed(run: &Run, ended: &Ended) -> usize {
    let recording = open_recording(&file(run)).unwrap();
    let there = seqs(&recording, "scan");
    let missed = SCANS - there.len();
    assert!(missed >= 4, "{there:?}");
    assert_eq!(recording.missed()["scan"], missed as u64);
    ended.says(&format!("missed {missed} scan"));
    missed
}

#[test]
fn what_a_killed_recorder_had_not_written_and_the_next_one_did_not_find_is_counted() {
    let run = recorded(&played()).rate("1").set("run.window=1");
    let mut running = run.started(SCANS / 4);
    let killed = running.await_child("record", None);
    // It writes nothing from here on, so that the gap is longer than the history of the topics,
    // however fast the machine is.
    send(killed, Signal::STOP);
    running.await_poses(SCANS - 8);
    send(killed, Signal::KILL);
    running.await_child("record", Some(killed));
    let ended = running.finish();
    ended.succeeded().does_not_say("missed nothing");
    counted_as_missed(&run, &ended);
}

#[test]
fn a_recorder_that_dies_right_before_the_end_is_reported() {
    let run = recorded(&played()).rate("1").set("record.topics=['scan']");
    let mut running = run.started(SCANS / 4);
    let recorder = running.await_child("record", None);
    send(recorder, Signal::STOP);
    running.await_poses(SCANS);
    send(recorder, Signal::KILL);
    let ended = running.finish();
    ended.succeeded();
    let has_said = ["end of the recording is missing", " scan: the recording"];
    let said = &ended.stderr;
    assert!(has_said.iter().any(|it| said.contains(it)), "{said}");
}

fn health(recording: &Path) -> Vec<Value> {
    let bytes = fs::read(recording).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap();
    // A recorder that was killed leaves an unfinished file.
    let messages = messages.map_while(Result::ok);
    let of_health = messages.filter(|message| message.channel.topic == "/health");
    let parsed = of_health.map(|message| serde_json::from_slice(&message.data));
    parsed.map(Result::unwrap).collect()
}

#[test]
fn the_recorder_is_listed_with_the_health_that_it_records_and_started_again_on_request() {
    let run = recorded(&played()).rate("1");
    let mut running = run.start();
    running.await_poses(SCANS / 4).kill("masking");
    let recorder = |what, is_as_wanted: &dyn Fn(&Value) -> bool| {
        let status = await_status(&run, what, |status| {
            is_as_wanted(process(status, "recorder"))
        });
        process(&status, "recorder").clone()
    };
    let first = recorder("a heartbeat", &|it| it["activity"] == "waiting");
    assert!(first["restarts"] == 0 && first["missed"] == 0, "{first}");
    ask(&run, &["ps"]).prints("\n  recorder ");
    ask(&run, &["top", "--once"]).prints("\nrecorder ");
    ask(&run, &["restart", "recorder"]).succeeded();
    let second = recorder("a restart", &|it| it["activity"] == "waiting");
    assert_ne!(first["pid"], second["pid"]);
    assert!(second["restarts"] == 1 && second["last_death"].is_null());
    send(second["pid"].as_u64().unwrap() as u32, Signal::KILL);
    recorder("a restart after its death", &|it| {
        it["restarts"] == 2 && it["last_death"] == "signal 9"
    });
    assert_eq!(running.complete(), undisturbed());
    let parts = parts(&file(&run));
    assert_eq!(parts.len(), 3);
    let recording = open_recording(&file(&run)).unwrap();
    assert_eq!(seqs(&recording, "scan").len(), SCANS);
    assert_eq!(recording.damages().count(), 1, "of the killed recorder");
    let health: Vec<Value> = parts.iter().flat_map(|part| health(part)).collect();
    assert!(health.len() >= 2, "once a second for six seconds");
    let processes = &health.last().unwrap()["status"];
    assert_eq!(process(processes, "masking")["restarts"], 1);
}

/// The logs of the sensors are not there any more, and their delays are in the samples already.
#[test]
fn a_recording_holds_what_sensors_measured_and_replays_with_and_without_it() {
    use configurations::{doppler, gyro_and_wheels, with_gyro, without_doppler};
    let of_gyro = (gyro_and_wheels(), with_gyro());
    let of_radar = (doppler(), without_doppler());
    for ((configuration, without), setting) in [
        (of_gyro, "wheels.kind=none"),
        (of_radar, "doppler.kind=none"),
    ] {
        let run = recorded(&configuration.run()).set(WINDOW);
        let odometry = run.complete();
        assert_eq!(replay(&file(&run), &[]), odometry);
        let alone = without.complete();
        assert_eq!(replay(&file(&run), &["--set", setting]), alone);
        assert_ne!(alone, odometry);
    }
}

#[test]
fn a_recording_without_the_topic_that_is_played_is_refused_with_how_to_record_it() {
    let run = recorded(&played());
    run.complete();
    let without = Run::small().data(&file(&run)).argument("--from", "masked");
    let lacks = "was recorded without the topic `masked`";
    let words = [lacks, "record.topics", "without --from"];
    without.finish().refused_with(&words);
    // As in docs/watch.md.
    let run = recorded(&played()).set("record.topics=['scan','masked','pose']");
    let odometry = run.complete();
    assert_eq!(replay(&file(&run), &["--from", "masked"]), odometry);
}

#[test]
fn a_full_disk_ends_the_recording_with_a_sentence_and_not_the_run() {
    let run = played();
    let place = run.folder().join("small");
    fs::create_dir(&place).unwrap();
    let file = place.join("drive.mcap");
    let recorded = run.clone().argument("--record", file.to_str().unwrap());
    let Some(command) = with_tmpfs(&recorded.command(), &place, "size=512k") else {
        return;
    };
    let ended = recorded.start_as(command).finish();
    ended.succeeded().says("No space left");
    ended.says("the run continues");
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn a_recording_has_the_objects_of_the_results_as_boxes_and_arrows() {
    only_if!(python_has("mcap_protobuf"));
    let run = Run::small().data(around_a_block()).set(WINDOW);
    let run = recorded(&run.set("objects.kind=tracks").rate("20"));
    run.complete();
    let mut command = script("observers/objects.py");
    command.arg(file(&run));
    let ended = Ended::of(command);
    ended.succeeded();
    let read: Value = serde_json::from_str(&ended.stdout).unwrap();
    let names = ["stamp_ns", "object", "x_m", "y_m", "length_m", "moving"];
    let rows = odometry::columns(&run.result("objects.csv"), &names);
    let boxes = read["boxes"].as_array().unwrap();
    assert!(rows.len() > 20, "{}", rows.len());
    // In a scan the nearest one is first, in the table the oldest one.
    for row in &rows {
        let is_it = |found: &&Value| {
            (0..2).all(|column| found[column].as_i64() == row[column].parse().ok())
        };
        let found = boxes.iter().find(is_it);
        let found = found.unwrap_or_else(|| panic!("no box for {row:?}"));
        for (seen, text) in (2..5).map(|k| (&found[k], &row[k])) {
            let expected: f64 = text.parse().unwrap();
            let apart = seen.as_f64().unwrap() - expected;
            assert!(apart.abs() < 1e-3, "{found} {row:?}");
        }
    }
    assert_eq!(boxes.len(), rows.len());
    let moving = rows.iter().filter(|row| row[5] == "1").count();
    assert_eq!(read["arrows"], moving);
}
