//! The command line.

mod help;

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use gyre_configuration::terminal::inputs::ConfigArguments;
use gyre_results::evaluate::EvaluateArguments;
use gyre_tools::{
    conformance::{ConformanceArguments, shadow::ShadowArguments},
    export::ExportArguments,
    maps::{localise::LocaliseArguments, map::MapArguments},
    masks::MasksArguments,
    new::New,
    operate::{
        EchoArguments, LocateArguments, LogsArguments, PsArguments, ResetArguments,
        RestartArguments, RunChoice, SwapArguments, TopArguments,
    },
    radar_server::RadarServerArguments,
    report::ReportArguments,
    stress::StressArguments,
};

use crate::{
    arguments::{LinkEnd, Ros2Arguments, RunArguments, RunOptions},
    batch::BatchArguments,
    benchmark::BenchmarkArguments,
    calibrate::CalibrateArguments,
    inspect::InspectArguments,
    record::RecordArguments,
    simulate::SimulateArguments,
    watch::WatchArguments,
};

pub use help::command;

/// Radar odometry as cooperating processes over shared memory.
///
/// Turns the scans of a spinning FMCW radar into motion and a trajectory.
#[derive(Debug, Parser)]
#[command(version, about)]
pub struct Gyre {
    #[command(subcommand)]
    pub command: Command,
}

/// The commands of `gyre`.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the whole pipeline on a recording or a live radar, and write a trajectory.
    Run(RunArguments),
    /// Run a simulated drive around a block, which needs no data: `gyre run demo`.
    Demo {
        /// Override a key of the configuration, as in masking.kind=threshold; may be repeated.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        #[command(flatten)]
        options: RunOptions,
    },
    /// Run the pipeline on many drives, and write a table of their results. The same command
    /// continues after an interruption.
    Batch(BatchArguments),
    /// Run the pipeline on drives of a dataset, evaluate them by the rules of its benchmark, and
    /// write the files that the benchmark accepts.
    Benchmark(BenchmarkArguments),
    /// Compute a drive of a batch (what `gyre batch` starts).
    #[command(hide = true, name = gyre_tools::batch::COMMAND)]
    BatchDrive(RunArguments),
    /// Run the whole pipeline in the background. Returns when all its stages are there.
    Up(RunArguments),
    /// End a run in the background, and wait for its results.
    Down(RunChoice),
    /// List the running runs and their processes.
    Ps(PsArguments),
    /// Print the reports of a run's processes.
    Logs(LogsArguments),
    /// Show rates, latencies and processes of a running run in the terminal.
    Top(TopArguments),
    /// Start a process of a running run again.
    Restart(RestartArguments),
    /// Replace the program of a stage of a running run, without losing a scan.
    Swap(SwapArguments),
    /// Begin a new chain of motions at a pose, in a running run.
    Reset(ResetArguments),
    /// Begin a new map of SLAM, in a running run.
    NewMap(RunChoice),
    /// Give a running run the pose of the vehicle in its map (slam.map).
    Locate(LocateArguments),
    /// Run a second program beside a stage of a running run, and compare what both make of the same
    /// inputs. Its results are never used.
    Shadow(ShadowArguments),
    /// Begin a project: a stage of your own, with its test.
    New {
        #[command(subcommand)]
        what: New,
    },
    /// Run one process of a run (what `gyre run` starts).
    Stage {
        /// radar-replay, masking, rotation-search, translation-search, joint-search, refinement or
        /// pose-integration.
        name: String,
        /// File of Python with a function that does the work: see docs/replace-a-stage.md.
        #[arg(long, value_name = "FILE")]
        python: Option<PathBuf>,
    },
    /// Print the messages of a running run. It changes neither a result nor a latency.
    Echo(EchoArguments),
    /// Watch a running run in a browser, and by Prometheus. It changes neither a result nor a
    /// latency.
    Watch(WatchArguments),
    /// Publish a running run to ROS 2, by DDS: odometry, transforms, diagnostics and the map. It
    /// changes neither a result nor a latency.
    Ros2(Ros2Arguments),
    /// Measure whether the pipeline meets its deadline on this computer, undisturbed and under
    /// load.
    Stress(StressArguments),
    /// Load the machine or take part in a measurement (what `gyre stress` starts).
    #[command(hide = true, name = gyre_tools::stress::helper::COMMAND)]
    StressHelper {
        /// The process that has started it, the work, and what that needs.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        words: Vec<String>,
    },
    /// Record a running run as MCAP, for viewers and to replay it. It changes neither a result nor
    /// a latency.
    Record(RecordArguments),
    /// Take the topics of a running run to another machine. To split a run between two machines,
    /// see the section `[link]`.
    Link {
        #[command(subcommand)]
        end: LinkEnd,
    },
    /// Report what this machine lacks for a run.
    Doctor,
    /// End what stages have started when `gyre run` has ended (what `gyre run` starts).
    #[command(hide = true)]
    Guard,
    /// Play a recording or a simulation as a Navtech radar on the network.
    RadarServer(RadarServerArguments),
    /// Report the contents of a dataset, and its apparent faults.
    Inspect(InspectArguments),
    /// Write one page about a run, or about several beside each other.
    Report(ReportArguments),
    /// Evaluate a trajectory against ground truth.
    Evaluate(EvaluateArguments),
    /// Draw the map of a run.
    Map(MapArguments),
    /// Find a drive in a map, scan after scan.
    Localise(LocaliseArguments),
    /// Find the constants of a radar from a drive, without ground truth.
    Calibrate(CalibrateArguments),
    /// Draw the effect of the mask on scans.
    Masks(MasksArguments),
    /// Write odometry, transforms, the map and scans as a bag of ROS 2, or a repaired recording.
    Export(ExportArguments),
    /// Write a simulated recording, or complete one.
    Simulate(SimulateArguments),
    /// Test whether a program keeps the contract of a stage.
    Conformance(ConformanceArguments),
    /// List the configurations in the program, or print one of them to edit it.
    Config(ConfigArguments),
    /// Print the JSON schema of configurations, for editors.
    Schema {
        /// Print a reference in Markdown instead.
        #[arg(long)]
        markdown: bool,
        /// Print the layout of all messages, for programs in other languages.
        #[arg(long)]
        messages: bool,
    },
    /// Print the completions of a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write a manual page for each command.
    Man {
        /// The folder to write them to.
        folder: PathBuf,
    },
}
