//! Notifications of a run to systemd, where it has started it (`Type=notify`): readiness, a
//! watchdog's keep-alive, and a line of status.

use std::{
    io,
    time::{Duration, Instant},
};

use gyre_configuration::terminal::print;
use gyre_contract::PoseHeader;
use gyre_supervise::Event;
use sd_notify::NotifyState;

const STATUS_EVERY: Duration = Duration::from_secs(5);

pub struct Notifier {
    listens: bool,
    /// systemd takes keep-alives from the start of the service on.
    is_ready: bool,
    every: Option<Duration>,
    kept_alive: Instant,
    reported: Instant,
}

impl Notifier {
    /// Returns the notifier that the environment asks for, by `NOTIFY_SOCKET` and `WATCHDOG_USEC`.
    #[must_use]
    pub fn of_environment() -> Self {
        let now = Instant::now();
        Self {
            listens: std::env::var_os("NOTIFY_SOCKET").is_some(),
            is_ready: false,
            // Half of the limit, as its manual advises.
            every: sd_notify::watchdog_enabled().map(|limit| limit / 2),
            kept_alive: now,
            reported: now,
        }
    }

    /// Reports an event to systemd. The keep-alive means that the supervisor watches its processes,
    /// which it restarts without systemd; systemd restarts a supervisor that hangs.
    pub fn report(&mut self, event: &Event<'_>) {
        match event {
            Event::Ready => {
                self.is_ready = true;
                self.tell(&[NotifyState::Ready]);
            }
            Event::Watched => self.keep_alive(),
            Event::Pose(pose) if self.reported.elapsed() >= STATUS_EVERY => {
                self.reported = Instant::now();
                self.status(&status(pose));
            }
            Event::Stopping => self.tell(&[NotifyState::Stopping]),
            Event::Stalled(stall) => self.status(&stall.to_string()),
            _ => {}
        }
    }

    /// The run waits for its radar. For systemd the run has started: later services of the boot do
    /// not wait.
    pub fn waiting(&mut self, reason: &str) {
        self.is_ready = true;
        self.tell(&[NotifyState::Ready, NotifyState::Status(reason)]);
    }

    pub fn keep_alive(&mut self) {
        let is_due = self.every.is_some_and(|it| self.kept_alive.elapsed() >= it);
        if self.is_ready && is_due {
            self.kept_alive = Instant::now();
            self.tell(&[NotifyState::Watchdog]);
        }
    }

    /// The stages have ended, and results are written, which takes as long as it takes.
    pub fn writing(&mut self) {
        self.status("writing the results");
    }

    pub fn status(&mut self, sentence: &str) {
        self.tell(&[NotifyState::Status(sentence)]);
    }

    /// Returns whether systemd has started the run.
    pub fn listens(&self) -> bool {
        self.listens
    }

    fn tell(&mut self, states: &[NotifyState<'_>]) {
        if !self.listens {
            return;
        }
        if let Err(error) = sd_notify::notify(states) {
            // The run does not need a listener. One warning is enough.
            self.listens = error.kind() == io::ErrorKind::WouldBlock;
            print::note(format_args!("gyre: systemd cannot be notified: {error}"));
        }
    }
}

fn status(pose: &PoseHeader) -> String {
    let (poses, dropped) = (pose.item.seq + 1, pose.item.dropped());
    format!("{poses} poses, {dropped} scans dropped")
}
