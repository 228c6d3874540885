//! The report, `report.json`: for each scenario its figures, the comparison with their limits, and
//! the verdict.

use std::{fs, path::Path, time::Duration};

use gyre_client::RunError;
use gyre_configuration::terminal::Failure;
use gyre_contract::{
    WitnessCounts,
    run::{Judged, Scenario},
};
use serde::Serialize;

use crate::stress::{
    fault::Fault,
    processes::Cost,
    record::{Counts, RunLatency},
};

/// The version of `report.json`. A key that changes its meaning or goes raises it; one that is
/// added does not.
const VERSION: u32 = 4;

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Provenance {
    /// The date, UTC.
    pub date: String,
    /// The processor and the number of its cores.
    pub machine: String,
    pub gyre: String,
    /// BLAKE3 digest of the program.
    pub build: String,
    /// The file of the configuration; the resolved one lies beside the report.
    pub configuration: String,
    pub source: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    version: u32,
    pub provenance: Provenance,
    pub outcomes: Vec<ScenarioOutcome>,
}

impl Report {
    pub fn of(outcomes: Vec<ScenarioOutcome>, provenance: Provenance) -> Self {
        Self {
            version: VERSION,
            provenance,
            outcomes,
        }
    }

    pub fn has(&self, verdict: Verdict) -> bool {
        self.outcomes.iter().any(|it| it.verdict == verdict)
    }

    pub fn write(&self, out: &Path) -> Result<(), Failure> {
        let path = out.join("report.json");
        let text = serde_json::to_string_pretty(self)?;
        Ok(fs::write(&path, text).map_err(RunError::file(&path))?)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    pub key: &'static str,
    /// The measured figure; `None`: there is no figure, which misses the limit.
    pub measured: Option<f64>,
    pub limit: f64,
    pub passed: bool,
}

impl Check {
    /// The measured figure must not be above the limit.
    pub fn at_most(key: &'static str, measured: Option<f64>, limit: f64) -> Self {
        Self {
            key,
            measured,
            limit,
            passed: measured.is_some_and(|measured| measured <= limit),
        }
    }

    /// The measured figure must not be below the limit.
    pub fn at_least(key: &'static str, measured: Option<f64>, limit: f64) -> Self {
        Self {
            passed: measured.is_some_and(|measured| measured >= limit),
            ..Self::at_most(key, measured, limit)
        }
    }

    /// Returns `p99_ms 312.4, limit 250`.
    pub fn sentence(&self) -> String {
        let measured = self.measured.map(|measured| format!("{measured:.1}"));
        let measured = measured.as_deref().unwrap_or("not measured");
        format!("{} {measured}, limit {}", self.key, self.limit)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// All limits are kept, and the run has recovered from all faults.
    Passed,
    /// A limit is not kept, or the run has ended, or not recovered.
    Failed,
    NotJudged,
    /// It could not be carried out, which is no verdict on the pipeline.
    NotCarriedOut,
}

impl Verdict {
    const fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::NotJudged => "not judged",
            Self::NotCarriedOut => "NOT CARRIED OUT",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScenarioOutcome {
    pub scenario: Scenario,
    pub verdict: Verdict,
    pub checks: Vec<Check>,
    /// A failure that does not depend on the latency.
    pub problem: Option<String>,
    pub rate_hz: f64,
    pub duration_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figures: Option<Figures>,
    /// The largest load that passed: scans a second, or radars.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best: Option<f64>,
    /// The smallest load above it that failed, twice; `None`: none was tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<Step>,
}

impl ScenarioOutcome {
    pub fn new(scenario: Scenario, duration: Duration) -> Self {
        Self {
            scenario,
            verdict: Verdict::NotJudged,
            checks: Vec::new(),
            problem: None,
            rate_hz: scenario.rate_hz(),
            duration_s: duration.as_secs_f64(),
            figures: None,
            best: None,
            failed: None,
            steps: Vec::new(),
        }
    }

    #[must_use]
    pub fn judged(mut self) -> Self {
        let figures = self.figures.as_ref();
        let had_faults = figures.is_some_and(|figures| !figures.faults.is_empty());
        let has_recovered = self.scenario.judged() == Judged::ByRecovery && had_faults;
        self.verdict = match (&self.problem, self.checks.as_slice()) {
            (Some(_), _) => Verdict::Failed,
            (None, checks) if checks.iter().any(|check| !check.passed) => Verdict::Failed,
            (None, []) if !has_recovered => Verdict::NotJudged,
            (None, _) => Verdict::Passed,
        };
        self
    }

    /// The same, not carried out, if a load or a fault was omitted. A failure stands all the same.
    #[must_use]
    pub fn unless(mut self, omitted: Option<String>) -> Self {
        if self.verdict != Verdict::Failed && omitted.is_some() {
            self.verdict = Verdict::NotCarriedOut;
            self.problem = omitted;
        }
        self
    }

    pub fn sentence(&self) -> String {
        let mut sentence = format!("{}: {}", self.scenario, self.verdict.name());
        let failed = self.checks.iter().filter(|check| !check.passed);
        let problem = self.problem.iter().cloned();
        for reason in problem.chain(failed.map(Check::sentence)) {
            sentence += &format!("; {reason}");
        }
        if let Some(figures) = &self.figures {
            sentence += &format!(" ({})", figures.sentence());
        }
        sentence += &match (self.best, self.failed) {
            (Some(best), Some(failed)) => format!(" ({best:.1}; {failed:.1} failed twice)"),
            (Some(best), None) => format!(" ({best:.1})"),
            (None, _) => String::new(),
        };
        sentence
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    #[serde(flatten)]
    pub latency: RunLatency,
    pub faults: Vec<Fault>,
    /// The basis of the motions of the first turn of the recording.
    pub motions: WitnessCounts,
    pub processes: Vec<Cost>,
    pub shared_bytes: u64,
}

impl Figures {
    /// Returns the share of the scans that were due and have no pose, %.
    pub fn drops_percent(&self) -> Option<f64> {
        let Counts { due, dropped, .. } = self.latency.counts;
        (due > 0).then(|| 100.0 * dropped as f64 / due as f64)
    }

    /// Returns the longest recovery from a fault, ms; `None` if a fault had no recovery.
    pub fn longest_recovery_ms(&self) -> Option<f64> {
        let all: Option<Vec<f64>> = self.faults.iter().map(|fault| fault.recovery_ms).collect();
        all?.into_iter().reduce(f64::max)
    }

    /// Returns a sentence such as
    /// `p50 4.5, p99 7.0 of 480, max 7.2 ms; 0 of 480 scans dropped; processor 3.8 %, memory 9 MB`.
    fn sentence(&self) -> String {
        let (cpu, memory) = (self.cpu_percent(), self.memory_mb());
        let used = format!("processor {cpu:.1} %, memory {memory:.0} MB");
        if self.latency.counts.due == 0 {
            return used;
        }
        let latency = &self.latency.sensor_to_pose;
        let ms = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
        let Counts { due, dropped, .. } = self.latency.counts;
        let (p50, max) = (ms(latency.p50_ms), ms(latency.max_ms));
        let p99 = ms(latency.p99_ms) + &latency.p99_mark();
        let faults = match self.faults.len() {
            0 => String::new(),
            1 => "; 1 fault".to_owned(),
            faults => format!("; {faults} faults"),
        };
        format!(
            "p50 {p50}, p99 {p99}, max {max} ms; {dropped} of {due} scans dropped{faults}; {used}"
        )
    }

    pub fn cpu_percent(&self) -> f64 {
        self.processes.iter().map(|cost| cost.cpu_percent).sum()
    }

    pub fn memory_mb(&self) -> f64 {
        let own: f64 = self.processes.iter().map(|cost| cost.own_mb).sum();
        own + self.shared_bytes as f64 * 1e-6
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Step {
    /// Scans a second, or radars.
    pub level: f64,
    /// True if all its pipelines keep the limits.
    pub passed: bool,
    /// Scans that were due, in all pipelines.
    pub due: u64,
    /// Scans without a pose, in all pipelines.
    pub dropped: u64,
    /// The largest 99th percentile of its pipelines, ms; of fewer than a hundred scans the maximum.
    pub p99_ms: Option<f64>,
    pub reason: Option<String>,
}

impl Step {
    /// A step whose runs could not be started.
    pub fn not_started(level: f64, reason: String) -> Self {
        Self {
            level,
            reason: Some(reason),
            ..Self::default()
        }
    }

    pub fn of(level: f64, pipelines: &[(Vec<Check>, Option<String>, Figures)]) -> Self {
        let figures = || pipelines.iter().map(|(.., figures)| figures);
        let latencies = figures().map(|it| &it.latency.sensor_to_pose);
        let p99_ms = latencies.filter_map(|it| it.judged(it.p99_ms));
        let reason = pipelines.iter().find_map(|(checks, problem, _)| {
            let failed = checks.iter().find(|check| !check.passed);
            problem.clone().or_else(|| failed.map(Check::sentence))
        });
        Self {
            level,
            passed: reason.is_none(),
            due: figures().map(|it| it.latency.counts.due).sum(),
            dropped: figures().map(|it| it.latency.counts.dropped).sum(),
            p99_ms: p99_ms.reduce(f64::max),
            reason,
        }
    }

    /// Returns `8.0 scans/s: p99 14.2 ms, 0 of 80 dropped`.
    pub fn sentence(&self, unit: &str) -> String {
        let Self {
            level,
            due,
            dropped,
            ..
        } = self;
        let p99 = self.p99_ms.map(|ms| format!("p99 {ms:.1} ms"));
        let p99 = p99.as_deref().unwrap_or("no pose");
        let reason = self.reason.as_ref().map(|reason| format!(": {reason}"));
        let reason = reason.unwrap_or_default();
        format!("  {level:.1} {unit}: {p99}, {dropped} of {due} dropped{reason}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::fault::FaultKind;

    #[test]
    fn a_figure_on_its_limit_keeps_it_and_a_missing_one_does_not() {
        assert!(Check::at_most("p99_ms", Some(100.0), 100.0).passed);
        assert!(!Check::at_most("p99_ms", Some(100.1), 100.0).passed);
        assert!(!Check::at_most("p99_ms", None, 100.0).passed);
        assert!(Check::at_least("radars", Some(2.0), 2.0).passed);
        assert!(!Check::at_least("radars", Some(1.0), 2.0).passed);
        let sentence = Check::at_most("p99_ms", Some(312.44), 100.0).sentence();
        assert_eq!(sentence, "p99_ms 312.4, limit 100");
    }

    /// An outcome with faults after which the run has recovered, and with these measured figures:
    /// at most 250 is allowed.
    fn outcome(scenario: Scenario, faults: usize, measured: &[f64]) -> ScenarioOutcome {
        let fault = Fault {
            kind: FaultKind::Kill,
            stage: "masking",
            at_s: 1.5,
            recovery_ms: Some(40.0),
            ended: None,
        };
        let checks = measured
            .iter()
            .map(|ms| Check::at_most("p99_ms", Some(*ms), 250.0));
        ScenarioOutcome {
            checks: checks.collect(),
            figures: Some(Figures {
                faults: vec![fault; faults],
                ..Figures::default()
            }),
            ..ScenarioOutcome::new(scenario, Duration::from_secs(1))
        }
    }

    #[test]
    fn a_scenario_is_judged_by_its_limits_or_by_its_recovery() {
        for (scenario, faults, measured, verdict) in [
            (Scenario::Steady, 0, &[][..], Verdict::NotJudged),
            (Scenario::Steady, 0, &[200.0], Verdict::Passed),
            (Scenario::Steady, 0, &[200.0, 300.0], Verdict::Failed),
            (Scenario::Kills, 1, &[], Verdict::Passed),
            (Scenario::SlowStage, 0, &[], Verdict::NotJudged),
        ] {
            let judged = outcome(scenario, faults, measured).judged();
            assert_eq!(judged.verdict, verdict, "{scenario}, {measured:?}");
        }
        let failed = outcome(Scenario::Steady, 0, &[300.0]).judged();
        assert!(failed.sentence().contains("p99_ms 300.0, limit 250"));
        assert!(Report::of(vec![failed], Provenance::default()).has(Verdict::Failed));
    }

    #[test]
    fn a_problem_fails_a_scenario_and_an_omission_is_no_verdict() {
        let omitted = Some("nothing was done".to_owned());
        let mut kills = outcome(Scenario::Kills, 0, &[200.0]);
        let not_done = kills.clone().judged().unless(omitted.clone());
        assert_eq!(not_done.verdict, Verdict::NotCarriedOut);
        assert!(not_done.sentence().contains("nothing was done"));
        kills.problem = Some("the run has ended".to_owned());
        assert_eq!(kills.judged().unless(omitted).verdict, Verdict::Failed);
    }
}
