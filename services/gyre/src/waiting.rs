//! A run waits for a radar or a network that is not there yet, as after the boot of a robot.

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
use gyre_contract::control::{Phase, Status};
use gyre_results::Out;
use gyre_stage::datagrams::BadAddress;
use gyre_stages::live_radar::{AskError, Sizes};
use gyre_supervise::wait;
use gyre_tools::operate::is_in_background;
use gyre_transport::{RunError, run::RunRoot, wake::Signals};

use crate::{notify::Notifier, preflight::ask};

const PAUSE: Duration = Duration::from_secs(1);
/// Time between two reports that the radar is waited for.
const REPORT_EVERY: Duration = Duration::from_secs(60);

/// Returns the part that is missing and may come. Of a run that nobody looks at, the name of its
/// radar may be unknown because the network is not there yet; elsewhere the name is a mistake.
fn awaited(error: &Failure, is_deployed: bool) -> Option<&'static str> {
    if let Some(radar) = error.downcast_ref::<AskError>() {
        let may_come = radar.may_pass || (radar.is_unknown_name && is_deployed);
        return may_come.then_some("radar");
    }
    let address = error.downcast_ref::<BadAddress>()?;
    address.may_come().then_some("network")
}

fn show(status: &mut Status, awaited: &str, error: &Failure) {
    status.phase = match awaited {
        "radar" => Phase::WaitingForRadar,
        _ => Phase::Starting,
    };
    status.notice = Some(format!("waits for its {awaited}: {error}"));
}

/// Meanwhile `gyre ps` shows the run, and `signals` are installed.
pub fn for_radar(
    configuration: &Configuration,
    out: &Out,
    (notifier, signals): (&mut Notifier, &mut Option<Signals>),
) -> Result<Sizes, Failure> {
    let is_deployed = is_in_background() || notifier.listens();
    let (what, error) = match ask(configuration) {
        Err(error) if let Some(what) = awaited(&error, is_deployed) => (what, error),
        answer => return answer,
    };
    let signals = signals.insert(Signals::install()?);
    let root = RunRoot::acquire(out.path(), signals)?;
    let answers = answers_of_radar(configuration.clone(), is_deployed);
    let mut status = Status {
        pid: process::id(),
        out: out.path().to_owned(),
        started_in: env::current_dir().unwrap_or_default(),
        live: true,
        ..Status::default()
    };
    show(&mut status, what, &error);
    let (since, mut reported) = (Instant::now(), None);
    let answer = wait(root.path(), signals, status, |status| {
        while let Ok(answer) = answers.try_recv() {
            match answer {
                Err(error) if let Some(what) = awaited(&error, is_deployed) => {
                    show(status, what, &error);
                }
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
fn answers_of_radar(asked: Configuration, is_deployed: bool) -> Receiver<Result<Sizes, Failure>> {
    let (sender, answers) = channel();
    thread::spawn(move || {
        loop {
            thread::sleep(PAUSE);
            let answer = ask(&asked);
            let error = answer.as_ref().err();
            let is_last = error.is_none_or(|error| awaited(error, is_deployed).is_none());
            if sender.send(answer).is_err() || is_last {
                return;
            }
        }
    });
    answers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_this_machine_may_get_later_is_waited_for() {
        let settings = "source.kind=colossus source.address=127.0.0.1:9 run.mode=live \
            run.rate=realtime wheels.kind=udp wheels.listen=192.0.2.1:6000";
        let settings: Vec<String> = settings.split_whitespace().map(str::to_owned).collect();
        let configuration = Configuration::of_overrides(&settings).unwrap();
        let error = ask(&configuration).unwrap_err();
        let mut status = Status::default();
        show(&mut status, awaited(&error, false).unwrap(), &error);
        let notice = status.notice.unwrap();
        assert!(notice.starts_with("waits for its network: "), "{notice}");
        assert!(
            notice.contains("192.0.2.1:6000 (wheels.listen)"),
            "{notice}"
        );
    }

    #[test]
    fn an_unknown_name_is_a_mistake_unless_nobody_looks_at_the_run() {
        let unknown = AskError {
            is_unknown_name: true,
            ..AskError::lasting("unknown".to_owned())
        };
        let unknown: Failure = unknown.into();
        assert_eq!(awaited(&unknown, false), None);
        assert_eq!(awaited(&unknown, true), Some("radar"));
        let lasting: Failure = AskError::lasting("too large".to_owned()).into();
        assert_eq!(awaited(&lasting, true), None);
    }
}
