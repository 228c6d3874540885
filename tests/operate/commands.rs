//! Running runs from the command line: up, ps, logs, top, restart, down; what systemd is notified
//! of.

use std::{
    fs,
    os::unix::net::UnixDatagram,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;
use serde_json::Value;

use crate::{
    PROGRAM,
    common::{
        Ended, Pid, Run, Running, STAGES, assert_nothing_left, can, can_mount, finished, folder,
        gyre, processes, recording, send, undisturbed,
    },
    reach::only_if,
};

/// The recording's six seconds in twenty: time for commands, also while other tests keep the
/// machine busy.
const SLOW: &str = "0.3";

/// A command about a run.
pub(crate) fn ask(run: &Run, arguments: &[&str]) -> Ended {
    finished![; arguments; [run.out()]]
}

/// The state of a run by `gyre ps --json`; `None` if it does not run. It is named, since the run of
/// another test may not answer.
pub(crate) fn status(run: &Run) -> Option<Value> {
    let ended = ask(run, &["ps", "--json"]);
    let runs: Vec<Value> = serde_json::from_str(&ended.stdout).ok()?;
    Some(runs.first()?["status"].clone())
}

/// The command that starts a run in the background.
pub(crate) fn up(run: &Run) -> Command {
    let mut up = gyre();
    up.arg("up").args(run.command().get_args().skip(1));
    up
}

/// With a `/dev/shm` of their own no other run is there.
#[test]
fn a_run_from_elsewhere_is_not_changed_without_its_name() {
    only_if!(can_mount());
    let run = Run::of_recording().rate(SLOW);
    let script = "mount -t tmpfs tmpfs /dev/shm || exit 9
        here=$1; shift
        cd \"$here\" && \"$0\" up \"$@\" >/dev/null || exit 8
        cd /
        \"$0\" swap masking --command nope; echo swap $?
        \"$0\" restart masking; echo restart $?
        \"$0\" down; echo down $?
        \"$0\" logs >/dev/null; echo logs $?
        cd \"$here\"
        \"$0\" down; echo down $?";
    let mut shell = Command::new("unshare");
    let script = format!("exec 2>&1; {script}");
    shell.args(["--mount", "sh", "-c", &script, PROGRAM]);
    shell
        .arg(run.folder())
        .args(run.command().get_args().skip(1));
    shell.stdin(Stdio::null());
    let ended = Ended::of(shell);
    let lines: Vec<&str> = ended.succeeded().stdout.lines().collect();
    let out = run.out().canonicalize().unwrap().display().to_string();
    let refusal = format!("name it: {out}");
    let named = format!("gyre: of the run in {out}");
    assert_eq!(lines.len(), 11, "{lines:?}");
    for (at, code) in [(1, "swap 1"), (3, "restart 1"), (5, "down 1")] {
        assert!(lines[at - 1].ends_with(&refusal), "{lines:?}");
        assert_eq!(lines[at], code, "{lines:?}");
    }
    assert_eq!(lines[6..9], [&named, "logs 0", &named], "{lines:?}");
    assert!(lines[9].contains("has ended after"), "{lines:?}");
    assert_eq!(lines[10], "down 0");
    assert_eq!(run.summary()["swaps"], Value::Null);
}

/// Waits until the run's state is as wanted.
pub(crate) fn await_status(run: &Run, what: &str, is_as_wanted: impl Fn(&Value) -> bool) -> Value {
    let since = Instant::now();
    loop {
        match status(run) {
            Some(status) if is_as_wanted(&status) => return status,
            status => assert!(since.elapsed().as_secs() < 60, "{what}: {status:?}"),
        }
        thread::sleep(Duration::from_millis(20));
    }
}

pub(crate) fn process<'a>(status: &'a Value, name: &str) -> &'a Value {
    let processes = status["processes"].as_array().unwrap();
    processes.iter().find(|it| it["name"] == name).unwrap()
}

/// A run of six seconds that has begun.
pub(crate) fn started() -> (Run, Running) {
    let run = Run::of_recording().rate("1");
    let running = run.started(2);
    (run, running)
}

#[test]
fn a_health_check_names_the_process_that_is_silent_and_fails_without_a_run() {
    let run = Run::of_recording().rate(SLOW);
    let mut running = run.start();
    let check = || ask(&run, &["ps", "--check"]);
    await_status(&run, "all there", |status| status["phase"] == "running");
    assert!(check().succeeded().stdout.is_empty());
    let masking = running.await_stage("masking");
    let activity = || {
        send(masking, Signal::STOP);
        let stopped = await_status(&run, "a heartbeat that is too old", |status| {
            process(status, "masking")["activity_s"].as_f64() > Some(1.0)
        });
        process(&stopped, "masking")["activity"].clone()
    };
    // Stopped in the middle of a scan it is at work, for all that is known.
    while activity() != "silent" {
        send(masking, Signal::CONT);
        thread::sleep(Duration::from_millis(50));
    }
    let failed = check();
    assert_eq!(failed.status.code(), Some(1));
    failed.says("masking is silent");
    send(masking, Signal::CONT);
    ask(&run, &["down"]).succeeded();
    running.finish();
    assert_eq!(check().status.code(), Some(1), "the run has ended");
}

#[test]
fn a_run_in_the_background_goes_on_from_where_it_was_taken_down() {
    let run = Run::of_recording().rate(SLOW);
    Ended::of(up(&run)).succeeded().prints("6 processes");
    let status = await_status(&run, "poses", |status| status["poses"].as_u64() >= Some(4));
    assert_eq!(status["phase"], "running");
    let names = status["processes"].as_array().unwrap().iter();
    assert!(names.map(|it| it["name"].as_str().unwrap()).eq(STAGES));
    let pid = status["pid"].as_u64().unwrap() as Pid;
    let session = &processes::stat(pid).unwrap()[3];
    assert_eq!(*session, pid.to_string(), "it has left the terminal");
    ask(&run, &["down"]).succeeded();
    assert_nothing_left(run.out());
    assert!(!ask(&run, &["down"]).status.success());
    let nowhere = Run::small().option("/nowhere");
    Ended::of(up(&nowhere)).refused_with(&["/nowhere"]);
    assert!(run.result("log/gyre.txt").contains("interrupted"));
    assert_eq!(run.complete(), undisturbed());
    assert!(run.summary()["resumed_after"].as_u64() >= Some(4));
}

#[test]
fn a_process_is_started_again_on_request() {
    let (run, mut running) = started();
    let before = running.await_stage("translation-search");
    ask(&run, &["restart", "translation-search"]).succeeded();
    let after = running.await_other_stage("translation-search", before);
    let status = status(&run).unwrap();
    assert_eq!(process(&status, "translation-search")["pid"], after);
    assert_eq!(process(&status, "translation-search")["restarts"], 1);
    ask(&run, &["restart", "steering"]).refused_with(&["steering", "masking"]);
    assert_eq!(running.complete(), undisturbed());
}

#[test]
fn down_says_that_results_are_not_written_and_that_a_killed_run_is_not_running() {
    let run = Run::of_recording();
    let slow = run.clone().rate(SLOW);
    let running = slow.started(1);
    // Nothing can be put in its place.
    fs::create_dir(run.out().join("summary.json")).unwrap();
    ask(&run, &["down"]).failed_with(&["results are not written"]);
    assert!(!running.finish().status.success());
    fs::remove_dir(run.out().join("summary.json")).unwrap();
    let running = slow.started(2);
    running.kill_supervisor();
    ask(&run, &["down"]).refused_with(&["no run", "and was killed"]);
    let other = Run::of_recording().rate(SLOW);
    let going = other.start();
    await_status(&other, "poses", |it| it["poses"].as_u64() >= Some(1));
    let listed = finished!["ps", "--json"].stdout;
    assert!(!listed.contains(run.out().to_str().unwrap()), "{listed}");
    ask(&other, &["down"]).succeeded();
    going.finish();
    ask(&other, &["ps"]).refused_with(&["the run was interrupted"]);
    assert_eq!(run.complete(), undisturbed());
    ask(&run, &["swap", "masking"]).refused_with(&["the run is complete"]);
}

#[test]
fn a_stage_or_a_follower_that_hangs_is_restarted_alone() {
    for name in ["rotation-search", "loop-closure"] {
        let run = Run::of_recording().rate("1");
        let run = run.sets("slam.kind=graph run.stall_timeout_s=2");
        let running = run.started(4);
        let status = await_status(&run, "followers", |it| {
            process(it, "loop-closure")["activity"] == "waiting"
        });
        let pid = process(&status, name)["pid"].as_u64().unwrap() as Pid;
        send(pid, Signal::STOP);
        running.finish().succeeded().says(&format!("{name} hangs"));
        let restarts = run.summary()["restarts"].clone();
        assert_eq!(restarts, serde_json::json!({ name: 1 }));
        assert_eq!(run.odometry(), undisturbed());
    }
}

#[test]
fn logs_of_a_run_are_lines_of_the_process_that_is_asked_for() {
    let copy = recording::copy(8);
    let images = recording::images(copy.path());
    recording::truncate(&images[3], 1000);
    let run = Run::small().data(copy.path());
    run.finish();
    ask(&run, &["logs", "radar-replay"])
        .succeeded()
        .prints("WARN radar-replay: skipped");
    assert_eq!(ask(&run, &["logs", "refinement"]).succeeded().stdout, "");
    ask(&run, &["logs", "steering"]).refused_with(&["steering", "refinement"]);
}

#[test]
fn top_shows_the_processes_of_a_run_in_a_terminal() {
    only_if!(can(&["tmux", "-V"]));
    let (run, running) = started();
    let socket = run.folder().join("tmux");
    let tmux = |arguments: &[&str]| {
        let mut command = Command::new("tmux");
        let output = command.arg("-S").arg(&socket).args(arguments).output();
        String::from_utf8_lossy(&output.unwrap().stdout).into_owned()
    };
    let top = format!("{PROGRAM} top --every 0.1 {}", run.out().display());
    tmux(&["new-session", "-d", "-x", "80", "-y", "30", &top]);
    let since = Instant::now();
    let screen = loop {
        let screen = tmux(&["capture-pane", "-p"]);
        if screen.contains("sensor to pose p50") && screen.contains("pose-integration") {
            break screen;
        }
        assert!(since.elapsed().as_secs() < 30, "{screen}");
        thread::sleep(Duration::from_millis(50));
    };
    let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in ["ago, 0 dropped", "in flight", "work p50", "q quit"] {
        assert!(screen.contains(words), "{words}: {screen}");
    }
    tmux(&["send-keys", "q"]);
    while !tmux(&["list-sessions"]).is_empty() {
        assert!(since.elapsed().as_secs() < 60, "q does not end it");
        thread::sleep(Duration::from_millis(50));
    }
    let text = ask(&run, &["top", "--once", "--every", "0.2"]);
    text.succeeded().prints("rotation-search");
    assert_eq!(running.complete(), undisturbed());
}

/// Reads notifications from a socket, as systemd does, until `STOPPING=1`.
fn notifications(socket: &UnixDatagram) -> Vec<String> {
    let mut buffer = [0; 4096];
    let mut all: Vec<String> = Vec::new();
    while !all.last().is_some_and(|it| it.contains("STOPPING=1")) {
        let length = socket.recv(&mut buffer).unwrap();
        all.push(String::from_utf8_lossy(&buffer[..length]).into_owned());
    }
    all
}

#[test]
fn systemd_is_notified_when_a_run_is_ready_alive_and_stopping() {
    let place = folder();
    let path = place.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    let limit = Some(Duration::from_secs(60));
    socket.set_read_timeout(limit).unwrap();
    let run = Run::of_recording().rate("3");
    let mut command = run.command();
    command.env("NOTIFY_SOCKET", &path);
    command.env("WATCHDOG_USEC", "400000");
    let running = run.start_as(command);
    let all = notifications(&socket);
    running.finish().succeeded();
    let position = |word: &str| all.iter().position(|it| it.contains(word)).unwrap();
    assert!(position("READY=1") < position("WATCHDOG=1"), "{all:?}");
    assert!(position("WATCHDOG=1") < position("STOPPING=1"), "{all:?}");
    let alive = all.iter().filter(|it| it.contains("WATCHDOG=1")).count();
    assert!(alive >= 3, "{all:?}");
}
