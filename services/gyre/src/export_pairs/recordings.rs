//! The recordings that are exported, each with its truth.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use gyre_radar::{
    Dataset, Trajectory, find_ground_truth,
    ground_truth::{parse_trajectory, read_trajectory},
};
use nalgebra::Isometry2;

use crate::{Failure, cli::ExportPairsArguments, configuration::Configuration, preflight, results};

/// Stamps this close to the truth's end are its end: files round. As in `gyre realism`.
const ROUNDING_NS: u64 = 1_000_000;
/// The truth is not interpolated across wider gaps. As in `gyre evaluate`.
const WIDEST_GAP_NS: u64 = 1_000_000_000;

/// A recording, open.
pub struct Recording {
    /// Its folder, or `a simulation`.
    pub data: String,
    pub dataset: Box<dyn Dataset>,
    /// The scans that the configuration plays.
    pub played: Range<usize>,
    pub truth: Truth,
}

/// Where the sensor was.
pub struct Truth {
    /// The file, or `ground_truth.tum` of what was simulated.
    pub path: PathBuf,
    trajectory: Trajectory,
}

impl Truth {
    /// The pose at a scan's time, in the truth's own frame.
    pub fn pose(&self, stamp_ns: i64) -> Option<Isometry2<f64>> {
        let in_gap = self.trajectory.gap_ns(stamp_ns).is_some_and(|gap_ns| gap_ns > WIDEST_GAP_NS);
        self.trajectory.near(stamp_ns, ROUNDING_NS).filter(|_| !in_gap)
    }
}

/// The configuration of each recording that was named on the command line, or of the one that the configuration names.
pub fn configurations(arguments: &ExportPairsArguments) -> Result<Vec<Configuration>, Failure> {
    let mut common = Configuration::read(&arguments.configuration, &arguments.set)?;
    if let Some(path) = &arguments.ground_truth {
        common.run.ground_truth = Some(path.clone());
    }
    if arguments.data.is_empty() {
        if let Some(simulation) = &mut common.simulation {
            // Nothing is stored: what is streamed is the same to the byte.
            simulation.output.store = false;
            common.dataset = common.dataset.or(&simulation.dataset_options());
        }
        return Ok(vec![common]);
    }
    if let (Some(truth), 2..) = (&common.run.ground_truth, arguments.data.len()) {
        let (truth, recordings) = (truth.display(), arguments.data.len());
        return Err(format!(
            "the ground truth {truth} belongs to one recording, but there are {recordings}: without it, each is read with its own"
        )
        .into());
    }
    common.simulation = None;
    let of = |data: &PathBuf| {
        let mut own = common.clone();
        own.source.data = data.clone();
        own
    };
    Ok(arguments.data.iter().map(of).collect())
}

impl Recording {
    /// Opens what a configuration names, as a run of it would.
    pub fn open(configuration: &Configuration) -> Result<Self, Failure> {
        let preflight::Played { dataset, truth } = preflight::open(configuration)?;
        let source = &configuration.source;
        let first = source.first.min(dataset.len());
        let played = first..first.saturating_add(source.scans.unwrap_or(usize::MAX)).min(dataset.len());
        let truth = Truth::of(configuration, truth)?;
        Ok(Self { data: configuration.data(), dataset, played, truth })
    }

    /// What it is called: its folder's name.
    pub fn name(&self) -> String {
        let folder = Path::new(&self.data).canonicalize().ok();
        let name = folder.as_deref().and_then(Path::file_name);
        name.map_or_else(|| self.data.clone(), |name| name.to_string_lossy().into_owned())
    }

    /// Why nothing could be exported of it, `without_truth` scans for want of a pose.
    pub fn gives_nothing(&self, without_truth: usize) -> Failure {
        let (data, scans, truth) = (&self.data, self.played.len(), self.truth.path.display());
        match without_truth {
            0 => format!("{data}: none of its {scans} scans can be read"),
            _ => format!(
                "{data}: {without_truth} of its {scans} scans can be read, but {truth} has no pose at the time of any"
            ),
        }
        .into()
    }
}

impl Truth {
    /// The truth that a run would be judged by.
    fn of(configuration: &Configuration, simulated: Option<Vec<u8>>) -> Result<Self, Failure> {
        let beside = || find_ground_truth(&configuration.source.data);
        let (path, trajectory) = match (&configuration.run.ground_truth, simulated) {
            (Some(path), _) => (path.clone(), read_trajectory(path)?),
            (None, Some(tum)) => {
                let path = PathBuf::from(results::SIMULATED_TRUTH);
                let trajectory = parse_trajectory(&String::from_utf8_lossy(&tum), &path)?;
                (path, trajectory)
            }
            (None, None) => {
                let data = configuration.data();
                let path = beside().ok_or_else(|| {
                    format!(
                        "{data} has no ground truth, and masks are trained by true poses: name it with --ground-truth"
                    )
                })?;
                let trajectory = read_trajectory(&path)?;
                (path, trajectory)
            }
        };
        let refused = |what: &str| {
            Err(format!("{} has {what}, and training needs poses at the scans' times", path.display()).into())
        };
        match () {
            () if trajectory.span_ns().is_none() => refused("no times"),
            () if !trajectory.has_heading() => refused("positions only, no headings"),
            () => Ok(Self { path, trajectory }),
        }
    }
}
