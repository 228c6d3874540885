//! The keyframes of a run: selected among its poses, and logged before those are journalled.

use std::{mem, path::Path};

use gyre_contract::{Command, CommandError, Commands, PoseHeader};
use gyre_geometry::SparsePoint;
use gyre_slam::{Keyframe, KeyframeBuilder, ScanPose};
use gyre_storage::{LogError, RecordLog, RecordReader, records_path};

use crate::PoseLog;

#[derive(Debug)]
pub struct Keyframes {
    log: RecordLog<Keyframe>,
    builder: KeyframeBuilder,
    points: Vec<SparsePoint>,
}

impl Keyframes {
    /// Opens or creates the log of the run that writes to `out`, whose journal has `poses` poses,
    /// and perhaps the end of the stream. Keyframes beyond them are cut off, and the motion since
    /// the last one is recovered from the journal.
    /// Appending allocates nothing for scans of up to `points` points.
    pub fn open(out: &Path, poses: u64, ended: bool, points: usize) -> Result<Self, LogError> {
        let mut log = RecordLog::open(out)?;
        log.reserve(Keyframe::encoded_len(points));
        let (keyframes, last) = newest(log.len(), poses, |index| log.read(index))?;
        // The end of the keyframes is before the end of the journal.
        if !ended {
            log.cut(keyframes)?;
        }
        match recover(out, last.as_ref(), poses)? {
            (builder, None) => Ok(Self {
                log,
                builder,
                points: Vec::with_capacity(points),
            }),
            (_, Some(pose)) => {
                let path = records_path::<Keyframe>(out);
                Err(LogError::Missing(format!(
                    "{} lacks the keyframe of pose {pose}: the same command computes it again",
                    path.display()
                )))
            }
        }
    }
}

impl PoseLog for Keyframes {
    /// Appends the pose if it becomes a keyframe.
    fn add(&mut self, pose: &PoseHeader, points: &[SparsePoint]) -> Result<bool, LogError> {
        let Some(mut keyframe) = self.builder.next(&scan_pose(pose)) else {
            self.log.rely()?;
            return Ok(false);
        };
        keyframe.points = mem::take(&mut self.points);
        keyframe.points.clear();
        keyframe.points.extend_from_slice(points);
        self.log.append(&keyframe)?;
        self.points = keyframe.points;
        Ok(true)
    }

    /// A command makes the next pose a keyframe. A reset without its map begins the log again.
    fn obey(&mut self, command: &Command) -> Result<(), LogError> {
        if command.starts_map() {
            self.log.cut(0)?;
        }
        obey(&mut self.builder, command);
        Ok(())
    }

    fn end(&mut self) -> Result<(), LogError> {
        self.log.end()
    }

    fn sync(&self) -> Result<(), LogError> {
        self.log.sync()
    }
}

/// Returns how many of the first `poses` poses of the journal have all their keyframes. After a
/// death all of them have; a power failure can take the last keyframes. Changes nothing.
pub fn complete_poses(out: &Path, poses: u64) -> Result<u64, LogError> {
    let mut reader = RecordReader::open(out)?;
    let (_, last) = newest(reader.len(), poses, |index| reader.read(index))?;
    let (_, missing) = recover(out, last.as_ref(), poses)?;
    Ok(missing.unwrap_or(poses))
}

/// Returns the last one of `keyframes` keyframes that is among the first `poses` poses, and how
/// many there are up to it.
fn newest(
    keyframes: usize,
    poses: u64,
    mut read: impl FnMut(usize) -> Result<Keyframe, LogError>,
) -> Result<(usize, Option<Keyframe>), LogError> {
    for count in (1..=keyframes).rev() {
        let keyframe = read(count - 1)?;
        if keyframe.seq < poses {
            return Ok((count, Some(keyframe)));
        }
    }
    Ok((0, None))
}

fn obey(builder: &mut KeyframeBuilder, command: &Command) {
    match command {
        Command::Reset { at, keep_map: true } => builder.give_next(at.pose().covariance),
        Command::Reset { .. } | Command::NewMap {} => *builder = KeyframeBuilder::default(),
        Command::Locate { .. } => builder.require_next(),
    }
}

/// Takes the poses of the journal since the last keyframe again. Returns the first one that lacks
/// its keyframe, if there is one.
fn recover(
    out: &Path,
    newest: Option<&Keyframe>,
    poses: u64,
) -> Result<(KeyframeBuilder, Option<u64>), LogError> {
    let commands = Commands::open(out).map_err(unreadable)?;
    // Without keyframes, a command may have cut them off: none of the poses before it has one.
    let of_map = match newest {
        Some(_) => 0,
        None => commands.last(Command::starts_map),
    };
    let mut builder = KeyframeBuilder::default();
    let mut before = of_map;
    let last = newest.map_or(0, |keyframe| keyframe.seq);
    let records = crate::poses_from(out, last)?;
    // Behind them may be the leftovers of others after a power failure, or the end of the stream.
    let count = usize::try_from(poses.saturating_sub(last)).unwrap_or(usize::MAX);
    for pose in records.take(count) {
        let pose = pose?;
        let (seq, known) = (pose.item.seq, pose.item.commands);
        if known < of_map {
            continue;
        }
        let is_first = newest.is_some_and(|newest| newest.seq == seq);
        if !is_first {
            let new = commands.between(before, known);
            new.for_each(|command| obey(&mut builder, command));
        }
        before = known;
        match newest {
            // The pose of the journal, since the keyframe's yaw is rounded differently.
            Some(newest) if is_first => builder.resume(&pose.pose(), newest.path_m),
            _ if builder.next(&scan_pose(&pose)).is_some() => return Ok((builder, Some(seq))),
            _ => {}
        }
    }
    Ok((builder, None))
}

fn unreadable(error: CommandError) -> LogError {
    LogError::Missing(error.to_string())
}

fn scan_pose(pose: &PoseHeader) -> ScanPose {
    ScanPose {
        seq: pose.item.seq,
        scan: pose.item.scan,
        stamp_ns: pose.item.stamp_ns,
        pose: pose.pose(),
        motion: pose.motion.motion(),
        interval_s: pose.motion.interval_ns as f64 * 1e-9,
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::{GivenPose, Item};

    use super::*;
    use crate::Journal;

    /// A pose every 3 m: each becomes a keyframe.
    fn pose(seq: u64, commands: u64) -> PoseHeader {
        PoseHeader {
            item: Item {
                commands,
                ..Item::recorded(seq, seq, seq as i64)
            },
            x_m: 3.0 * seq as f64,
            ..PoseHeader::default()
        }
    }

    fn reset(keep_map: bool) -> Command {
        let at = GivenPose::default();
        Command::Reset { at, keep_map }
    }

    /// The keyframes are of the new map, also if a kill leaves a part of the reset behind.
    #[test]
    fn a_new_map_has_the_keyframes_since_its_reset_also_after_a_kill() {
        for journalled in [4, 5] {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path();
            let mut journal = Journal::open(out).unwrap();
            let mut keyframes = Keyframes::open(out, 0, false, 1).unwrap();
            for seq in 0..4 {
                keyframes.add(&pose(seq, 0), &[]).unwrap();
                journal.append(&pose(seq, 0)).unwrap();
            }
            let mut commands = Commands::open(out).unwrap();
            commands.add(reset(false)).unwrap();
            commands.apply(4, true).unwrap();
            keyframes.obey(&reset(false)).unwrap();
            keyframes.add(&pose(4, 1), &[]).unwrap();
            if journalled > 4 {
                journal.append(&pose(4, 1)).unwrap();
            }
            drop((keyframes, journal));
            assert_eq!(complete_poses(out, journalled).unwrap(), journalled);
            let mut resumed = Keyframes::open(out, journalled, false, 1).unwrap();
            if journalled == 4 {
                resumed.obey(&reset(false)).unwrap();
                resumed.add(&pose(4, 1), &[]).unwrap();
            }
            resumed.add(&pose(5, 1), &[]).unwrap();
            let mut log = RecordReader::<Keyframe>::open(out).unwrap();
            let keyframes = (0..log.len()).map(|index| log.read(index).unwrap());
            let places: Vec<_> = keyframes.map(|it| (it.seq, it.path_m)).collect();
            assert_eq!(places, [(4, 0.0), (5, 3.0)], "{journalled}");
        }
    }
}
