//! `gyre map RUN --extend MAP`: a drive is placed in the map of earlier ones.
//!
//! The keyframes are found in the map one by one. A pose graph of these places and of the run's own
//! motions and loops gives all poses of the run; the map stays where it is.

use std::{collections::HashSet, fs, path::Path};

use gyre_estimation::{
    CHI_SQUARE_99_9, Constraint, EstimationError, G2o, GraphOptions, Kind, PoseGraph,
};
use gyre_geometry::{Pose, UncertainMotion};
use gyre_localisation::{Fix, Localiser};
use gyre_mapping::Drawing;
use gyre_results::Out;
use gyre_slam::{Keyframe, RecordReader};
use gyre_storage::StorageError;
use gyre_terminal::{Failure, print};
use nalgebra::{Matrix3, Vector3};

use super::{Lines, MapArguments, MapFormat};
use crate::{folder, localise::searched_map};

/// Corrected keyframes, and the constraints between them.
const GRAPH: &str = "graph.g2o";
/// The largest such file, bytes: a drive of 1,000 km.
const MAX_GRAPH_BYTES: u64 = 1 << 30;
/// Fixes along so many metres of the path count as one, and so do loops between two such stretches:
/// their errors are dependent.
const DEPENDENT_M: f64 = 5.0;
/// The stretch that stands for the map in the groups of fixes.
const OF_MAP: u64 = u32::MAX as u64;
/// The uncertainty of the first pose before any fix: standard deviations in m and rad.
const ANYWHERE: [f64; 3] = [1e5, 1e5, 3.0];
/// Fixes that are compared as the start, at most.
const STARTS: usize = 100;
/// Path between two drives, so that no submap has keyframes of both, m.
const BETWEEN_DRIVES_M: f64 = 1e3;

/// A keyframe of the run that was found in the map.
#[derive(Clone, Copy)]
struct Found {
    keyframe: usize,
    fix: Fix,
}

/// A run with its keyframes' places in the map.
struct Search {
    found: Vec<Found>,
    /// The stretch of the path that each keyframe lies on.
    stretches: Vec<u64>,
}

/// Places a run in the map in a folder, draws both, and writes the map of all.
///
/// # Errors
/// A folder without a map that can be localised in or the one that is written to, a run without
/// `graph.g2o`, and one that is nowhere on the map.
pub fn extend(arguments: &MapArguments, map: &Path) -> Result<Drawing, Failure> {
    let (run, out) = (&arguments.run, &arguments.out);
    require_another_folder(map, out)?;
    let mut keyframes = super::open(run)?;
    let graph = read_graph(run, keyframes.len())?;
    let mut localiser = searched_map::open(map, &super::configuration(run)?)?;
    let earlier = gyre_mapping::Map::open(map)?;
    // Before the search, which takes minutes for a long drive. A drive that is refused makes no
    // folder.
    let locked = out.exists().then(|| Out::lock(out)).transpose()?;
    let search = find(&mut localiser, &mut keyframes)?;
    let Some(start) = most_agreed(&graph, &search.found) else {
        return Err(format!(
            "no keyframe of {} was found in the map {}: the drives have no place in common, or too few of them",
            run.display(),
            map.display()
        )
        .into());
    };
    let (poses, agreeing) = place(&graph, &search, &start)?;
    print::note(format_args!(
        "{} of {} keyframes were found in {}; {} of them contradict the others and are not used",
        search.found.len(),
        keyframes.len(),
        map.display(),
        search.found.len() - agreeing.len()
    ));
    let known = localiser.map();
    let ends = |it: &Found| [known.pose(it.fix.keyframe), poses[it.keyframe]];
    let loops = agreeing.iter().map(ends).collect();
    let all = all(known.keyframes(), &mut keyframes, &poses)?;
    let _locked = locked.map_or_else(|| Out::lock(out), Ok)?;
    let mut drawing = Drawing::new(earlier.options(), out)?;
    for keyframe in &all {
        drawing.draw(keyframe, &keyframe.pose.motion)?;
    }
    if arguments.format.contains(&MapFormat::Folder) {
        let all = gyre_localisation::Map::new(all)?;
        folder::write(out, &all, drawing.evidence(), earlier.origin())?;
    }
    let lines = Lines {
        trajectory: poses,
        loops,
    };
    super::export(arguments, earlier.origin(), &mut drawing, &lines)?;
    Ok(drawing)
}

fn read_graph(run: &Path, keyframes: usize) -> Result<G2o, Failure> {
    let path = run.join(GRAPH);
    let text =
        gyre_storage::read_text(&path, MAX_GRAPH_BYTES).map_err(StorageError::at("read", &path))?;
    let graph = G2o::parse(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    match graph.poses.len() == keyframes {
        true => Ok(graph),
        false => Err(format!(
            "{} has {} keyframes, and the run {keyframes}: run it again to its end",
            path.display(),
            graph.poses.len()
        )
        .into()),
    }
}

/// Finds the keyframes of a run, each by itself: what tracking finds depends on what it found
/// before.
fn find(
    localiser: &mut Localiser,
    keyframes: &mut RecordReader<Keyframe>,
) -> Result<Search, Failure> {
    let mut search = Search {
        found: Vec::new(),
        stretches: Vec::with_capacity(keyframes.len()),
    };
    for index in 0..keyframes.len() {
        let keyframe = keyframes.read(index)?;
        search
            .stretches
            .push((keyframe.path_m / DEPENDENT_M) as u64);
        // The velocity of the first scan is not known, so that its points do not fit.
        if index > 0 {
            let fix = localiser.find(&keyframe.points, &keyframe.twist);
            let keyframe = index;
            search.found.extend(fix.map(|fix| Found { keyframe, fix }));
        }
    }
    Ok(search)
}

/// Returns the pose of the run in the map by the fix that agrees best with the others: the least
/// median of their distances. A wrong one would draw all others away. `None` without a fix.
fn most_agreed(run: &G2o, found: &[Found]) -> Option<Pose> {
    let step = found.len().div_ceil(STARTS).max(1);
    let starts = found.iter().step_by(step);
    let starts = starts.map(|it| it.fix.pose.motion * run.poses[it.keyframe].inverse());
    let median = |start: &Pose| {
        let distance = |it: &Found| {
            let placed = start * run.poses[it.keyframe];
            (placed.translation.vector - it.fix.pose.motion.translation.vector).norm()
        };
        let mut distances: Vec<f64> = found.iter().map(distance).collect();
        let middle = distances.len() / 2;
        *distances.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    starts
        .map(|start| (median(&start), start))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, start)| start)
}

/// Returns the poses of the keyframes of a run in the map frame, those that fit its motions, its
/// loops and its places on the map best, and the fixes that agree with them.
fn place(
    run: &G2o,
    search: &Search,
    map_from_run: &Pose,
) -> Result<(Vec<Pose>, Vec<Found>), EstimationError> {
    let placed = run.poses.iter().map(|pose| map_from_run * pose);
    // The first pose of a graph stays where it is: it is that of the map.
    let poses: Vec<Pose> = std::iter::once(Pose::identity()).chain(placed).collect();
    let anywhere = UncertainMotion {
        motion: poses[1],
        covariance: Matrix3::from_diagonal(&Vector3::from(ANYWHERE.map(|sigma| sigma * sigma))),
    };
    let mut graph = PoseGraph::new(poses[0], GraphOptions::default());
    graph.apply(&Constraint::odometry(0, anywhere))?;
    let between = |from: u64, keyframe: usize| Kind::Loop {
        group: Some(from << 32 | search.stretches[keyframe]),
    };
    for constraint in &run.constraints {
        let &Constraint { from, to, .. } = constraint;
        graph.apply(&Constraint {
            from: from + 1,
            to: to + 1,
            kind: match constraint.kind {
                Kind::Loop { .. } => between(search.stretches[from], to),
                kind => kind,
            },
            ..*constraint
        })?;
    }
    for it in &search.found {
        graph.apply(&Constraint {
            from: 0,
            to: it.keyframe + 1,
            motion: it.fix.pose,
            kind: between(OF_MAP, it.keyframe),
        })?;
    }
    graph.start_from(&poses)?;
    graph.solve()?;
    let agreeing: HashSet<usize> = graph
        .loops()
        .filter(|it| it.from == 0 && it.chi_square <= CHI_SQUARE_99_9)
        .map(|it| it.to - 1)
        .collect();
    let found = search.found.iter();
    let agreeing = found.filter(|it| agreeing.contains(&it.keyframe));
    let agreeing = agreeing.copied().collect();
    Ok((graph.poses()[1..].to_vec(), agreeing))
}

/// The keyframes of the map and those of the run at their poses, numbered through.
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

/// Checks that the map that is extended is kept.
fn require_another_folder(map: &Path, out: &Path) -> Result<(), Failure> {
    let same = fs::canonicalize(map).ok() == fs::canonicalize(out).ok() && out.exists();
    match same {
        true => Err(format!(
            "--out is the map {} itself: choose another folder, so that it is kept",
            map.display()
        )
        .into()),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::pose;

    use super::*;

    fn uncertain(motion: Pose, sigma: f64) -> UncertainMotion {
        UncertainMotion {
            motion,
            covariance: Matrix3::identity() * sigma * sigma,
        }
    }

    #[test]
    fn a_drive_is_bent_to_where_it_was_found_and_no_farther() {
        // Odometry turns by 0.1 degrees a keyframe; the drive goes straight on from (5, 7) at a
        // quarter turn.
        let true_pose = |k: usize| pose(5.0, 7.0 + 2.0 * k as f64, std::f64::consts::FRAC_PI_2);
        let motion = uncertain(pose(2.0, 0.0, 0.1f64.to_radians()), 0.01);
        let mut poses = vec![Pose::identity()];
        for _ in 1..100 {
            poses.push(poses[poses.len() - 1] * motion.motion);
        }
        let run = G2o {
            constraints: (0..99).map(|k| Constraint::odometry(k, motion)).collect(),
            poses,
        };
        let found_at = |keyframe: usize, motion: Pose| Found {
            keyframe,
            fix: Fix {
                pose: uncertain(motion, 0.02),
                correlation: 0.8,
                margin: 0.3,
                keyframe: 0,
            },
        };
        let right = (10..60).map(|keyframe| found_at(keyframe, true_pose(keyframe)));
        // The first fix is of another place.
        let wrong = found_at(5, pose(-3e3, 2e3, 1.0));
        let search = Search {
            found: std::iter::once(wrong).chain(right).collect(),
            stretches: (0..100).map(|keyframe| 2 * keyframe / 5).collect(),
        };
        let start = most_agreed(&run, &search.found).unwrap();
        let (placed, agreeing) = place(&run, &search, &start).unwrap();
        let agreeing: Vec<usize> = agreeing.iter().map(|it| it.keyframe).collect();
        assert_eq!(agreeing, (10..60).collect::<Vec<usize>>());
        let error_m =
            |k: usize| (placed[k].translation.vector - true_pose(k).translation.vector).norm();
        assert_eq!(placed.len(), 100);
        assert!((10..60).all(|k| error_m(k) < 0.2), "{}", error_m(35));
        assert!(error_m(0) < 1.0, "{}", error_m(0));
        // Beyond, odometry goes on from the last place.
        let ahead = placed[59].inv_mul(&placed[60]);
        assert!((ahead.translation.vector - motion.motion.translation.vector).norm() < 0.05);
    }
}
