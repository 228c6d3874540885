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

pub fn read_graph(run: &Path, keyframes: usize) -> Result<G2o, Failure> {
    let path = run.join(GRAPH);
    let text =
        gyre_storage::read_text(&path, MAX_GRAPH_BYTES).map_err(StorageError::at("read", &path))?;
    let graph = G2o::parse(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    let (path, count) = (path.display(), graph.poses.len());
    match count == keyframes {
        true => Ok(graph),
        false => Err(format!(
            "{path} has {count} keyframes, and the run {keyframes}: run it again to its end"
        )
        .into()),
    }
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
