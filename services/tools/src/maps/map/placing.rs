//! A run placed in a map of earlier drives.

use std::path::Path;

use gyre_configuration::terminal::{Failure, print};
use gyre_slam::{
    Keyframe, RecordReader,
    estimation::G2o,
    localisation::{DriveSearch, Localiser, PlacedDrive},
};
use gyre_storage::StorageError;

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
