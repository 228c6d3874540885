//! The scenarios: names, descriptions, judgements.

use std::{fmt, str::FromStr};

use serde::Serialize;

/// Scans a second of the radars that most users have.
pub const RADAR_HZ: f64 = 4.0;
/// Scans a second of [`Scenario::Fast`].
const FAST_HZ: f64 = 10.0;

/// The judgement of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// By all of `[budget]`.
    ByBudget,
    /// By all of `[budget]` but drops, which the scenario causes on purpose.
    ButDrops,
    /// Only by its recovery and by `[budget.NAME]`, since its purpose is a fault.
    ByRecovery,
    /// By a figure of its own: the highest rate, the number of radars.
    ByItself,
}

/// Defines the scenarios: name, judgement, and a line that describes it.
macro_rules! scenarios {
    ($($scenario:ident: $name:literal, $judged:ident, $line:literal;)+) => {
        gyre_geometry::named! {
            /// The load or the faults of a run while its latency is measured, in the order of
            /// execution. The names are those on the command line and in `[budget.NAME]`.
            #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
            #[serde(rename_all = "kebab-case")]
            pub enum Scenario {
                $(
                    #[doc = concat!("`", $name, "`: ", $line, ".")]
                    $scenario = $name,
                )+
            }
        }

        impl Scenario {
            /// Returns the judgement of its figures.
            pub const fn judged(self) -> Judged {
                match self {
                    $(Self::$scenario => Judged::$judged,)+
                }
            }

            /// Returns a line that describes it.
            pub const fn line(self) -> &'static str {
                match self {
                    $(Self::$scenario => $line,)+
                }
            }
        }
    };
}

scenarios! {
    Idle: "idle", ByItself,
        "no scans: what waiting costs";
    Steady: "steady", ByBudget,
        "4 scans/s, nothing else";
    Fast: "fast", ByBudget,
        "10 scans/s";
    Bursts: "bursts", ButDrops,
        "4 scans/s in the mean that arrive three at once, as from a network that holds them back";
    Hogs: "hogs", ByBudget,
        "as many spinning processes as processors, at 4 scans/s";
    Memory: "memory", ByBudget,
        "a process that takes 90 % of the available memory and churns it, at 4 scans/s";
    Observers: "observers", ByBudget,
        "eight programs that read all topics, at 4 scans/s";
    SlowStage: "slow-stage", ByRecovery,
        "a stage that takes longer than the radar's period, at 4 scans/s";
    Stopped: "stopped", ByRecovery,
        "stages that are stopped for a second (SIGSTOP) and continued, at 4 scans/s";
    Kills: "kills", ByRecovery,
        "stages that are killed (SIGKILL), at 4 scans/s";
    Ramp: "ramp", ByItself,
        "rates that rise until scans are dropped or p99 is over its limit: the knee, in scans/s";
    Fleet: "fleet", ByItself,
        "more and more pipelines until one misses its deadline: the number of 4 Hz radars";
}

impl Scenario {
    /// Returns the scans a second.
    pub const fn rate_hz(self) -> f64 {
        match self {
            // One scan in a quarter of an hour and more.
            Self::Idle => 0.004,
            Self::Fast => FAST_HZ,
            _ => RADAR_HZ,
        }
    }
}

impl fmt::Display for Scenario {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Scenario {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::by_name(name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("there is no scenario `{name}`; there are {names}")
        })
    }
}
