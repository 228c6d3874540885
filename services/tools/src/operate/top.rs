//! `gyre top`: rates, latencies and processes of a running run in the terminal.

mod screen;
mod snapshot;

use std::{
    io::{self, IsTerminal},
    time::{Duration, Instant},
};

use clap::Args;
use gyre_client::{Observer, Run, Signals};
use gyre_configuration::terminal::{Failure, WIDTH, print};
use ratatui::{
    DefaultTerminal,
    crossterm::event::{self, Event, KeyCode, KeyModifiers},
};

use crate::operate::choice::{RunChoice, chosen};
use snapshot::{Snapshot, Snapshots};

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

pub fn top(arguments: &TopArguments) -> Result<(), Failure> {
    let every = Duration::try_from_secs_f64(arguments.every)
        .ok()
        .filter(|every| *every >= PERIOD)
        .ok_or("--every must be 0.05 s or more")?;
    let control = chosen(&arguments.run)?;
    let run = Run::open(control.out())?;
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

type Poses = Observer<gyre_contract::Pose>;
type Scans = Observer<gyre_contract::Scan>;
