//! `gyre stage NAME`: runs one process of a run.

use std::{
    fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre_configuration::{
    process_names, simulated_samples,
    terminal::{own, print},
};
use gyre_contract::{
    FollowerId, StageId,
    run::{SourceConfig, SourceKind, StageConfig, StageCounters},
};
use gyre_datasets::DatasetOptions;
use gyre_simulator::{SimulatedDrive, SimulationConfig};
use gyre_stage::{Launch, launch};
use gyre_stages::{
    live_radar::Settings,
    radar_replay::Pace,
    search::{python, rotation, translation},
};
use gyre_transport::{Manifest, RunError};
use rustix::{
    process::{Pid, getppid},
    thread::set_name,
};

use crate::plan;

type Work = Box<dyn FnOnce(&Launch) -> Result<StageCounters, RunError>>;

/// Runs a stage or a follower by its name, with a function of Python if one is given.
pub fn run(name: &str, python: Option<PathBuf>) -> ExitCode {
    if python.is_some()
        && let Err(reason) = StageConfig::function(name)
    {
        print::note(format_args!("gyre: {name}: {reason}"));
        return ExitCode::FAILURE;
    }
    let stage = StageId::by_name(name).map(|stage| work_of_stage(stage, python));
    let Some(work) = stage.or_else(|| FollowerId::by_name(name).map(work_of_follower)) else {
        let names = process_names().join(", ");
        print::note(format_args!(
            "gyre: there is no stage `{name}`; there are {names}"
        ));
        return ExitCode::FAILURE;
    };
    // Started by its file, it would be called `exe`.
    let _ = set_name(c"gyre");
    launch::main(name, |launch| {
        require_same_build(&launch.manifest)?;
        work(launch)
    })
}

fn work_of_stage(stage: StageId, python: Option<PathBuf>) -> Work {
    if let Some(file) = python {
        return Box::new(move |it| match stage {
            StageId::RotationSearch => rotation::run_with(it, python::rotation(it, &file)?),
            StageId::TranslationSearch => {
                translation::run_with(it, python::translation(it, &file)?)
            }
            _ => gyre_stages::masking::run_with(it, gyre_stages::masking::python(it, &file)?),
        });
    }
    match stage {
        StageId::RadarReplay => Box::new(play),
        StageId::Masking => Box::new(gyre_stages::masking::run),
        StageId::RotationSearch => Box::new(rotation::run),
        StageId::TranslationSearch => Box::new(translation::run),
        StageId::JointSearch => Box::new(gyre_stages::search::joint::run),
        StageId::Refinement => Box::new(gyre_stages::refinement::run),
        StageId::PoseIntegration => Box::new(integrate),
    }
}

fn work_of_follower(follower: FollowerId) -> Work {
    Box::new(match follower {
        FollowerId::LoopClosure => gyre_stages::followers::loop_closure::run,
        FollowerId::Trajectory => gyre_stages::followers::trajectory::run,
        FollowerId::Localisation => gyre_stages::followers::localisation::run,
        FollowerId::Objects => gyre_stages::followers::objects::run,
    })
}

/// A command of the configuration may name a different build.
fn require_same_build(manifest: &Manifest) -> Result<(), RunError> {
    let path = own();
    let supervisor = PathBuf::from(format!(
        "/proc/{}/exe",
        getppid().map_or(0, Pid::as_raw_pid)
    ));
    let file = |path: &Path| fs::metadata(path).map(|file| (file.dev(), file.ino())).ok();
    // A shell can stand between the two processes; then the file contents decide.
    if file(&path).is_some_and(|own| file(&supervisor) == Some(own)) {
        return Ok(());
    }
    let build = plan::digest(&path).map_err(|source| RunError::File { path, source })?;
    match build == manifest.build {
        true => Ok(()),
        false => Err(RunError::Input(
            "this is another build of gyre than the one that runs: name that one in the stage's command".to_owned(),
        )),
    }
}

/// Integrates motions to poses, or leaves that to the other side of a link.
fn integrate(launch: &Launch) -> Result<StageCounters, RunError> {
    #[cfg(feature = "link")]
    if is_side(launch, gyre_contract::run::Side::Robot)? {
        return gyre_link::run_robot(launch);
    }
    gyre_stages::pose_integration::run(launch)
}

/// A build without the feature refuses to begin a split run.
#[cfg(feature = "link")]
fn is_side(launch: &Launch, side: gyre_contract::run::Side) -> Result<bool, RunError> {
    let link: gyre_contract::run::LinkConfig = launch.section("link")?;
    Ok(link.side == Some(side))
}

fn play(launch: &Launch) -> Result<StageCounters, RunError> {
    let input = |error: &dyn std::error::Error| RunError::Input(error.to_string());
    #[cfg(feature = "link")]
    if is_side(launch, gyre_contract::run::Side::Base)? {
        return gyre_link::run_base(launch);
    }
    let source: SourceConfig = launch.section("source")?;
    match source.kind {
        SourceKind::Colossus => {
            let settings = Settings::of(&source, &launch.section("dataset")?);
            return gyre_stages::live_radar::run(launch, settings.map_err(|error| input(&error))?);
        }
        #[cfg(feature = "ros2")]
        SourceKind::Ros2 => {
            use gyre_ros2_bridge::source::{self, Settings};
            let settings = Settings::of(&source, &launch.section("dataset")?);
            return source::run(launch, settings.map_err(RunError::Input)?);
        }
        // A build without ROS 2 refuses to begin a run from there.
        _ => {}
    }
    if !launch.has_section("simulation") {
        return gyre_stages::radar_replay::run(launch);
    }
    let simulation: SimulationConfig = launch.section("simulation")?;
    let options: DatasetOptions = launch.section("dataset")?;
    let drive = SimulatedDrive::new(&simulation).map_err(|error| input(&error))?;
    let mut dataset = drive.open(&options).map_err(|error| input(&error))?;
    let sensors = launch.sensors()?;
    let samples = simulated_samples(&drive, &sensors.sampled(), dataset.as_mut());
    let samples = samples.map_err(|error| input(&*error))?;
    gyre_stages::radar_replay::play(launch, dataset, samples, Pace::OnDemand)
}
