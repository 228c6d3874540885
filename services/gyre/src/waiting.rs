//! A run waits for a radar that is not there yet, as after the boot of a robot.

use std::{
    env, process,
    sync::mpsc::{Receiver, channel},
    thread,
    time::{Duration, Instant},
};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_contract::control::Status;
use gyre_results::Out;
use gyre_stages::live_radar::{AskError, Sizes};
use gyre_supervise::wait;
use gyre_transport::{RunError, run::RunRoot, wake::Signals};

use crate::{notify::Notifier, preflight::ask};

const PAUSE: Duration = Duration::from_secs(1);
/// Time between two reports that the radar is waited for.
const REPORT_EVERY: Duration = Duration::from_secs(60);

fn may_come(error: &Failure) -> bool {
    let radar = error.downcast_ref::<AskError>();
    radar.is_some_and(|it| it.may_pass)
}

fn notice(error: &Failure) -> String {
    format!("waits for its radar: {error}")
}

/// Meanwhile `gyre ps` shows the run, and `signals` are installed.
pub fn for_radar(
    configuration: &Configuration,
    out: &Out,
    (notifier, signals): (&mut Notifier, &mut Option<Signals>),
) -> Result<Sizes, Failure> {
    let error = match ask(configuration) {
        Err(error) if may_come(&error) => error,
        answer => return answer,
    };
    let signals = signals.insert(Signals::install()?);
    let root = RunRoot::acquire(out.path(), signals)?;
    let answers = answers_of_radar(configuration.clone());
    let status = Status {
        pid: process::id(),
        out: out.path().to_owned(),
        started_in: env::current_dir().unwrap_or_default(),
        live: true,
        notice: Some(notice(&error)),
        ..Status::default()
    };
    let (since, mut reported) = (Instant::now(), None);
    let answer = wait(root.path(), signals, status, |status| {
        while let Ok(answer) = answers.try_recv() {
            match answer {
                Err(error) if may_come(&error) => status.notice = Some(notice(&error)),
                answer => return Some(answer),
            }
        }
        status.uptime_s = since.elapsed().as_secs_f64();
        if reported.is_none_or(|it: Instant| it.elapsed() >= REPORT_EVERY) {
            reported = Some(Instant::now());
            let notice = status.notice.as_deref().unwrap_or_default();
            print::note(format_args!("gyre: the run {notice}"));
            notifier.waiting(notice);
        }
        notifier.keep_alive();
        None
    });
    answer?.ok_or(RunError::Stopped)?
}

/// Asks again and again in a thread of its own: an attempt can take seconds, and meanwhile the run
/// must answer requests and signals.
fn answers_of_radar(asked: Configuration) -> Receiver<Result<Sizes, Failure>> {
    let (sender, answers) = channel();
    thread::spawn(move || {
        loop {
            thread::sleep(PAUSE);
            let answer = ask(&asked);
            let is_last = answer.as_ref().err().is_none_or(|error| !may_come(error));
            if sender.send(answer).is_err() || is_last {
                return;
            }
        }
    });
    answers
}
