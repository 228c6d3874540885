//! The largest load that passes: doubled until one fails, then bisected.

use std::time::Duration;

use gyre_configuration::terminal::Failure;

use crate::stress::report::Step;

/// Share of a scenario's time that a step of a search takes.
const STEP: u32 = 6;
const SHORTEST_STEP: Duration = Duration::from_secs(5);
/// Scans of a step, whatever its rate: enough for a p99 in each, so that slow and fast steps are
/// judged by the same figure.
const STEP_SCANS: f64 = 110.0;
/// Times that a level of a search may be tried. One hiccup of the machine does not decide.
const TRIES: usize = 2;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// The largest level that passed; `None` if the first one failed.
    pub best: Option<u32>,
    /// The smallest level above it that failed; `None` if the last one that may be tried passed.
    pub failed: Option<u32>,
}

/// Returns the largest level from `first` on that passes, up to `most`. `grow` returns the level to
/// try after a level that has passed.
pub fn largest<E>(
    first: u32,
    most: u32,
    grow: impl Fn(u32) -> u32,
    mut passes: impl FnMut(u32) -> Result<bool, E>,
) -> Result<Found, E> {
    let (mut best, mut level) = (None, first);
    while passes(level)? {
        best = Some(level);
        let next = grow(level).min(most);
        if next <= level {
            return Ok(Found { best, failed: None });
        }
        level = next;
    }
    while let Some(low) = best.filter(|low| level - low > 1) {
        let middle = low + (level - low) / 2;
        match passes(middle)? {
            true => best = Some(middle),
            false => level = middle,
        }
    }
    Ok(Found {
        best,
        failed: Some(level),
    })
}

pub struct Steps {
    unit: &'static str,
    note: fn(String),
    pub all: Vec<Step>,
}

impl Steps {
    /// Returns no steps; `note` receives each, whose level is a number of these units.
    pub fn new(unit: &'static str, note: fn(String)) -> Self {
        Self {
            unit,
            note,
            all: Vec::new(),
        }
    }

    /// Returns whether a level passes, at the second try at the latest.
    pub fn passes(
        &mut self,
        mut step: impl FnMut() -> Result<Step, Failure>,
    ) -> Result<bool, Failure> {
        for _ in 0..TRIES {
            let step = step()?;
            (self.note)(step.sentence(self.unit));
            let passed = step.passed;
            self.all.push(step);
            if passed {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Returns the time for which a step of a search is measured, in a scenario of this duration.
pub fn step_duration(scenario: Duration, rate_hz: f64) -> Duration {
    let share = (scenario / STEP).max(SHORTEST_STEP).min(scenario);
    share.max(Duration::from_secs_f64(STEP_SCANS / rate_hz))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    use super::*;

    #[test]
    fn the_largest_level_that_passes_is_found() {
        for (limit, most, best, failed, levels) in [
            (5, 1000, Some(5), Some(6), &[1, 2, 4, 8, 6, 5][..]),
            (100, 6, Some(6), None, &[1, 2, 4, 6]),
            (0, 6, None, Some(1), &[1]),
            (7, 1000, Some(7), Some(8), &[1, 2, 4, 8, 6, 7]),
        ] {
            let mut tried = Vec::new();
            let passes = |level| {
                tried.push(level);
                Ok::<_, ()>(level <= limit)
            };
            let found = largest(1, most, |level| level * 2, passes);
            assert_eq!(found, Ok(Found { best, failed }));
            assert_eq!(tried, levels);
        }
    }

    #[test]
    fn each_step_has_enough_scans_for_a_p99_whatever_its_rate() {
        for rate_hz in [4.0, 5.7, 10.0, 40.0, 1000.0] {
            for scenario_s in [2, 10, 60, 600] {
                let scenario = Duration::from_secs(scenario_s);
                let step_s = step_duration(scenario, rate_hz).as_secs_f64();
                assert!(step_s * rate_hz > 100.0, "{step_s} s at {rate_hz} Hz");
            }
        }
        let long = Duration::from_secs(600);
        assert_eq!(step_duration(long, 100.0), Duration::from_secs(100));
    }

    #[test]
    fn a_level_that_fails_once_is_tried_again_and_one_that_fails_twice_has_failed() {
        static NOTED: AtomicUsize = AtomicUsize::new(0);
        let mut steps = Steps::new("scans/s", |_| {
            NOTED.fetch_add(1, Relaxed);
        });
        let mut results = [false, true, false, false].into_iter();
        let mut step = || {
            let reason = "p99_ms 300.0, limit 250".to_owned();
            let passed = results.next().unwrap_or_default();
            Ok(Step {
                passed,
                ..Step::not_started(4.0, reason)
            })
        };
        assert!(steps.passes(&mut step).is_ok_and(|passes| passes));
        assert!(steps.passes(&mut step).is_ok_and(|passes| !passes));
        let tried: Vec<_> = steps.all.iter().map(|it| it.passed).collect();
        assert_eq!(tried, [false, true, false, false]);
        assert_eq!(NOTED.load(Relaxed), 4);
    }
}
