//! Gyre's command line as a library: `gyre` is this crate's binary, and the laboratory builds on
//! the same parts.
//!
//! Reading order: [`cli`], then [`run`] (what `gyre run` does, on a page), [`earlier`],
//! [`configuration`], [`results`].

pub mod batch;
pub mod calibrate;
pub mod cli;
pub mod configuration;
pub mod conformance;
pub mod doctor;
pub mod earlier;
pub mod echo;
pub mod evaluate;
pub mod export;
#[cfg(not(all(feature = "link", feature = "ros2")))]
mod features;
pub mod identity;
pub mod inspect;
pub mod judgement;
pub mod link;
pub mod localise;
pub mod machine;
pub mod map;
pub mod masks;
pub mod notify;
pub mod odometry;
pub mod operate;
pub mod out;
pub mod picture;
pub mod preflight;
pub mod print;
pub mod program;
pub mod progress;
pub mod radar;
pub mod radar_server;
pub mod record;
pub mod results;
pub mod ros2;
pub mod run;
pub mod schema;
pub mod shadow;
pub mod simulate;
pub mod stage;
pub mod stress;
pub mod summary;
pub mod watch;

use std::process::ExitCode;

use clap::Parser;
use cli::Command;

/// The exit code after wrong arguments.
const WRONG_ARGUMENTS: u8 = 2;

/// A sentence for the person at the terminal.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Executes a command of `gyre`.
///
/// # Errors
/// One sentence that says what, where and what to do.
pub fn execute(command: Command) -> Result<ExitCode, Failure> {
    gyre_stage::wake::report_file_size_limit()?;
    if is_private(&command) {
        gyre_stage::run::keep_files_private();
    }
    match command {
        Command::Stage { name } => Ok(stage::run(&name)),
        Command::Guard => {
            gyre_supervise::guard(std::io::stdin().lock());
            Ok(ExitCode::SUCCESS)
        }
        Command::Run(arguments) => run::run(&arguments),
        Command::Up(arguments) => operate::up(&arguments),
        Command::Down(run) => operate::down(&run),
        Command::Ps(arguments) => operate::ps(&arguments),
        Command::Logs(arguments) => operate::logs(&arguments),
        Command::Top(arguments) => operate::top(&arguments),
        Command::Restart(arguments) => operate::restart(&arguments),
        Command::Swap(arguments) => operate::swap(&arguments),
        Command::Echo(arguments) => echo::echo(&arguments),
        Command::Watch(arguments) => watch::watch(&arguments),
        Command::Ros2(arguments) => ros2::publish(&arguments),
        Command::Shadow(arguments) => shadow::shadow(&arguments),
        Command::Batch(arguments) => batch::batch(&arguments),
        Command::BatchDrive(arguments) => batch::drive(&arguments),
        Command::Stress(arguments) => stress::stress(&arguments),
        Command::StressHelper { words } => stress::help(&words),
        Command::Record(arguments) => Ok(record::record(&arguments)),
        Command::Link(arguments) => link::link(&arguments),
        Command::Doctor(arguments) => doctor::doctor(&arguments),
        Command::RadarServer(arguments) => radar_server::serve(&arguments),
        Command::Inspect(arguments) => inspect::inspect(&arguments),
        Command::Evaluate(arguments) => evaluate::evaluate(&arguments),
        Command::Map(arguments) => map::map(&arguments),
        Command::Localise(arguments) => localise::localise(&arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(&arguments),
        Command::Masks(arguments) => masks::masks(&arguments),
        Command::Export(arguments) => export::export(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::Conformance(arguments) => conformance::conformance(&arguments),
        Command::Schema(arguments) => schema::schema(&arguments),
    }
}

/// Returns whether the files of a command are its user's alone: those of a run and of its
/// observers.
fn is_private(command: &Command) -> bool {
    matches!(
        command,
        Command::Run(_)
            | Command::Up(_)
            | Command::Echo(_)
            | Command::Watch(_)
            | Command::Ros2(_)
            | Command::Shadow(_)
            | Command::Batch(_)
            | Command::Stress(_)
            | Command::Record(_)
            | Command::Link(_)
            | Command::Conformance(_)
    )
}

/// Parses the command line. Help is printed to standard output, a wrong argument to standard error,
/// and the exit code is returned.
///
/// # Errors
/// Help that was asked for, or a wrong argument.
pub fn parse<P: Parser>(program: &str) -> Result<P, ExitCode> {
    P::try_parse().map_err(|error| match (error.use_stderr(), error.print()) {
        (true, _) => ExitCode::from(WRONG_ARGUMENTS),
        (false, written) => report(program, print::printed(written).map(|()| ExitCode::SUCCESS)),
    })
}

/// The exit code of a command; a failure is printed as `program: sentence`.
pub fn report(program: &str, result: Result<ExitCode, Failure>) -> ExitCode {
    result.unwrap_or_else(|error| {
        print::note(format_args!("{program}: {error}"));
        ExitCode::FAILURE
    })
}
