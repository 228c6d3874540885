//! One scenario after the other.

use std::{sync::Arc, thread};

use gyre_client::run::{free_shared_memory, sweep};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{
    StageId,
    run::{Limits, RADAR_HZ, Scenario},
};

use crate::stress::{
    Provenance, Report, StressArguments, TestedPipeline,
    fault::{self, FaultKind},
    helper::Work,
    pipeline::{Measured, Setup, measure},
    report::{Check, Figures, ScenarioOutcome, Step, Verdict},
    search::{Found, Steps, largest, step_duration},
};

const BURST: u64 = 3;
const MEMORY_SHARE: f64 = 0.9;
/// Programs that read all topics.
const OBSERVERS: usize = 8;
/// A stage is made slower than the radar by this factor.
const SLOWER: f64 = 1.2;
/// The limit of p99 where the budget names none: the period of a 4 Hz radar, ms.
const PERIOD_MS: f64 = 250.0;
/// Levels of the ramp in a doubling of the rate.
const LEVELS: u32 = 16;
/// The highest level of the ramp: 2^8 times the radar's rate.
const MOST_LEVELS: u32 = 8 * LEVELS;
/// The largest fleet that is tried.
const MOST_RADARS: u32 = 64;
/// The rate of the source has a limit: 1000 times the sensor's own.
const MOST_HZ: f64 = 1000.0;

/// Carries out the scenarios, prints the verdict on each, and writes the report.
///
/// A scenario that could not be carried out has that as its verdict, and the next ones follow.
pub fn stress(
    tested: &TestedPipeline,
    arguments: &StressArguments,
    provenance: Provenance,
) -> Result<Report, Failure> {
    let mut stages = arguments.stages.iter();
    if let Some(stage) = stages.find(|stage| !tested.stages.contains(stage)) {
        return Err(format!("this run has no stage {}", stage.name()).into());
    }
    let scenarios = match arguments.scenarios.is_empty() {
        true => Vec::from(Scenario::ALL),
        false => arguments.scenarios.clone(),
    };
    let (mut outcomes, mut printed) = (Vec::new(), Ok(()));
    for scenario in scenarios {
        print::note(format_args!("{scenario}: {}", scenario.line()));
        let campaign = Campaign {
            tested,
            arguments,
            scenario,
            limits: tested.budget.of(scenario),
        };
        let outcome = campaign.outcome().unwrap_or_else(|error| ScenarioOutcome {
            verdict: Verdict::NotCarriedOut,
            problem: Some(error.to_string()),
            ..campaign.empty()
        });
        printed = print::line(outcome.sentence());
        outcomes.push(outcome);
    }
    // Helpers that were killed have left files in shared memory.
    sweep();
    let report = Report::of(outcomes, provenance);
    report.write(&tested.out)?;
    printed?;
    print::line(format_args!(
        "report in {}: report.json",
        tested.out.display()
    ))?;
    Ok(report)
}

struct Campaign<'a> {
    tested: &'a TestedPipeline,
    arguments: &'a StressArguments,
    scenario: Scenario,
    limits: Limits,
}

impl Campaign<'_> {
    fn outcome(&self) -> Result<ScenarioOutcome, Failure> {
        match self.scenario {
            Scenario::Ramp => self.ramp(),
            Scenario::Fleet => self.fleet(),
            _ => self.single(),
        }
    }

    fn empty(&self) -> ScenarioOutcome {
        ScenarioOutcome::new(self.scenario, self.arguments.duration)
    }

    fn single(&self) -> Result<ScenarioOutcome, Failure> {
        let setup = self.setup();
        if setup.faults.is_some() && setup.duration < fault::LEAST {
            let (scenario, least_s) = (self.scenario, fault::LEAST.as_secs());
            return Err(format!("{scenario} needs --duration {least_s} or more: time for a fault, and for the recovery from it").into());
        }
        let mut measured = measure(self.tested, &setup, Arc::new(()))?;
        let (problem, omitted) = (problem(&measured), measured.omitted.take());
        Ok(ScenarioOutcome {
            checks: checks(&self.limits, &measured.figures),
            problem,
            figures: Some(measured.figures),
            ..self.empty()
        }
        .judged()
        .unless(omitted))
    }

    fn setup(&self) -> Setup {
        let (scenario, arguments) = (self.scenario, self.arguments);
        let mut setup = Setup::undisturbed(scenario, scenario.rate_hz(), arguments.duration);
        let faults = |kind| {
            let stages = match arguments.stages.as_slice() {
                [] => self.tested.stages.as_slice(),
                stages => stages,
            };
            Some((kind, stages.to_vec()))
        };
        match scenario {
            Scenario::Bursts => {
                setup.burst = BURST;
                setup.set.push(format!("source.burst={BURST}"));
            }
            Scenario::Hogs => {
                let processors = thread::available_parallelism().map_or(1, usize::from);
                setup.loads = vec![Work::Spin; processors];
            }
            Scenario::Memory => setup.loads = vec![Work::Memory(MEMORY_SHARE)],
            Scenario::Observers => {
                let out = self.tested.run_out(&setup.name);
                setup.loads = vec![Work::Observe(out); OBSERVERS];
                // One place more for this process.
                setup.set.push(format!("run.observers={}", OBSERVERS + 1));
            }
            Scenario::SlowStage => setup.set.extend(self.slow_stages()),
            Scenario::Stopped => setup.faults = faults(FaultKind::Stop),
            Scenario::Kills => setup.faults = faults(FaultKind::Kill),
            _ => {}
        }
        setup
    }

    fn slow_stages(&self) -> impl Iterator<Item = String> {
        let stages = match self.arguments.stages.as_slice() {
            [] => &[StageId::Masking],
            stages => stages,
        };
        let delay_ms = 1e3 / self.scenario.rate_hz() * SLOWER;
        let delay = move |stage: &StageId| {
            let name = stage.name();
            format!("stages.{name}.delay_ms={delay_ms:.0}")
        };
        stages.iter().map(delay)
    }

    /// The limits of each step: the limits of the budget, else no drop and a p99 of a period.
    fn step_limits(&self) -> Limits {
        self.limits.or(&Limits {
            p99_ms: Some(PERIOD_MS),
            drops_percent: Some(0.0),
            ..Limits::default()
        })
    }

    fn ramp(&self) -> Result<ScenarioOutcome, Failure> {
        let rate_hz = |level: u32| RADAR_HZ * 2_f64.powf(f64::from(level) / f64::from(LEVELS));
        let most = (MOST_HZ.min(MOST_HZ / self.tested.period.as_secs_f64()) / RADAR_HZ).log2();
        let most = MOST_LEVELS.min((most * f64::from(LEVELS)) as u32);
        let mut steps = Steps::new("scans/s", print::note);
        let passes = |level| steps.passes(|| self.step(rate_hz(level), rate_hz(level), 1));
        let found = largest(0, most, |level| level + LEVELS, passes)?;
        Ok(self.found(&found, rate_hz, steps, ("rate_hz", self.limits.rate_hz)))
    }

    fn fleet(&self) -> Result<ScenarioOutcome, Failure> {
        let mut steps = Steps::new("radars", print::note);
        let passes = |radars| {
            steps.passes(|| match self.lacks_memory(radars) {
                Some(reason) => Ok(Step::not_started(f64::from(radars), reason)),
                None => self.step(f64::from(radars), RADAR_HZ, radars),
            })
        };
        let found = largest(1, MOST_RADARS, |radars| radars * 2, passes)?;
        Ok(self.found(&found, f64::from, steps, ("radars", self.limits.radars)))
    }

    fn found(
        &self,
        found: &Found,
        load: impl Fn(u32) -> f64,
        steps: Steps,
        (key, limit): (&'static str, Option<f64>),
    ) -> ScenarioOutcome {
        let best = found.best.map(&load);
        let check = limit.map(|limit| Check::at_least(key, Some(best.unwrap_or(0.0)), limit));
        ScenarioOutcome {
            checks: check.into_iter().collect(),
            best,
            failed: found.failed.map(load),
            steps: steps.all,
            ..self.empty()
        }
        .judged()
    }

    fn lacks_memory(&self, runs: u32) -> Option<String> {
        let needed = self.tested.shared_bytes * u64::from(runs);
        let free = free_shared_memory().ok().flatten()?;
        (needed > free).then(|| {
            let (needed, free) = (needed as f64 * 1e-6, free as f64 * 1e-6);
            format!("{needed:.0} MB of shared memory are needed and {free:.0} MB are free")
        })
    }

    fn step(&self, level: f64, rate_hz: f64, pipelines: u32) -> Result<Step, Failure> {
        let duration = step_duration(self.arguments.duration, rate_hz);
        let setups = (0..pipelines).map(|number| Setup {
            name: format!("{}-{number}", self.scenario),
            ..Setup::undisturbed(self.scenario, rate_hz, duration)
        });
        let measured: Vec<_> = thread::scope(|scope| {
            let ticket = Arc::new(());
            let start = |setup: Setup| {
                let ticket = Arc::clone(&ticket);
                scope.spawn(move || measure(self.tested, &setup, ticket))
            };
            let running: Vec<_> = setups.map(start).collect();
            drop(ticket);
            running.into_iter().map(|it| it.join()).collect()
        });
        let (limits, mut all) = (self.step_limits(), Vec::new());
        for measured in measured {
            match measured.map_err(|_| "a thread panicked")? {
                Ok(measured) => {
                    let checks = checks(&limits, &measured.figures);
                    all.push((checks, problem(&measured), measured.figures));
                }
                // A machine that cannot even start so many does not carry them.
                Err(error) if pipelines > 1 || rate_hz > RADAR_HZ => {
                    return Ok(Step::not_started(level, error.to_string()));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Step::of(level, &all))
    }
}

/// Returns the reason why a run has failed, whatever its latency.
fn problem(measured: &Measured) -> Option<String> {
    let figures = &measured.figures;
    if let Some(said) = &measured.died {
        return Some(format!("the run has ended: {said}"));
    }
    let unseen = figures.latency.counts.unseen;
    if unseen > 0 {
        return Some(format!(
            "{unseen} poses were not seen by the process that measures: the machine was too busy for it"
        ));
    }
    let mut lost = figures.faults.iter().filter(|it| it.recovery_ms.is_none());
    let fault = lost.next()?;
    Some(format!("no pose has followed the fault of {}", fault.stage))
}

fn checks(limits: &Limits, figures: &Figures) -> Vec<Check> {
    let latency = &figures.latency.sensor_to_pose;
    let degraded = figures.motions.degraded_percent();
    let (cpu, memory) = (Some(figures.cpu_percent()), Some(figures.memory_mb()));
    let (drops, recovery) = (figures.drops_percent(), figures.longest_recovery_ms());
    // Without scans only the cost of the processes can be judged.
    let has_scans = figures.latency.counts.due > 0;
    let has_motions = has_scans && degraded.is_some();
    #[rustfmt::skip]
    let all = [
        (has_scans, "p50_ms", latency.judged(latency.p50_ms), limits.p50_ms),
        (has_scans, "p99_ms", latency.judged(latency.p99_ms), limits.p99_ms),
        (has_scans, "max_ms", latency.max_ms, limits.max_ms),
        (has_scans, "drops_percent", drops, limits.drops_percent),
        (true, "cpu_percent", cpu, limits.cpu_percent),
        (true, "memory_mb", memory, limits.memory_mb),
        (has_motions, "degraded_percent", degraded, limits.degraded_percent),
        (!figures.faults.is_empty(), "recovery_ms", recovery, limits.recovery_ms),
    ];
    let judged = all.into_iter().filter(|it| it.0);
    judged
        .filter_map(|(_, key, measured, limit)| Some(Check::at_most(key, measured, limit?)))
        .collect()
}
