//! The scans that are done: a bar on a terminal, plain lines elsewhere.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use gyre_configuration::terminal::{WIDTH, print, wrap};
use indicatif::{ProgressBar, ProgressStyle};

/// Time between two plain lines.
const EVERY: Duration = Duration::from_secs(2);

pub struct Bar {
    bar: Option<ProgressBar>,
    /// `/100`, or nothing without an end.
    of: String,
    last_line: Instant,
}

impl Bar {
    /// `None`: scans without end.
    pub fn new(scans: Option<usize>) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let (bar, template) = match scans {
                Some(scans) => (
                    ProgressBar::new(scans as u64),
                    "{bar:32} {pos}/{len} scans  {msg}",
                ),
                None => (ProgressBar::new_spinner(), "{spinner} {pos} scans  {msg}"),
            };
            let style = ProgressStyle::with_template(template);
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        Self {
            bar,
            of: scans.map_or(String::new(), |scans| format!("/{scans}")),
            last_line: Instant::now(),
        }
    }

    /// Shows the scans that are done, with a message; the bar is at `passed` scans.
    pub fn scans(&mut self, done: u64, passed: u64, message: String) {
        match &self.bar {
            Some(bar) => {
                bar.set_position(passed);
                bar.set_message(message);
            }
            None => self.show(format!("{done}{} scans  {message}", self.of)),
        }
    }

    /// Shows a message in the bar, or now and then in a line.
    pub fn show(&mut self, message: String) {
        match &self.bar {
            Some(bar) => bar.set_message(message),
            None if self.last_line.elapsed() >= EVERY => {
                self.last_line = Instant::now();
                print::note(message);
            }
            None => {}
        }
    }

    pub fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(wrap(line, WIDTH).join("\n")),
            None => print::note(line),
        }
    }

    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
