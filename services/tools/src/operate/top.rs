//! `gyre top`: rates, latencies and processes of a running run in the terminal.

mod screen;

use std::{
    collections::{BTreeMap, VecDeque},
    io::{self, IsTerminal},
    time::{Duration, Instant},
};

use clap::Args;
use gyre_client::{
    Next, Observer, Run, Signals, Usage, clock, control::Control, let_signals_end_the_process,
};
use gyre_configuration::terminal::{Failure, WIDTH, print};
use gyre_contract::{
    Pose, PoseHeader, SampleRates, Scan, StageId, WitnessCounts,
    control::Status,
    flag,
    run::latency::{Latency, LatencyMeter},
};
use ratatui::{
    DefaultTerminal,
    crossterm::event::{self, Event, KeyCode, KeyModifiers},
};

use crate::operate::{RunChoice, chosen, processes::summary};

#[derive(Debug, Args)]
pub struct TopArguments {
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// Time between two looks, s.
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub every: f64,
    /// Print one look as text and end.
    #[arg(long)]
    pub once: bool,
}

/// Time between two snapshots at the queue of poses, which has room for nine.
const PERIOD: Duration = Duration::from_millis(50);
/// Time between two looks at a run that waits for its radar.
const WAIT: Duration = Duration::from_secs(1);

pub fn top(arguments: &TopArguments) -> Result<(), Failure> {
    let every = Duration::try_from_secs_f64(arguments.every)
        .ok()
        .filter(|every| *every >= PERIOD)
        .ok_or("--every must be 0.05 s or more")?;
    let control = chosen(&arguments.run)?;
    let Some(run) = opened(&control, arguments.once)? else {
        return Ok(());
    };
    let poses = run.observe()?;
    // Without a place for it the rates are missing, and nothing else.
    let has_samples = run.manifest().limits.samples > 0;
    let scans = has_samples.then(|| run.observe().ok()).flatten();
    let mut snapshots = Snapshots::of(control, poses, scans);
    if arguments.once {
        // Shares and rates are over the time between two snapshots.
        let signals = Signals::install()?;
        snapshots.take()?;
        wait(&mut snapshots, every, || Ok(signals.sleep(PERIOD)?))?;
        return print::line(screen::text(&snapshots.take()?, width()));
    }
    // A closed terminal has an event without end, which leaves no time to look for a signal.
    let_signals_end_the_process()?;
    let mut terminal = ratatui::try_init()
        .map_err(|error| format!("the terminal cannot be used: {error}; --once prints text"))?;
    let shown = show(&mut terminal, &mut snapshots, every);
    ratatui::restore();
    let last = shown?;
    if let Some(last) = last {
        print::line(screen::text(&last, width()))?;
        print::line("the run has ended")?;
    }
    Ok(())
}

/// Waits until a run that waits for its radar has processes; `None` if the person ends that, or
/// asked for one look.
fn opened(control: &Control, once: bool) -> Result<Option<Run>, Failure> {
    let (signals, mut shown) = (Signals::install()?, None);
    loop {
        let waiting = match Run::open(control.out()) {
            Ok(run) => return Ok(Some(run)),
            Err(error) => control
                .status()
                .ok()
                .filter(|it| it.notice.is_some())
                .ok_or(error)?,
        };
        if shown != waiting.notice {
            print::line(summary(&waiting))?;
            shown = waiting.notice;
        }
        if once || signals.sleep(WAIT)? {
            return Ok(None);
        }
    }
}

/// Returns the columns of the terminal; an arbitrary number if the output is not a terminal.
fn width() -> u16 {
    match io::stdout().is_terminal() {
        true => ratatui::crossterm::terminal::size().map_or(WIDTH as u16, |(columns, _)| columns),
        false => u16::MAX,
    }
}

/// Returns the last snapshot at a run that has ended; `None` if the person ended it.
fn show(
    terminal: &mut DefaultTerminal,
    snapshots: &mut Snapshots,
    every: Duration,
) -> Result<Option<Snapshot>, Failure> {
    let mut last = None;
    loop {
        let snapshot = match snapshots.take() {
            Ok(snapshot) => last.insert(snapshot),
            Err(_) if snapshots.has_ended() => return Ok(last),
            Err(error) => return Err(error),
        };
        terminal.draw(|frame| screen::draw(frame, snapshot))?;
        // Each drawing has the size of the terminal as of then.
        let quit = || {
            let event = event::poll(PERIOD)?.then(event::read).transpose()?;
            let key = event.as_ref().and_then(Event::as_key_press_event);
            Ok(key.is_some_and(|key| match key.code {
                KeyCode::Char('q') | KeyCode::Esc => true,
                KeyCode::Char('c') => key.modifiers.contains(KeyModifiers::CONTROL),
                _ => false,
            }))
        };
        if wait(snapshots, every, quit)? {
            return Ok(None);
        }
    }
}

/// Takes the poses that come within `time`; true if `quit` returns true.
fn wait(
    snapshots: &mut Snapshots,
    time: Duration,
    mut quit: impl FnMut() -> Result<bool, Failure>,
) -> Result<bool, Failure> {
    let since = Instant::now();
    while since.elapsed() < time {
        if quit()? {
            return Ok(true);
        }
        snapshots.take_poses()?;
    }
    Ok(false)
}

const SPAN: Duration = Duration::from_secs(10);
const HISTORY: usize = 300;

/// The state of a run at a moment, from its status, its newest poses and the kernel's counts.
pub struct Snapshot {
    pub status: Status,
    /// Scans with a pose, 1/s.
    pub rate: f64,
    /// Scans that were published and have no pose; `None` if the source does not report them.
    pub in_flight: Option<u64>,
    /// Of the poses of the last 10 s that were seen.
    pub latency: Latency,
    /// The basis of those motions, and the basis of the newest motion in words.
    pub witnesses: WitnessCounts,
    /// Rates of the samples of gyro and wheels, in words.
    pub samples: Option<String>,
    pub basis: Option<&'static str>,
    pub processes: Vec<Use>,
    /// The longest sensor-to-pose time between two snapshots, us, oldest first.
    pub history: Vec<u64>,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Use {
    /// Share of one processor since the last snapshot.
    pub cpu: f64,
    pub own_bytes: u64,
    /// Wake-ups since the last snapshot, 1/s.
    pub wake_ups: f64,
}

pub struct Snapshots {
    control: Control,
    poses: Observer<Pose>,
    scans: Option<Observer<Scan>>,
    rates: SampleRates,
    recent: VecDeque<PoseHeader>,
    longest_us: u64,
    /// Since when scans wait for their poses and none comes.
    owed_since: Option<Instant>,
    has_new: bool,
    history: VecDeque<u64>,
    /// The time, the poses and the usage by process of the snapshot before.
    earlier: Option<(Instant, u64, BTreeMap<u32, Usage>)>,
}

impl Snapshots {
    pub fn of(control: Control, poses: Observer<Pose>, scans: Option<Observer<Scan>>) -> Self {
        Self {
            control,
            poses,
            scans,
            rates: SampleRates::default(),
            recent: VecDeque::new(),
            longest_us: 0,
            owed_since: None,
            has_new: false,
            history: VecDeque::new(),
            earlier: None,
        }
    }

    pub fn has_ended(&self) -> bool {
        !self.control.is_there() || self.control.status().is_err()
    }

    /// Takes the poses and the scans that have come. Those that were missed do not matter: the rest
    /// is a sample.
    pub fn take_poses(&mut self) -> Result<(), Failure> {
        while let Next::Message(pose, _) = self.poses.next(Duration::ZERO)? {
            let pose = *pose.header();
            let latency_ns = pose.item.sensor_to_pose_ns();
            self.longest_us = self.longest_us.max(latency_ns.max(0) as u64 / 1000);
            self.recent.push_back(pose);
            self.has_new = true;
        }
        if let Some(scans) = &mut self.scans {
            while let Next::Message(scan, _) = scans.next(Duration::ZERO)? {
                self.rates.add(scan.header(), scan.values());
            }
        }
        Ok(())
    }

    pub fn take(&mut self) -> Result<Snapshot, Failure> {
        let status = self.control.status()?;
        let now = Instant::now();
        self.take_poses()?;
        // By their own time: an observer that has just come receives older ones first.
        let oldest_ns = clock::now_ns() - SPAN.as_nanos() as i64;
        let published_ns =
            |pose: &PoseHeader| pose.item.hops[StageId::PoseIntegration as usize].published_ns;
        self.recent.retain(|pose| published_ns(pose) >= oldest_ns);
        let mut meter = LatencyMeter::default();
        self.recent.iter().for_each(|pose| meter.add(pose));
        let motions = || {
            let motions = self.recent.iter().filter(|pose| !pose.item.is(flag::BREAK));
            motions.map(|pose| &pose.motion.refinement)
        };
        let witnesses = WitnessCounts::of(motions());
        let basis = motions().next_back().map(|motion| motion.basis().name());
        let done = status.poses + status.dropped;
        let in_flight = status.published.map(|it| it.saturating_sub(done));
        self.draw(now, in_flight);
        let pids = status.processes.iter().map(|process| process.pid);
        let usage = pids.filter_map(|pid| Some((pid, Usage::of(pid)?)));
        let usage: BTreeMap<u32, Usage> = usage.collect();
        let current = (now, status.poses, usage.clone());
        let earlier = self.earlier.replace(current.clone());
        let (at, poses, before) = earlier.unwrap_or(current);
        let elapsed = now - at;
        let per_s = |count: u64| count as f64 / elapsed.as_secs_f64().max(1e-9);
        let used = |pid: u32| {
            let now = usage.get(&pid).copied().unwrap_or_default();
            let before = before.get(&pid).copied().unwrap_or(now);
            Use {
                cpu: now.processor_share(&before, elapsed),
                own_bytes: now.own_bytes,
                wake_ups: per_s(now.wake_ups.saturating_sub(before.wake_ups)),
            }
        };
        Ok(Snapshot {
            rate: per_s(status.poses.saturating_sub(poses)),
            in_flight,
            latency: meter.latency(),
            witnesses,
            samples: self.rates.health().in_words(),
            basis,
            processes: status.processes.iter().map(|it| used(it.pid)).collect(),
            history: self.history.iter().copied().collect(),
            status,
        })
    }

    /// Adds the longest time since the last snapshot to the drawing: while poses are due and none
    /// arrives, the duration of the wait.
    fn draw(&mut self, now: Instant, in_flight: Option<u64>) {
        let is_owed =
            !std::mem::take(&mut self.has_new) && in_flight.is_some_and(|scans| scans > 0);
        self.owed_since = is_owed.then(|| self.owed_since.unwrap_or(now));
        let owed = self.owed_since.map_or(Duration::ZERO, |since| now - since);
        let longest_us = std::mem::take(&mut self.longest_us).max(owed.as_micros() as u64);
        self.history.push_back(longest_us);
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
    }
}
