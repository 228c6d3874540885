//! `gyre map RUN --extend MAP`: a drive is placed in the map of earlier ones.

use std::{fs, path::Path};

use gyre_configuration::terminal::Failure;
use gyre_geometry::Pose;
use gyre_results::{Content, Out};
use gyre_slam::{Keyframe, RecordReader, localisation::FoundKeyframe, mapping::Drawing};

use super::{Lines, MapArguments, MapFormat, placing};
use crate::maps::{folder, localise::searched_map};

/// Path between two drives, so that no submap has keyframes of both, m.
const BETWEEN_DRIVES_M: f64 = 1e3;

pub fn extend(arguments: &MapArguments, map: &Path) -> Result<Drawing, Failure> {
    let (run, out) = (&arguments.run, &arguments.out);
    if out.exists() && fs::canonicalize(map).ok() == fs::canonicalize(out).ok() {
        let map = map.display();
        return Err(format!(
            "--out is the map {map} itself: choose another folder, so that it is kept"
        )
        .into());
    }
    let mut keyframes = super::open(run)?;
    let graph = placing::read_graph(run, keyframes.len())?;
    let mut localiser = searched_map::open(map, &super::configuration(run)?)?;
    let earlier = gyre_slam::mapping::Map::open(map)?;
    // Before the search, which takes minutes for a long drive. A drive that is refused makes no
    // folder.
    let lock = || Out::lock_for(out, Content::MAP);
    let locked = out.exists().then(lock).transpose()?;
    let placed = placing::place(&graph, &mut keyframes, &mut localiser, [run, map])?;
    let (known, poses) = (localiser.map(), placed.poses);
    let ends = |it: &FoundKeyframe| [known.pose(it.fix.keyframe), poses[it.keyframe]];
    let loops = placed.agreeing.iter().map(ends).collect();
    let all = all(known.keyframes(), &mut keyframes, &poses)?;
    let _locked = locked.map_or_else(lock, Ok)?;
    let mut drawing = Drawing::new(earlier.options(), out)?;
    for keyframe in &all {
        drawing.draw(keyframe, &keyframe.pose.motion)?;
    }
    if arguments.format.contains(&MapFormat::Folder) {
        let all = gyre_slam::localisation::Map::new(all)?;
        folder::write(out, &all, drawing.evidence(), earlier.origin())?;
    }
    let lines = Lines {
        trajectory: poses,
        loops,
    };
    super::export(arguments, earlier.origin(), &mut drawing, &lines)?;
    Ok(drawing)
}

/// The keyframes of the map and the keyframes of the run at their poses, numbered through.
fn all(
    known: &[Keyframe],
    keyframes: &mut RecordReader<Keyframe>,
    poses: &[Pose],
) -> Result<Vec<Keyframe>, Failure> {
    let last = known.last();
    let next_seq = last.map_or(0, |last| last.seq + 1);
    let from_m = last.map_or(0.0, |last| last.path_m + BETWEEN_DRIVES_M);
    let mut all = known.to_vec();
    for (index, pose) in poses.iter().enumerate() {
        let mut keyframe = keyframes.read(index)?;
        keyframe.seq += next_seq;
        keyframe.path_m += from_m;
        keyframe.pose.motion = *pose;
        all.push(keyframe);
    }
    Ok(all)
}
