//! `gyre run`: prepares a run, supervises it, writes its results.

use std::{
    env,
    process::ExitCode,
    time::{Duration, Instant},
};

use gyre_configuration::{
    Configuration, describe_masks, describe_objects,
    terminal::{Failure, INTERRUPTED, execute_again, own, print},
    with_stored_options,
};
use gyre_contract::{
    Commands, StageId,
    run::{Ending, Report, Side},
};
use gyre_datasets::SampleLog;
use gyre_geometry::samples::SensorKind;
use gyre_recording::{copied_fixes, received_fixes};
use gyre_results::{Form, Identity, Out, Programs, Results, SIMULATED_TRUTH, Session};
use gyre_stage::sink::has_lost_poses;
use gyre_storage as storage;
use gyre_supervise::{Plan, SuperviseError, supervise};
use gyre_tools::{doctor::check_shared_memory, operate::detach_if_asked};
use gyre_transport::{
    Manifest, RunError,
    run::{RunRoot, sweep},
    sessions::{BEGUN, log_session},
    wake::{Signals, let_signals_end_the_process},
};

use crate::{
    arguments::{RunArguments, resolve, results_folder},
    earlier::{self, Begun, Earlier},
    notify::Notifier,
    plan,
    preflight::{self, Preflight},
    progress::Progress,
    waiting,
};

/// Runs the pipeline and writes its results, however it ended. An interrupted earlier run is
/// resumed; if it only lacks results, the results are written.
pub fn run(arguments: &RunArguments) -> Result<ExitCode, Failure> {
    detach_if_asked();
    if !arguments.options.ends_with_parent()? {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    let configuration = resolve(arguments)?;
    #[cfg(feature = "link")]
    if configuration.link.side.is_some() {
        crate::link::set_environment()?;
    }
    let out = Out::lock(&results_folder(arguments)?)?;
    compute(
        configuration,
        out,
        arguments.options.fresh,
        arguments.options.form(),
    )
}

/// A `fresh` run starts from nothing.
pub(crate) fn compute(
    configuration: Configuration,
    out: Out,
    fresh: bool,
    form: Form,
) -> Result<ExitCode, Failure> {
    // An earlier run may have been killed, and this one may be refused before it takes shared
    // memory itself.
    sweep();
    let programs = plan::programs(&configuration)?;
    match Earlier::of(&out, &configuration, &programs, fresh)? {
        Earlier::Foreign(reason) if !earlier::is_closed(&configuration) => Err(reason),
        Earlier::Ended(begun) => write_missing_results(&configuration, &out, &begun, form),
        earlier => match play(&configuration, &programs, out, &earlier, form) {
            Err(error) if matches!(error.downcast_ref(), Some(RunError::Stopped)) => {
                Ok(ExitCode::from(INTERRUPTED))
            }
            ended => ended,
        },
    }
}

/// The inputs of a run that its configuration does not have.
struct Ready {
    /// The configuration with the options of `dataset.toml`.
    resolved: Configuration,
    checked: Preflight,
    identity: Identity,
    /// The commands that the run is given at its begin.
    commands: Option<Commands>,
    /// True if the run continues its own earlier recording.
    recording_goes_on: bool,
}

/// Checks all that can be checked before anything of an earlier run is changed.
fn make_ready(
    configuration: &Configuration,
    programs: &Programs,
    out: &Out,
    earlier: &Earlier,
    ask: &mut preflight::Ask<'_>,
) -> Result<Ready, Failure> {
    let unfinished = earlier.unfinished();
    preflight::check_open_files()?;
    // The stages read the options of dataset.toml from here: it may change while they run.
    let resolved = with_stored_options(configuration)?;
    let checked = preflight::check(&resolved, ask)?;
    let identity = Identity::of(
        configuration,
        programs,
        resolved.dataset,
        checked.scans.count,
        checked.scans.recording.as_ref().map(|it| &it.fingerprint),
    )?;
    earlier.require_recording(&identity, out)?;
    let commands = commands(configuration)?;
    let recording_goes_on = earlier.recording_goes_on(&identity);
    plan::require_recordable(&configuration.record, out.path(), recording_goes_on)?;
    if let Some(begun) = unfinished.filter(|begun| begun.lost > 0) {
        print::note(format_args!(
            "gyre: the last {} poses of {} had not reached the disk: going on after {}",
            begun.lost,
            out.path().display(),
            begun.poses
        ));
    }
    Ok(Ready {
        resolved,
        checked,
        identity,
        commands,
        recording_goes_on: recording_goes_on && configuration.record.is_on(),
    })
}

/// Starts all processes, resumes an unfinished run or begins a new one, and writes the results.
fn play(
    configuration: &Configuration,
    programs: &Programs,
    mut out: Out,
    earlier: &Earlier,
    form: Form,
) -> Result<ExitCode, Failure> {
    let (mut notifier, mut signals) = (Notifier::of_environment(), None);
    let mut ask = |it: &Configuration| waiting::for_radar(it, &out, (&mut notifier, &mut signals));
    let ready = make_ready(configuration, programs, &out, earlier, &mut ask)?;
    let (resolved, checked) = (&ready.resolved, &ready.checked);
    let unfinished = earlier.unfinished();
    let signals = signals.map_or_else(Signals::install, Ok)?;
    // The supervisor consumes the others.
    let stop = Signals::install()?;
    if let Earlier::Foreign(reason) = earlier {
        out = earlier::close(out, reason)?;
    }
    let root = RunRoot::acquire(out.path(), &signals)?;
    check_shared_memory(&checked.footprint)?;
    prepare(configuration, &ready, &out, unfinished)?;
    let plan = plan_in(&root, &ready, programs, &out)?;

    describe_masks(resolved)?.iter().for_each(print::note);
    describe_objects(resolved)?.iter().for_each(print::note);
    resolved.link.describe().iter().for_each(print::note);
    let resumed = unfinished.map_or(0, |begun| begun.poses as usize);
    let started = Instant::now();
    let report = supervise_shown(&plan, signals, &ready, resumed, &mut notifier);
    if let Err(failure) = &report
        && (matches!(failure, SuperviseError::TransportStuck) || has_lost_poses(&plan.manifest))
        && !has_started_over_at(resumed)
        && !stop.sleep(Duration::ZERO)?
    {
        print::note(format_args!("gyre: {failure}; starting over"));
        let begins_anew = earlier::is_untouched(&out)?;
        drop((root, out));
        return start_over(resumed, begins_anew);
    }
    let session = Session {
        scans: checked.scans.count,
        resumed,
        damage: checked.scans.damage.as_deref(),
        needs_all: checked.scans.needs_all,
        wall: started.elapsed(),
        footprint: Some(&checked.footprint),
        ending: report.as_ref().ok().map(|report| report.ending),
        report: report.as_ref().ok(),
    };
    // The run keeps its locks until its results are written, so that no other run writes them
    // meanwhile.
    let written = finish(configuration, &out, &session);
    match report {
        Ok(_) => conclude(&session, &written?, form),
        Err(failure) => Err(failed(&failure, &out, written)),
    }
}

/// Reads the commands that another run has had.
fn commands(configuration: &Configuration) -> Result<Option<Commands>, Failure> {
    let Some(path) = &configuration.source.commands else {
        return Ok(None);
    };
    let shown = path.display();
    storage::open(path).map_err(|error| format!("{shown} (source.commands): {error}"))?;
    let commands = Commands::read(path)?;
    let (waiting, all) = (commands.waiting(), commands.len());
    if waiting > 0 {
        print::note(format_args!(
            "gyre: {waiting} of {all} commands of {shown} (source.commands) are left out, since no scan has taken them (from_ns is missing)"
        ));
    }
    Ok(Some(commands))
}

fn prepare(
    configuration: &Configuration,
    ready: &Ready,
    out: &Out,
    unfinished: Option<&Begun>,
) -> Result<(), Failure> {
    match unfinished {
        Some(begun) => earlier::resume(out, begun)?,
        None => {
            let resolved = configuration.to_toml()?;
            earlier::begin(out, &ready.identity, &resolved, ready.recording_goes_on)?;
            if let Some(commands) = &ready.commands {
                commands.give(out.path())?;
            }
        }
    }
    if let Some(truth) = &ready.checked.scans.truth {
        storage::write(&out.join(SIMULATED_TRUTH), truth)?;
    }
    Ok(storage::create_folder(&out.join("log"))?)
}

/// Writes the inputs of the processes to the root of the run, and returns the plan of their start.
fn plan_in(root: &RunRoot, ready: &Ready, programs: &Programs, out: &Out) -> Result<Plan, Failure> {
    let (resolved, checked, gyre) = (&ready.resolved, &ready.checked, own());
    let manifest = Manifest {
        prefix: root.prefix(),
        root: root.path().to_owned(),
        ..checked.manifest(resolved, out.path(), programs.build.clone())
    };
    manifest.write(&resolved.to_toml()?)?;
    if let Some(recording) = &checked.scans.recording {
        let path = root.path().display();
        let failed = |error| format!("cannot write to {path}: {error}");
        recording.listing.write(root.path()).map_err(failed)?;
    }
    Ok(Plan {
        stages: plan::stage_plans(resolved, &gyre),
        recorder: plan::recorder(&resolved.record, &gyre, &manifest.out),
        guardian: vec![gyre.to_string_lossy().into_owned(), "guard".to_owned()],
        stall_timeout: limit(resolved.run.stall_timeout_s),
        start_timeout: limit(resolved.run.start_timeout_s),
        cpu_wake_us: resolved.run.cpu_wake_us,
        takes_commands: resolved.starts(StageId::Masking) && !resolved.is_side(Side::Robot),
        manifest,
    })
}

/// Supervises the processes to their end, and shows and logs how the run goes.
fn supervise_shown(
    plan: &Plan,
    signals: Signals,
    Ready {
        resolved, checked, ..
    }: &Ready,
    resumed: usize,
    notifier: &mut Notifier,
) -> Result<Report, SuperviseError> {
    let mut progress = Progress::new(checked.scans.count, resumed, &checked.footprint);
    if resolved.is_radar() {
        progress.watch_radar(resolved.data(), plan.manifest.clone());
    }
    log_session(&plan.manifest, BEGUN);
    let report = supervise(plan, signals, &mut |event| {
        let of_radar = progress.show(&event);
        notifier.report(&event);
        of_radar.iter().for_each(|it| notifier.status(it));
    });
    let end = match &report {
        Ok(report) if report.ending == Ending::Complete => "the run is complete".to_owned(),
        Ok(_) => "the run was interrupted".to_owned(),
        Err(error) => format!("the run failed: {error}"),
    };
    log_session(&plan.manifest, &end);
    progress.finish();
    notifier.writing();
    report
}

/// `None`: no limit.
fn limit(seconds: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(seconds)
        .ok()
        .filter(|limit| !limit.is_zero())
}

/// Writes the results of a run whose journal has its end; no process is started.
fn write_missing_results(
    configuration: &Configuration,
    out: &Out,
    begun: &Begun,
    form: Form,
) -> Result<ExitCode, Failure> {
    print::note(format_args!(
        "gyre: all {} poses of {} are computed, but not all results were written: writing them now",
        begun.poses,
        out.path().display()
    ));
    let played = gyre_configuration::open(configuration).ok();
    let session = Session {
        scans: begun.identity.scans,
        resumed: begun.poses as usize,
        damage: played.as_ref().and_then(|it| it.dataset.damage()),
        needs_all: played
            .as_ref()
            .is_some_and(|it| preflight::needs_all(it.dataset.as_ref())),
        wall: Duration::ZERO,
        footprint: None,
        ending: Some(Ending::Complete),
        report: None,
    };
    let written = finish(configuration, out, &session)?;
    conclude(&session, &written, form)
}

/// Writes the results. Only when all of them are in place, the run counts as complete, and the next
/// run starts from the first scan.
fn finish(
    configuration: &Configuration,
    out: &Out,
    session: &Session<'_>,
) -> Result<Results, Failure> {
    // All poses are kept by now, and the same command writes the results again.
    let_signals_end_the_process()?;
    let make_way = |poses| earlier::make_way(out, poses);
    keep_fixes(configuration, out);
    let mut written = gyre_results::write(configuration, out, session, &make_way)?;
    let has_replaced = earlier::replaces(out, written.poses);
    // With all poses there may be loops to find, and a run that failed may not have kept them.
    let has_followed = match session.ending {
        Some(Ending::Complete) => true,
        Some(_) => !configuration.window(None, 1).logs_points(),
        None => false,
    };
    earlier::end(out, written.poses, written.ended && has_followed)?;
    if !has_replaced {
        written.poses = 0;
    }
    Ok(written)
}

/// Puts the fixes that the run has used beside its recording, for its replays.
fn keep_fixes(configuration: &Configuration, out: &Out) {
    let (record, gnss) = (&configuration.record, &configuration.gnss);
    let received = received_fixes(out.path());
    let rows: Result<_, Failure> = match gnss.kind {
        _ if !record.is_on() => return,
        SensorKind::Auto => copied_fixes(gnss, &configuration.source.data).map_err(Failure::from),
        SensorKind::Udp | SensorKind::Ros2 if received.exists() => {
            storage::read_text(&received, u64::from(u32::MAX)).map_err(Failure::from)
        }
        _ => return,
    };
    let to = SampleLog::of_recording(&record.file);
    let kept = rows.and_then(|rows| Ok(storage::write(&to, rows)?));
    if let Err(error) = kept {
        print::note(format_args!(
            "the fixes of GNSS are not in {}: {error}",
            to.display()
        ));
    }
}

fn failed(failure: &SuperviseError, out: &Out, written: Result<Results, Failure>) -> Failure {
    let out = out.path().display();
    match written {
        Ok(Results { poses: 0, .. }) => failure.to_string(),
        Ok(Results { poses, .. }) => {
            format!(
                "{failure}; {poses} poses are kept in {out}, the same command resumes from there"
            )
        }
        Err(unwritten) => format!("{failure}; the poses so far are kept in {out}, but {unwritten}"),
    }
    .into()
}

fn conclude(session: &Session<'_>, written: &Results, form: Form) -> Result<ExitCode, Failure> {
    let problem = written.summary.problem();
    let is_printed = problem.is_none() || written.poses >= 2;
    if is_printed {
        print::line(written.summary.text(form)?)?;
    }
    if let Some(problem) = problem {
        // The brief summary contains the problem.
        if !(is_printed && form == Form::Brief) {
            print::note(format_args!("gyre: {problem}"));
        }
        if session.ending != Some(Ending::Interrupted) {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(match session.ending == Some(Ending::Complete) {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(INTERRUPTED),
    })
}

/// The environment variable of a run that has started over: the poses that it resumed after before.
const STARTED_OVER: &str = "GYRE_STARTED_OVER";

/// Once more would not help.
fn has_started_over_at(poses: usize) -> bool {
    env::var(STARTED_OVER).is_ok_and(|before| before == poses.to_string())
}

/// Executes the same command again: the transport hung on the remains of a dead process, which are
/// removed now, or poses are lost because the disk was full. The run resumes from the journal; if
/// it was replacing a complete run and has computed nothing, it begins again as requested.
fn start_over(resumed: usize, begins_anew: bool) -> Result<ExitCode, Failure> {
    // Computed poses are not discarded.
    let arguments = env::args_os().filter(|argument| begins_anew || argument != "--fresh");
    let failed = execute_again(arguments, STARTED_OVER, &resumed.to_string());
    Err(format!("cannot start over: {failed}").into())
}
