//! Gyre's command line as a library: `gyre` is this crate's binary.
//!
//! Reading order: [`cli`], then [`run`] (what `gyre run` does, on a page), [`earlier`], [`plan`].

pub mod arguments;
pub mod batch;
pub mod benchmark;
pub mod calibrate;
pub mod cli;
pub mod conformance;
pub mod earlier;
#[cfg(not(all(feature = "link", feature = "ros2")))]
mod features;
pub mod inspect;
#[cfg(feature = "link")]
pub mod link;
pub mod notify;
pub mod plan;
pub mod preflight;
pub mod progress;
pub mod record;
#[cfg(feature = "ros2")]
pub mod ros2;
#[cfg(feature = "ros2")]
mod ros_args;
pub mod run;
pub mod simulate;
pub mod stage;
pub mod stress;
mod verdict;
mod waiting;
pub mod watch;

use std::{path::PathBuf, process::ExitCode};

use arguments::{RunArguments, RunOptions, results_folder};
use cli::Command;
use gyre_configuration::{
    Configuration, schema,
    terminal::{Failure, inputs::Inputs, print},
};
use gyre_contract::layout;

pub fn execute(command: Command) -> Result<ExitCode, Failure> {
    set_up_process(&command)?;
    let done = match command {
        Command::New { what } => gyre_tools::new::new(&what),
        Command::Up(arguments) => gyre_tools::operate::up(&results_folder(&arguments)?),
        Command::Down(run) => gyre_tools::operate::down(&run),
        Command::Ps(arguments) => gyre_tools::operate::ps(&arguments),
        Command::Logs(arguments) => gyre_tools::operate::logs(&arguments),
        Command::Top(arguments) => gyre_tools::operate::top(&arguments),
        Command::Restart(arguments) => gyre_tools::operate::restart(&arguments),
        Command::NewMap(run) => gyre_tools::operate::new_map(&run),
        Command::Reset(arguments) => gyre_tools::operate::reset(&arguments),
        Command::Locate(arguments) => gyre_tools::operate::locate(&arguments),
        Command::Echo(arguments) => gyre_tools::operate::echo(&arguments),
        Command::Watch(arguments) => watch::watch(&arguments),
        #[cfg(feature = "ros2")]
        Command::Ros2(arguments) => ros2::publish(&arguments),
        #[cfg(not(feature = "ros2"))]
        Command::Ros2(_) => Err(features::absent("ROS 2").into()),
        Command::StressHelper { words } => gyre_tools::stress::helper::help(&words),
        #[cfg(not(feature = "link"))]
        Command::Link { .. } => Err(features::absent(features::LINK).into()),
        Command::RadarServer(arguments) => gyre_tools::radar_server::serve(&arguments),
        Command::Inspect(arguments) => inspect::inspect(&arguments),
        Command::Report(arguments) => gyre_tools::report::report(&arguments),
        Command::Map(arguments) => gyre_tools::maps::map::map(&arguments),
        Command::Localise(arguments) => gyre_tools::maps::localise::localise(&arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(&arguments),
        Command::Masks(arguments) => gyre_tools::masks::masks(&arguments),
        Command::Export(arguments) => gyre_tools::export::export(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::Schema { markdown, messages } => print::line(schema(markdown, messages)?),
        Command::Completions { shell } => print::line(completions(shell).trim_end()),
        Command::Man { folder } => write_manual(&folder),
        // The others have exit codes of their own.
        Command::Stage { name, python } => return Ok(stage::run(&name, python)),
        Command::Guard => return Ok(guard()),
        Command::Run(arguments) => return run::run(&arguments),
        Command::Demo { set, options } => return run::run(&of_demo(set, options)),
        Command::Swap(arguments) => return gyre_tools::operate::swap(&arguments),
        Command::Shadow(arguments) => return gyre_tools::conformance::shadow::shadow(&arguments),
        Command::Batch(arguments) => return batch::batch(&arguments),
        Command::Benchmark(arguments) => return benchmark::benchmark(&arguments),
        Command::BatchDrive(arguments) => return batch::drive(&arguments),
        Command::Stress(arguments) => return stress::stress(&arguments),
        Command::Record(arguments) => return record::record(&arguments),
        #[cfg(feature = "link")]
        Command::Link { end } => return link::link(&end),
        Command::Doctor => return doctor(),
        Command::Evaluate(arguments) => {
            return match arguments.run_alone()? {
                Some(run) => verdict::judge(run),
                None => gyre_results::evaluate::evaluate(&arguments),
            };
        }
        Command::Conformance(arguments) => return conformance::conformance(&arguments),
        Command::Config(arguments) => {
            return gyre_configuration::terminal::inputs::config(&arguments);
        }
    };
    done.map(|()| ExitCode::SUCCESS)
}

/// The files of a command are its user's alone: all but a simulated recording. The umask of a child
/// process may be the one that the transport sets for a moment.
fn set_up_process(command: &Command) -> Result<(), Failure> {
    gyre_transport::wake::report_file_size_limit()?;
    if !matches!(command, Command::Simulate(_)) {
        gyre_transport::run::keep_files_private();
    }
    Ok(())
}

fn guard() -> ExitCode {
    let root = std::env::var_os(gyre_transport::run::ENVIRONMENT).map(PathBuf::from);
    gyre_supervise::guard(std::io::stdin().lock(), root.as_deref());
    ExitCode::SUCCESS
}

fn of_demo(set: Vec<String>, options: RunOptions) -> RunArguments {
    let what = vec!["gyre:configs/demo.toml".into()];
    RunArguments {
        inputs: Inputs { what, set },
        options,
        ..RunArguments::default()
    }
}

/// Returns the schema of configurations or the layout of messages, in JSON or for a page.
fn schema(markdown: bool, messages: bool) -> Result<String, Failure> {
    Ok(match (messages, markdown) {
        (true, true) => layout::tables(),
        (true, false) => serde_json::to_string_pretty(&layout::Layout::new())?,
        (false, true) => schema::reference(),
        (false, false) => schema::json(),
    })
}

fn completions(shell: clap_complete::Shell) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut cli::command(), "gyre", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

fn write_manual(folder: &std::path::Path) -> Result<(), Failure> {
    gyre_storage::create_folder(folder)?;
    Ok(clap_mangen::generate_to(cli::command(), folder)?)
}

/// Checks this machine for missing requirements of a run of the default configuration, whose scans
/// are as large as Oxford's.
fn doctor() -> Result<ExitCode, Failure> {
    let simulated = Configuration::of_overrides(&["simulation.scans=2".to_owned()])?;
    let checked = preflight::check(&simulated, &mut preflight::ask)?;
    gyre_tools::doctor::doctor(&checked.footprint)
}
