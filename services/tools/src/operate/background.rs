//! `gyre up` and `gyre down`: a run in the background, from its start to its results.

use std::{
    env,
    ffi::OsString,
    fs::{self, File, OpenOptions},
    io::{Read, Seek, SeekFrom},
    os::unix::fs::{MetadataExt, OpenOptionsExt},
    path::Path,
    process::{Child, Command, ExitStatus, Stdio},
    time::{Duration, Instant, SystemTime},
};

use gyre_client::{Signals, control::Control, last_line};
use gyre_configuration::terminal::{Failure, own, print};
use gyre_contract::control::{Phase, Status};
use gyre_results::SUMMARY;
use rustix::process::{Pid, Signal, kill_process};

use crate::operate::{RunChoice, chosen_to_change};

/// The environment variable of a run that is to leave the terminal that started it.
const DETACHED: &str = "GYRE_DETACHED";
/// Where a run in the background prints, in the folder of the results.
const LOG: &str = "log/gyre.txt";
const PERIOD: Duration = Duration::from_millis(50);
const EXPLAIN_AFTER: Duration = Duration::from_secs(3);

/// Returns whether `gyre up` started this run.
#[must_use]
pub fn is_in_background() -> bool {
    env::var_os(DETACHED).is_some()
}

/// Leaves the session of the terminal of `gyre up`: the run continues when the terminal closes.
pub fn detach_if_asked() {
    if is_in_background() {
        // Fails for the leader of a session, which has left it already.
        let _ = rustix::process::setsid();
    }
}

/// Starts a run in the background, and returns when all its stages are there, or when it has ended
/// before.
pub fn up(out: &Path) -> Result<(), Failure> {
    let log = out.join(LOG);
    let unwritable = |error: std::io::Error| format!("cannot write to {}: {error}", log.display());
    fs::create_dir_all(out.join("log")).map_err(unwritable)?;
    let mut output = OpenOptions::new()
        .create(true)
        .append(true)
        .read(true)
        .mode(0o600)
        .open(&log)
        .map_err(unwritable)?;
    let begin = output.seek(SeekFrom::End(0)).map_err(unwritable)?;
    let signals = Signals::install()?;
    let mut run = start(&output).map_err(|error| format!("cannot start the run: {error}"))?;
    loop {
        if let Some(status) = run.try_wait()? {
            return end(status, &mut output, begin, out);
        }
        if let Some(status) = status_of(out, run.id()) {
            let (name, pid, count) = (out.display(), status.pid, status.processes.len());
            let does = status.notice.unwrap_or(format!("runs: {count} processes"));
            return print::line(format_args!(
                "{name} {does}, supervised by {pid}; gyre ps, top, logs -f, down"
            ));
        }
        if signals.sleep(PERIOD)? {
            // It may have ended.
            let _ = kill_process(Pid::from_child(&run), Signal::INT);
            return end(run.wait()?, &mut output, begin, out);
        }
    }
}

fn start(output: &File) -> std::io::Result<Child> {
    let mut arguments: Vec<OsString> = env::args_os().skip(1).collect();
    if let Some(command) = arguments.iter_mut().find(|it| it.as_os_str() == "up") {
        *command = "run".into();
    }
    Command::new(own())
        .args(arguments)
        .env(DETACHED, "1")
        .stdin(Stdio::null())
        .stdout(output.try_clone()?)
        .stderr(output.try_clone()?)
        .spawn()
}

/// Returns the status of the run that this process supervises, when all its stages are there, or
/// it waits for its radar.
pub fn status_of(out: &Path, pid: u32) -> Option<Status> {
    let status = Control::of(out).ok()?.status().ok()?;
    let is_up = status.phase != Phase::Starting || status.notice.is_some();
    (status.pid == pid && is_up).then_some(status)
}

fn end(status: ExitStatus, output: &mut File, begin: u64, out: &Path) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    output.seek(SeekFrom::Start(begin))?;
    output.read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    if status.success() {
        return print::line(text.trim_end());
    }
    let reason = last_line(&text).unwrap_or("it has printed nothing");
    let reason = reason.strip_prefix("gyre: ").unwrap_or(reason);
    Err(format!("the run in {} has ended: {reason}", out.display()).into())
}

/// Ends a run as an interrupt does, and waits until its results are written.
pub fn down(choice: &RunChoice) -> Result<(), Failure> {
    let run = chosen_to_change(choice)?;
    let status = run.status()?;
    let signals = Signals::install()?;
    let before = version_of_results(&status.out);
    run.stop()?;
    let (since, mut is_explained) = (Instant::now(), false);
    while run.is_there() {
        if since.elapsed() > EXPLAIN_AFTER && !is_explained {
            is_explained = true;
            print::note("gyre: the stages have ended or are ending; the results are written");
        }
        if signals.sleep(PERIOD)? {
            return Err("interrupted: the run ends by itself".into());
        }
    }
    let (out, poses) = (status.out.display(), status.poses);
    if !status.processes.is_empty() && version_of_results(&status.out) == before {
        return Err(format!(
            "{out} has ended, but its results are not written; the poses are kept, and the same command continues from there. {LOG} in it has the reason"
        )
        .into());
    }
    print::line(format_args!(
        "{out} has ended after some {poses} poses; the same command continues from there"
    ))
}

/// Returns a mark that distinguishes versions of the results: the summary is written last, and as a
/// new file.
fn version_of_results(out: &Path) -> Option<(u64, SystemTime)> {
    let summary = fs::metadata(out.join(SUMMARY)).ok()?;
    Some((summary.ino(), summary.modified().ok()?))
}
