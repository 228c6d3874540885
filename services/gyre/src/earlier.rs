//! The state of an earlier run in the folder of the results: nothing, a journal to resume, or one
//! whose results are to be written.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use gyre_configuration::Configuration;
use gyre_journal::{
    self as journal, Content, JournalError,
    checkpoint::{self, Checkpoint, CheckpointError},
    keyframes::{KeyframesError, complete_poses},
};
use gyre_messages::StageId;
use gyre_results::{Identity, Out, Programs};
use gyre_run::COMPLETE;
use gyre_scan_matching::Refiner;
use gyre_slam::{Keyframe, Place, Query, RecordReader, records_path};
use gyre_storage::{self as storage, GroupSync, LogError};
use gyre_terminal::{Failure, print};

const CONFIGURATION: &str = "config.toml";
const LOGS: [&str; 2] = ["log.jsonl", "log.jsonl.old"];

/// The state of an earlier run.
#[derive(Debug)]
pub enum Earlier {
    /// Nothing to go on from.
    Nothing,
    /// A journal without its end, or of which the followers have not read all keyframes.
    Unfinished(Begun),
    /// A journal with its end, of which results have not been written.
    Ended(Begun),
}

/// A run that was begun.
#[derive(Debug)]
pub struct Begun {
    /// Poses in its journal to go on from.
    pub poses: u64,
    /// Records behind them, which a power failure has left in part: they are to be cut off.
    pub lost: u64,
    /// The identity that it was begun with.
    pub identity: Identity,
}

impl Earlier {
    /// Looks at the folder and changes nothing. A `fresh` run goes on from nothing.
    ///
    /// # Errors
    /// Files that cannot be read, a damaged journal, or a run of another configuration.
    pub fn of(
        out: &Out,
        configuration: &Configuration,
        programs: &Programs,
        fresh: bool,
    ) -> Result<Self, Failure> {
        let path = journal::path(out.path());
        // A file of another program is refused in any case.
        let there = journal::records(&path)?.is_some();
        if fresh || !there || out.join(COMPLETE).exists() {
            return Ok(Self::Nothing);
        }
        let content = journal::check(&path).map_err(|error| kept(error, &path))?;
        let is_empty = content.poses == 0 && !content.ended;
        let identity = match is_empty {
            true => return Ok(Self::Nothing),
            false => Identity::read(out, content.poses)?,
        };
        identity.require(configuration, programs, out.path(), content.poses)?;
        let poses = match content.ended {
            true => content.poses,
            false => known_poses(out, configuration, &content)?,
        };
        let begun = Begun {
            poses,
            lost: content.poses - poses + content.torn,
            identity,
        };
        let is_followed = !configuration.slam.is_on() || queries(out)?.has_ended();
        Ok(match (content.ended, poses) {
            (true, _) if is_followed => Self::Ended(begun),
            (true, _) => Self::Unfinished(begun),
            (false, 0) => Self::Nothing,
            (false, _) => Self::Unfinished(begun),
        })
    }
}

/// Returns whether the run that wrote its results to `out` has reached its end.
pub fn is_complete(out: &Path) -> bool {
    out.join(COMPLETE).exists()
}

/// Opens the candidates of the keyframes so far.
fn queries(out: &Out) -> Result<RecordReader<Query>, Failure> {
    RecordReader::open(out.path()).map_err(|error| match error {
        LogError::Damaged { .. } => {
            format!("{error}: remove it, and the same command finds the loops anew").into()
        }
        _ => error.into(),
    })
}

/// Keeps a second name of a damaged journal, which `--fresh` does not remove.
fn kept(error: JournalError, path: &Path) -> Failure {
    if !matches!(error, JournalError::Damaged { .. }) {
        return error.into();
    }
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

/// Returns the number of poses of an unfinished journal up to the newest one from which the run can
/// go on: all poses up to it have their keyframes, and the map of the refinement knows it. After a
/// power failure that may be an earlier one than the last; after a death it is the last.
fn known_poses(
    out: &Out,
    configuration: &Configuration,
    content: &Content,
) -> Result<u64, Failure> {
    let slam = &configuration.slam;
    let complete = match slam.is_on() {
        true => complete_poses(out.path(), &slam.places, content.poses).map_err(damaged)?,
        false => content.poses,
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
            let cells = Refiner::new(refinement, points.capacity)?.keyframe_cells();
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
        // Not more than a power failure can take, soon after the start.
        None if content.poses <= 2 * GroupSync::LIMIT => {
            print::note(format_args!(
                "gyre: {} knows none of the {} poses of the journal: beginning anew",
                path.display(),
                content.poses
            ));
            Ok(0)
        }
        None => Err(CheckpointError::Missing {
            path,
            item: content.poses,
        }
        .into()),
    }
}

/// Says what to do about damaged keyframes.
fn damaged(error: KeyframesError) -> Failure {
    match error {
        KeyframesError::Log(LogError::Damaged { .. }) => format!(
            "{error}: restore it from a backup, choose another --out, or begin anew with --fresh"
        )
        .into(),
        _ => error.into(),
    }
}

/// Removes the results and the state of an earlier run, and says what the new one begins with. The
/// journal goes first: without it nothing else is taken for part of a run.
///
/// # Errors
/// A file that cannot be removed or written.
pub fn begin(out: &Out, identity: &Identity, resolved: &str) -> Result<(), Failure> {
    let folder = out.join("journal");
    storage::create_folder(&folder)?;
    storage::remove(&journal::path(out.path()))?;
    storage::sync_folder(&folder)?;
    let state = [
        checkpoint::path(out.path()),
        records_path::<Keyframe>(out.path()),
        records_path::<Place>(out.path()),
        records_path::<Query>(out.path()),
        out.join(COMPLETE),
    ];
    // A new run may not write all of them: none of the earlier ones must be taken for its own.
    let results = gyre_results::FILES
        .iter()
        .chain(&LOGS)
        .map(|name| out.join(name));
    state
        .into_iter()
        .chain(results)
        .try_for_each(|path: PathBuf| storage::remove(&path))?;
    identity.write(out)?;
    Ok(storage::write(&out.join(CONFIGURATION), resolved)?)
}

/// Says that all results have been written. They survive a power failure by now.
///
/// # Errors
/// A file that cannot be written.
pub fn mark_complete(out: &Out, poses: usize) -> Result<(), Failure> {
    Ok(storage::write(
        &out.join(COMPLETE),
        format!("poses = {poses}\n"),
    )?)
}

/// Makes the folder ready for the run to go on: cuts off what a power failure has left of the last
/// poses, and writes `config.toml` again if it is not what the run was begun with.
///
/// # Errors
/// A file that cannot be written.
pub fn resume(out: &Out, begun: &Begun) -> Result<(), Failure> {
    if begun.lost > 0 {
        journal::cut(&journal::path(out.path()), begun.poses)?;
    }
    let (path, identity) = (out.join(CONFIGURATION), &begun.identity);
    let found = fs::read_to_string(&path).ok();
    let found: Option<toml::Table> = found.and_then(|text| text.parse().ok());
    match found.as_ref() == Some(&identity.configuration) {
        true => Ok(()),
        false => Ok(storage::write(
            &path,
            toml::to_string_pretty(&identity.configuration)?,
        )?),
    }
}
