//! `gyre map RUN --extend MAP`: a drive is placed in the map of earlier ones.

use std::{fs, path::Path};

use gyre_configuration::terminal::{Failure, print};
use gyre_geometry::Pose;
use gyre_results::{Content, Out};
use gyre_slam::{
    Keyframe, RecordReader,
    estimation::G2o,
    localisation::{DriveSearch, FoundKeyframe, Localiser, PlacedDrive},
    mapping::Drawing,
};
use gyre_storage::StorageError;

use super::{Lines, MapArguments, MapFormat};
use crate::maps::{folder, localise};

/// Corrected keyframes, and the constraints between them.
const GRAPH: &str = "graph.g2o";
/// The largest such file, bytes: a drive of 1,000 km.
const MAX_GRAPH_BYTES: u64 = 1 << 30;

/// Reads the graph of a run with so many keyframes.
pub fn read_graph(run: &Path, keyframes: usize) -> Result<G2o, Failure> {
    let graph = graph(run)?;
    let (path, count) = (run.join(GRAPH), graph.poses.len());
    match count == keyframes {
        true => Ok(graph),
        false => Err(format!(
            "{} has {count} keyframes, and the run {keyframes}: run it again to its end",
            path.display()
        )
        .into()),
    }
}

/// Returns the keyframes at both ends of each loop that a run uses; nothing without a graph.
pub fn used_loops(run: &Path) -> Result<Vec<[usize; 2]>, Failure> {
    if !super::exists(&run.join(GRAPH))? {
        return Ok(Vec::new());
    }
    let graph = graph(run)?;
    let odometry = graph.poses.len().saturating_sub(1);
    let loops = graph.constraints.iter().skip(odometry);
    Ok(loops.map(|it| [it.from, it.to]).collect())
}

fn graph(run: &Path) -> Result<G2o, Failure> {
    let path = run.join(GRAPH);
    let text =
        gyre_storage::read_text(&path, MAX_GRAPH_BYTES).map_err(StorageError::at("read", &path))?;
    Ok(G2o::parse(&text).map_err(|error| format!("{}: {error}", path.display()))?)
}

/// Places a run in a map, and reports the share of the run that was found. `names` are the folders
/// of both.
pub fn place(
    graph: &G2o,
    keyframes: &mut RecordReader<Keyframe>,
    localiser: &mut Localiser,
    names: [&Path; 2],
) -> Result<PlacedDrive, Failure> {
    let mut search = DriveSearch::default();
    for index in 0..keyframes.len() {
        search.add(localiser, &keyframes.read(index)?);
    }
    let [run, map] = names.map(Path::display);
    let Some(placed) = search.place(graph)? else {
        return Err(format!(
            "no keyframe of {run} was found in the map {map}: the drives have no place in common, or too few of them"
        )
        .into());
    };
    let (found, all) = (search.found().len(), keyframes.len());
    let contradict = found - placed.agreeing.len();
    print::note(format_args!(
        "{found} of {all} keyframes were found in {map}; {contradict} of them contradict the others and are not used"
    ));
    Ok(placed)
}

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
    let graph = read_graph(run, keyframes.len())?;
    let mut localiser = localise::localiser(map, &super::configuration(run)?)?;
    let earlier = gyre_slam::mapping::Map::open(map)?;
    // Before the search, which takes minutes for a long drive. A drive that is refused makes no
    // folder.
    let lock = || Out::lock_for(out, Content::MAP);
    let locked = out.exists().then(lock).transpose()?;
    let placed = place(&graph, &mut keyframes, &mut localiser, [run, map])?;
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
