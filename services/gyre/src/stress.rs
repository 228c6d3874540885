//! `gyre stress`: whether a pipeline meets its deadline on this computer.

use std::{fs, path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, inputs::Inputs, own, print},
};
use gyre_contract::{StageId, run::Scenario};
use gyre_matching::RefinementKind;
use gyre_results::{
    Content, Out,
    machine::{Machine, today},
};
use gyre_tools::stress::{
    Options, Others, Provenance, Report, TestedPipeline, report::Verdict, witness_fault,
};

use crate::{arguments::RunArguments, preflight, program, run::resolve, simulate};

#[derive(Debug, Args)]
pub struct StressArguments {
    /// The configuration, whose section `[budget]` is the verdict, and the recording. Default: the
    /// configuration's simulation, which is rendered first, or its source.data.
    #[command(flatten)]
    pub inputs: Inputs,
    /// A scenario; may be repeated. Default: all.
    #[arg(long = "scenario", value_name = "NAME")]
    pub scenarios: Vec<Scenario>,
    /// Print the scenarios, a line each.
    #[arg(long)]
    pub list: bool,
    /// The folder of the report. Default: `out/stress`.
    #[arg(long, default_value = "out/stress")]
    pub out: PathBuf,
    /// Time for which each scenario is measured, s.
    #[arg(long, value_name = "S", default_value = "60", value_parser = seconds, conflicts_with = "quick")]
    pub duration: f64,
    /// As --duration 10, for continuous integration.
    #[arg(long)]
    pub quick: bool,
    /// The stage that is slowed, stopped or killed; may be repeated. Default: masking is slowed,
    /// all are stopped or killed.
    #[arg(long = "stage", value_name = "NAME", value_parser = stage)]
    pub stages: Vec<StageId>,
    /// For the order of stages that are stopped or killed.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// The exit code without a verdict on the pipeline.
const NOT_CARRIED_OUT: u8 = 2;
const QUICK_S: f64 = 10.0;
/// The longest part of a simulated drive that is rendered, scans: a minute of a 4 Hz radar. It is
/// played again and again.
const RENDERED: usize = 240;

/// The exit code is 0 if all limits are kept, 1 if not, and 2 without a verdict.
pub fn stress(arguments: &StressArguments) -> Result<ExitCode, Failure> {
    if arguments.list {
        for scenario in Scenario::ALL {
            print::line(format_args!("{scenario:11}  {}", scenario.line()))?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    Ok(match carry_out(arguments) {
        Ok(report) if report.has(Verdict::Failed) => ExitCode::FAILURE,
        Ok(report) if report.has(Verdict::NotCarriedOut) => ExitCode::from(NOT_CARRIED_OUT),
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            print::note(format_args!("gyre stress: {error}"));
            ExitCode::from(NOT_CARRIED_OUT)
        }
    })
}

fn carry_out(arguments: &StressArguments) -> Result<Report, Failure> {
    let out = Out::lock_for(&arguments.out, Content::STRESS)?;
    let mut configuration = resolve(&RunArguments {
        inputs: arguments.inputs.clone(),
        ..RunArguments::default()
    })?;
    // Many runs would write to one file.
    configuration.record = Default::default();
    render(&mut configuration, &out)?;
    // First, since a radar that is configured is no recording, and would be asked for its scans.
    let played = gyre_configuration::open(&configuration)?;
    let period = Duration::from_nanos(played.dataset.period_ns().max(1) as u64);
    let checked = preflight::check(&configuration, &mut preflight::ask)?;
    let file = out.join("config.toml");
    fs::write(&file, configuration.to_toml()?)?;
    let stages = StageId::ALL.into_iter();
    let turn = configuration.source.played(played.dataset.scans());
    let odometry = &configuration.odometry;
    let tested = TestedPipeline {
        configuration: file,
        out: out.path().to_owned(),
        period,
        first_ns: played.dataset.nominal_stamp_ns(turn.start),
        turn,
        others: Others {
            used: [
                odometry.gyro.is_used(),
                odometry.wheels.is_used(),
                odometry.doppler.is_used(),
            ],
            are_weighed: odometry.refinement.kind != RefinementKind::None,
        },
        stages: stages.filter(|stage| configuration.has(*stage)).collect(),
        budget: configuration.budget.clone(),
        shared_bytes: checked.footprint.total() as u64,
    };
    let options = options(arguments, &tested)?;
    let provenance = provenance(arguments, &configuration)?;
    let mut printed = Ok(());
    let judged = &mut |verdict: &str| printed = print::line(verdict);
    let note = &mut |line: &str| print::note(line);
    let mut report = gyre_tools::stress::stress(&tested, &options, note, judged);
    report.provenance = provenance;
    report.write(out.path())?;
    printed?;
    print::line(format_args!(
        "report in {}: report.json",
        out.path().display()
    ))?;
    Ok(report)
}

fn render(configuration: &mut Configuration, out: &Out) -> Result<(), Failure> {
    let Some(mut simulation) = configuration.simulation.take() else {
        return Ok(());
    };
    let whole = gyre_simulator::SimulatedDrive::new(&simulation)?.open(&configuration.dataset)?;
    if whole.len() > RENDERED {
        simulation.scans = Some(RENDERED);
    }
    let recording = out.join("recording");
    simulate::store(&simulation, &recording, true)?;
    configuration.source.data = recording;
    Ok(())
}

/// All scenarios except faults of gyro and wheels that are absent from the run or its recording.
fn possible(tested: &TestedPipeline) -> Vec<Scenario> {
    let all = Scenario::ALL.into_iter();
    all.filter(|scenario| match witness_fault::lacks(tested, *scenario) {
        None => true,
        Some(lacking) => {
            print::note(format_args!("{scenario}: left out: {lacking}"));
            false
        }
    })
    .collect()
}

fn options(arguments: &StressArguments, tested: &TestedPipeline) -> Result<Options, Failure> {
    let scenarios = match arguments.scenarios.is_empty() {
        true => possible(tested),
        false => arguments.scenarios.clone(),
    };
    let duration_s = match arguments.quick {
        true => QUICK_S,
        false => arguments.duration,
    };
    let mut stages = arguments.stages.iter();
    match stages.find(|stage| !tested.stages.contains(stage)) {
        None => Ok(Options {
            scenarios,
            duration: Duration::from_secs_f64(duration_s),
            stages: arguments.stages.clone(),
            seed: arguments.seed,
        }),
        Some(stage) => Err(format!("this run has no stage {}", stage.name()).into()),
    }
}

fn provenance(
    arguments: &StressArguments,
    configuration: &Configuration,
) -> Result<Provenance, Failure> {
    let file = arguments.inputs.given()?.configuration;
    Ok(Provenance {
        date: today(),
        machine: Machine::this().to_string(),
        gyre: env!("CARGO_PKG_VERSION").to_owned(),
        build: program::digest(&own())?,
        configuration: file.map_or_else(|| configuration.data(), |file| file.display().to_string()),
        source: configuration.data(),
    })
}

/// Parses a duration: 2 s to a week.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds| (2.0..=604_800.0).contains(seconds));
    seconds.ok_or_else(|| "a number from 2 to 604800 is needed".to_owned())
}

fn stage(name: &str) -> Result<StageId, String> {
    StageId::by_name(name).ok_or_else(|| {
        let names = StageId::ALL.map(StageId::name).join(", ");
        format!("there is no stage `{name}`; there are {names}")
    })
}
