//! `gyre stress`: whether a pipeline meets its deadline on this computer.

use std::{fs, process::ExitCode, time::Duration};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, own, print},
};
use gyre_contract::{StageId, run::Scenario};
use gyre_results::{
    Content, Out,
    machine::{Machine, today},
};
use gyre_tools::stress::{Provenance, Report, StressArguments, TestedPipeline, report::Verdict};

use crate::{
    arguments::{RunArguments, resolve},
    plan, preflight, simulate,
};

/// The exit code without a verdict on the pipeline.
const NOT_CARRIED_OUT: u8 = 2;
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
    fs::write(out.join("config.toml"), configuration.to_toml()?)?;
    let stages = StageId::ALL.into_iter();
    let turn = configuration.source.played(played.dataset.scans());
    let tested = TestedPipeline {
        out: out.path().to_owned(),
        period,
        turn,
        stages: stages.filter(|stage| configuration.has(*stage)).collect(),
        budget: configuration.budget.clone(),
        shared_bytes: checked.footprint.total() as u64,
    };
    let provenance = provenance(arguments, &configuration)?;
    gyre_tools::stress::stress(&tested, arguments, provenance)
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
    simulate::replace(&simulation, &recording)?;
    configuration.source.data = recording;
    Ok(())
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
        build: plan::digest(&own())?,
        configuration: file.map_or_else(|| configuration.data(), |file| file.display().to_string()),
        source: configuration.data(),
    })
}
