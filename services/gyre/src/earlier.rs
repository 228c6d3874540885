//! The state of an earlier run in the folder of the results: nothing, a journal to resume, or one
//! whose results are to be written.

mod closed;
mod replaced;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_contract::{
    Commands, StageId,
    run::{BEGUN_WITH, COMPLETE, Mode, Side},
};
use gyre_geometry::samples::SensorConfigs;
use gyre_journal::{
    self as journal, Content,
    checkpoint::{self, Checkpoint},
    keyframes::complete_poses,
    objects::LoggedObjects,
    scans::{LoggedScan, complete_scans},
};
use gyre_matching::Refiner;
use gyre_recording::received_fixes;
use gyre_results::{FILES, Identity, Out, Programs, SIMULATED_TRUTH, SUMMARY};
use gyre_slam::{Keyframe, Place, Query, RecordReader, records_path};
use gyre_storage::{self as storage, GroupSync, LogError};
use gyre_transport::Generation;
use gyre_watch::recorder::Ledger;

pub use closed::{close, is_closed};
pub use replaced::{is_untouched, settle};

const CONFIGURATION: &str = "config.toml";
const LOGS: [&str; 2] = ["log.jsonl", "log.jsonl.old"];

#[derive(Debug)]
pub enum Earlier {
    Nothing,
    /// The same run, begun and ended without a pose to continue from. Only its recording continues.
    WithoutPoses(Identity),
    /// A journal without its end, or with keyframes or scans that the followers have not all read.
    Unfinished(Begun),
    /// A journal with its end, whose results have not been written.
    Ended(Begun),
    /// The results of a complete run, which the same run may replace.
    Complete(Identity),
    /// A run that this one cannot continue, and why.
    Foreign(Failure),
}

#[derive(Debug)]
pub struct Begun {
    pub poses: u64,
    /// Records behind them, which a power failure has left in part: they are to be cut off.
    pub lost: u64,
    pub identity: Identity,
}

impl Earlier {
    /// Looks at the folder, and finishes a replacement that a kill has interrupted. A `fresh` run
    /// starts from nothing.
    pub fn of(
        out: &Out,
        configuration: &Configuration,
        programs: &Programs,
        fresh: bool,
    ) -> Result<Self, Failure> {
        match journal::poses(out.path()).map(drop) {
            Err(error @ LogError::OtherVersion { .. }) if !fresh => {
                let reason = format!("{error}, or begin anew with --fresh");
                return Ok(Self::Foreign(reason.into()));
            }
            // Where another run may begin, so may this one; damage is reported below.
            Err(LogError::OtherVersion { .. } | LogError::Damaged { .. }) => {}
            // A file of another program is refused in any case.
            opened => opened?,
        }
        settle(out)?;
        if fresh {
            return Ok(Self::Nothing);
        }
        if is_complete(out.path()) {
            let complete = complete(out, configuration, programs);
            return Ok(complete.unwrap_or_else(Self::Foreign));
        }
        let content = journal::check(out.path()).map_err(|error| kept(error, out))?;
        if content.poses == 0 && !content.ended {
            return Ok(match require_no_results(out) {
                Ok(()) => without_poses(out, configuration, programs),
                Err(reason) => Self::Foreign(reason),
            });
        }
        match same_run(out, configuration, programs, UNFINISHED) {
            Err(reason) => Ok(Self::Foreign(reason)),
            Ok(identity) => Self::begun(out, configuration, &content, identity),
        }
    }

    fn begun(
        out: &Out,
        configuration: &Configuration,
        content: &Content,
        identity: Identity,
    ) -> Result<Self, Failure> {
        let poses = match content.ended {
            true => content.poses,
            false => known_poses(out, configuration, content)?,
        };
        let begun = Begun {
            poses,
            lost: content.poses - poses + content.torn,
            identity,
        };
        let is_followed = (!configuration.slam.is_on() || has_ended::<Query>(out)?)
            && (!configuration.objects.is_on() || has_ended::<LoggedObjects>(out)?);
        Ok(match (content.ended, poses) {
            (true, _) if is_followed => Self::Ended(begun),
            (false, 0) => Self::WithoutPoses(begun.identity),
            _ => Self::Unfinished(begun),
        })
    }

    pub fn unfinished(&self) -> Option<&Begun> {
        match self {
            Self::Unfinished(begun) => Some(begun),
            _ => None,
        }
    }

    /// Returns whether a run of this identity continues the recording that was begun before.
    pub fn recording_goes_on(&self, identity: &Identity) -> bool {
        match self {
            Self::Unfinished(_) => true,
            Self::WithoutPoses(begun_with) => begun_with.require_recording(identity).is_ok(),
            Self::Nothing | Self::Ended(_) | Self::Complete(_) | Self::Foreign(_) => false,
        }
    }

    /// The identity of the run in the folder, which the new one must have too.
    pub fn identity(&self) -> Option<&Identity> {
        match self {
            Self::Nothing | Self::WithoutPoses(_) | Self::Foreign(_) => None,
            Self::Complete(identity) => Some(identity),
            Self::Unfinished(begun) | Self::Ended(begun) => Some(&begun.identity),
        }
    }

    /// Checks that a new run with this identity plays the same recording.
    pub fn require_recording(&self, now: &Identity, out: &Out) -> Result<(), Failure> {
        let state = match self {
            Self::Complete(_) => COMPLETED,
            _ => UNFINISHED,
        };
        let required = self.identity().map(|it| it.require_recording(now));
        required
            .unwrap_or(Ok(()))
            .map_err(|another| foreign(out, state, &another))
    }
}

/// States of a run that a different run does not replace.
const UNFINISHED: &str = "an unfinished";
const COMPLETED: &str = "a complete";

fn foreign(out: &Out, state: &str, another: &Failure) -> Failure {
    let out = out.path().display();
    format!(
        "{out} holds {state} run of {another}: choose another --out, or discard it with --fresh"
    )
    .into()
}

/// Returns the identity of the run in the folder; an error if the new run is another.
fn same_run(
    out: &Out,
    configuration: &Configuration,
    programs: &Programs,
    state: &str,
) -> Result<Identity, Failure> {
    let identity = Identity::read(out)?;
    let required = identity.require(configuration, programs);
    required.map_err(|another| foreign(out, state, &another))?;
    Ok(identity)
}

/// Anything begun there may begin again, and the same run may continue its recording.
fn without_poses(out: &Out, configuration: &Configuration, programs: &Programs) -> Earlier {
    let same = same_run(out, configuration, programs, UNFINISHED);
    same.map_or(Earlier::Nothing, Earlier::WithoutPoses)
}

/// A complete run may be replaced by the same results without being asked for it.
fn complete(
    out: &Out,
    configuration: &Configuration,
    programs: &Programs,
) -> Result<Earlier, Failure> {
    let identity = same_run(out, configuration, programs, COMPLETED)?;
    // Drops in live mode depend on the load, and the base has the scans of its robot.
    let is_live = configuration.is_radar() || configuration.run.mode == Mode::Live;
    if is_live || configuration.is_side(Side::Base) {
        return Err(format!(
            "{} holds the results of a complete live run, which cannot be computed again: choose another --out, or replace them with --fresh",
            out.path().display()
        )
        .into());
    }
    Ok(Earlier::Complete(identity))
}

/// Checks that there are no results without the journal that identifies them.
fn require_no_results(out: &Out) -> Result<(), Failure> {
    let summary = out.join(SUMMARY);
    match summary.exists() && !out.join(BEGUN_WITH).exists() {
        false => Ok(()),
        true => Err(format!(
            "{} is of a run whose journal is missing, so it is not known of which: choose another --out, or replace the results with --fresh",
            summary.display()
        )
        .into()),
    }
}

pub fn is_complete(out: &Path) -> bool {
    out.join(COMPLETE).exists()
}

/// A damaged log may be removed, and is then computed again.
fn has_ended<R: gyre_slam::Record>(out: &Out) -> Result<bool, Failure> {
    match RecordReader::<R>::open(out.path()) {
        Ok(records) => Ok(records.has_ended()),
        Err(error @ LogError::Damaged { .. }) => {
            Err(format!("{error}: remove it, and the same command computes it again").into())
        }
        Err(error) => Err(error.into()),
    }
}

/// Keeps a second name of a damaged journal, which `--fresh` does not remove.
fn kept(error: LogError, out: &Out) -> Failure {
    if !matches!(error, LogError::Damaged { .. }) {
        return error.into();
    }
    let path = &journal::path(out.path());
    let copy = path.with_extension("journal.damaged");
    // A link, because a long journal may not fit a second time.
    let kept = match fs::hard_link(path, &copy) {
        Err(failed) if failed.kind() != io::ErrorKind::AlreadyExists => {
            format!("it could not be kept under a second name ({failed})")
        }
        _ => format!("it is kept as {}", copy.display()),
    };
    format!(
        "{error}, and what follows would be lost: {kept}; restore it from a backup, choose another --out, or begin anew with --fresh"
    )
    .into()
}

/// Returns the number of poses of an unfinished journal up to the newest pose where the run can
/// continue: all poses up to it have their keyframes, and the map of the refinement knows it. After
/// a power failure that may be an earlier one than the last; after a death it is the last.
fn known_poses(
    out: &Out,
    configuration: &Configuration,
    content: &Content,
) -> Result<u64, Failure> {
    let slam = &configuration.slam;
    let complete = match slam.is_on() {
        true => complete_poses(out.path(), content.poses).map_err(damaged)?,
        false => content.poses,
    };
    let complete = match configuration.objects.is_on() {
        true => complete_scans(out.path(), complete).map_err(damaged)?,
        false => complete,
    };
    if !configuration.starts(StageId::Refinement) {
        return Ok(complete);
    }
    let path = checkpoint::path(out.path());
    let known = match path.exists() {
        true => {
            let (points, refinement) = (
                &configuration.odometry.points,
                &configuration.odometry.refinement,
            );
            let cells = Refiner::new(refinement, &SensorConfigs::default(), points.capacity)?
                .keyframe_cells();
            let window = configuration.run.window;
            let mut map = Checkpoint::open(&path, window, refinement.keyframes, cells)?;
            let poses = content.last.iter().rev();
            let known = map.newest_known(poses.filter(|pose| pose.item.seq < complete))?;
            known.map(|pose| pose.item.seq + 1)
        }
        false => None,
    };
    match known {
        Some(poses) => Ok(poses),
        // A new chain of motions begins, without the old map.
        None if configuration.is_radar() && complete > 0 => {
            print::note(format_args!(
                "gyre: {} has no state of pose {}, as after a full disk: the filters of other sensors start again",
                path.display(),
                complete - 1
            ));
            Ok(complete)
        }
        // Not more than a power failure can take, soon after the start.
        None if configuration.is_radar() || content.poses <= 2 * GroupSync::LIMIT => {
            print::note(format_args!(
                "gyre: {} knows none of the {} poses of the journal: starting again",
                path.display(),
                content.poses
            ));
            Ok(0)
        }
        None => Err(checkpoint::no_state(&path, content.poses).into()),
    }
}

fn damaged(error: LogError) -> Failure {
    match error {
        LogError::Damaged { .. } => format!(
            "{error}: restore it from a backup, choose another --out, or begin anew with --fresh"
        )
        .into(),
        _ => error.into(),
    }
}

fn state(out: &Path) -> [PathBuf; 13] {
    let [ledger, generations] = state_of_recording(out);
    [
        journal::path(out),
        Commands::path_in(out),
        checkpoint::path(out),
        records_path::<Keyframe>(out),
        records_path::<Place>(out),
        records_path::<Query>(out),
        records_path::<LoggedScan>(out),
        records_path::<LoggedObjects>(out),
        received_fixes(out),
        ledger,
        generations,
        out.join(BEGUN_WITH),
        out.join(COMPLETE),
    ]
}

/// The files that a recording needs to continue: its ledger, and the generations of its numbers.
fn state_of_recording(out: &Path) -> [PathBuf; 2] {
    [Ledger::of(out).path().to_owned(), Generation::path(out)]
}

/// Removes the state of an unfinished run, puts aside the state of a complete run, and returns the
/// state where the new run begins. The journal goes first: without it no other file counts as part
/// of a run. The results of an unfinished run go before the new configuration is there. The results
/// of a complete run stay until the new run has its own results, together with the files that its
/// recording needs if the recording continues.
pub fn begin(
    out: &Out,
    identity: &Identity,
    resolved: &str,
    recording_goes_on: bool,
) -> Result<(), Failure> {
    replaced::put_aside(out)?;
    let folder = out.join("journal");
    storage::create_folder(&folder)?;
    storage::remove(&journal::path(out.path()))?;
    storage::sync_folder(&folder)?;
    // Results without a journal are refused, so the files of the run's begin are replaced as a
    // whole below.
    let mut kept = vec![out.join(BEGUN_WITH)];
    if recording_goes_on {
        kept.extend(state_of_recording(out.path()));
    }
    // The truth of a simulation is no result: it is there when the run begins.
    let has_complete = replaced::is_kept(out);
    let results = FILES
        .into_iter()
        .filter(|it| !has_complete || *it == SIMULATED_TRUTH);
    let others = LOGS.into_iter().chain(results);
    state(out.path())
        .into_iter()
        .filter(|path| !kept.contains(path))
        .chain(others.map(|name| out.join(name)))
        .try_for_each(|path: PathBuf| storage::remove(&path))?;
    identity.write(out)?;
    Ok(storage::write(&out.join(CONFIGURATION), resolved)?)
}

/// A run without a motion does not replace a complete one.
pub fn replaces(out: &Out, poses: usize) -> bool {
    poses >= replaced::WITH_MOTION || !replaced::is_kept(out)
}

/// Returns the same before results take that place, where the complete run gives way to them: from
/// then on it is not given back.
pub fn make_way(out: &Out, poses: usize) -> Result<bool, Failure> {
    let replaces = replaces(out, poses);
    if replaces {
        replaced::invalidate(out)?;
    }
    Ok(replaces)
}

/// Ends a run whose results are in place, and survive a power failure by now.
pub fn end(out: &Out, poses: usize, is_complete: bool) -> Result<(), Failure> {
    if !replaces(out, poses) {
        return Ok(replaced::give_back(out)?);
    }
    if is_complete {
        storage::write(&out.join(COMPLETE), format!("poses = {poses}\n"))?;
    }
    Ok(replaced::remove(out)?)
}

/// Prepares the folder for a resumed run: cuts off the remains of the last poses and commands after
/// a power failure, and writes `config.toml` again if it differs from the run's first
/// configuration.
pub fn resume(out: &Out, begun: &Begun) -> Result<(), Failure> {
    if begun.lost > 0 {
        journal::cut(out.path(), begun.poses)?;
    }
    Commands::cut_torn(out.path())?;
    let (path, identity) = (out.join(CONFIGURATION), &begun.identity);
    let found = storage::read_text(&path, storage::SETTINGS).ok();
    let found: Option<toml::Table> = found.and_then(|text| text.parse().ok());
    match found.as_ref() == Some(&identity.configuration) {
        true => Ok(()),
        false => Ok(storage::write(
            &path,
            toml::to_string_pretty(&identity.configuration)?,
        )?),
    }
}
