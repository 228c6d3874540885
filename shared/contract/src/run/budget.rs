//! The section `[budget]`: limits of a run.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::run::{Judged, Scenario};

/// Defines the limits, each an optional number with its key.
macro_rules! limits {
    ($($(#[doc = $doc:literal])+ $key:ident,)+) => {
        /// Limits on what `gyre stress` measures. One that is left out is not judged.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct Limits {
            $(
                $(#[doc = $doc])+
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $key: Option<f64>,
            )+
        }

        impl Limits {
            /// Returns these limits, completed by the limits of `other`.
            #[must_use]
            pub fn or(&self, other: &Self) -> Self {
                Self {
                    $($key: self.$key.or(other.$key),)+
                }
            }

            /// Returns the first key whose limit is not a number of at least 0.
            pub fn invalid(&self) -> Option<(&'static str, f64)> {
                let keys = [$((stringify!($key), self.$key),)+];
                let mut set = keys.into_iter().filter_map(|(key, limit)| Some((key, limit?)));
                set.find(|(_, limit)| !(limit.is_finite() && *limit >= 0.0))
            }
        }
    };
}

limits! {
    /// Median of the time from sensor to pose, ms. A scan that was dropped counts until the pose of
    /// the next one that was not.
    p50_ms,
    /// 99th percentile of it, ms. Of fewer than a hundred scans that is the maximum.
    p99_ms,
    /// Maximum of it, ms.
    max_ms,
    /// Scans that were due and have no pose, % of those that were due.
    drops_percent,
    /// Time from a fault (the kill, or the end of the stop) to the first pose that the stage has
    /// worked on since, ms.
    recovery_ms,
    /// Motions that the radar does not wholly determine (`along walls`, `way guessed`, `dead
    /// reckoning`, `guessed`), % of the motions before the recording repeats.
    degraded_percent,
    /// Processor time of all processes of the run, % of one processor.
    cpu_percent,
    /// Own memory of all processes of the run and its shared memory, MB.
    memory_mb,
    /// Smallest rate of the knee that `ramp` finds, scans/s.
    rate_hz,
    /// Smallest number of 4 Hz radars that `fleet` finds.
    radars,
}

/// The budget of a run: `[budget]` for all scenarios, `[budget.NAME]` for one of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Budget {
    /// The limits for all scenarios whose purpose is no fault.
    #[serde(flatten)]
    pub all: Limits,
    /// The limits for one scenario, over those for all.
    #[serde(flatten)]
    pub scenarios: BTreeMap<String, Limits>,
}

impl Budget {
    /// Returns the limits that a scenario is judged by.
    pub fn of(&self, scenario: Scenario) -> Limits {
        let own = self.scenarios.get(scenario.name());
        let own = own.cloned().unwrap_or_default();
        match scenario.judged() {
            Judged::ByBudget | Judged::ByItself => own.or(&self.all),
            Judged::ButDrops => own.or(&Limits {
                drops_percent: None,
                ..self.all.clone()
            }),
            Judged::ByRecovery => own.or(&Limits {
                recovery_ms: self.all.recovery_ms,
                ..Limits::default()
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_judged_by_its_recovery_and_the_limits_of_a_scenario_go_first() {
        let all = Limits {
            p99_ms: Some(100.0),
            drops_percent: Some(0.0),
            recovery_ms: Some(500.0),
            degraded_percent: Some(1.0),
            ..Limits::default()
        };
        let kills = Limits {
            p99_ms: Some(900.0),
            ..Limits::default()
        };
        let fast = Limits {
            drops_percent: Some(5.0),
            ..Limits::default()
        };
        let budget = Budget {
            all,
            scenarios: [("kills".to_owned(), kills), ("fast".to_owned(), fast)].into(),
        };
        for (scenario, p99_ms, drops_percent, degraded_percent) in [
            (Scenario::Kills, Some(900.0), None, None),
            (Scenario::Stopped, None, None, None),
            (Scenario::Fast, Some(100.0), Some(5.0), Some(1.0)),
            (Scenario::Bursts, Some(100.0), None, Some(1.0)),
        ] {
            let expected = Limits {
                p99_ms,
                drops_percent,
                recovery_ms: Some(500.0),
                degraded_percent,
                ..Limits::default()
            };
            assert_eq!(budget.of(scenario), expected, "{scenario}");
        }
    }

    #[test]
    fn limits_are_numbers_of_at_least_zero() {
        let limits = |p99_ms| Limits {
            p99_ms: Some(p99_ms),
            ..Limits::default()
        };
        assert_eq!(limits(0.0).invalid(), None);
        assert_eq!(limits(-1.0).invalid(), Some(("p99_ms", -1.0)));
        assert!(limits(f64::NAN).invalid().is_some());
    }
}
