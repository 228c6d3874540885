//! What the searches reach on a recording, by running the pipeline on it.

use crate::realism::SearchErrors;
use gyre_evaluation::Options;
use gyre_radar::{
    Trajectory,
    ground_truth::{find_ground_truth, read_trajectory},
};

use super::recording::{Part, Source};
use crate::tables::rows::Rows;
use gyre::{Failure, judgement::judge, print};

/// How a recording moves, and how well that is found out from its scans.
#[derive(Debug, Default)]
pub struct Searches {
    /// Ground truth with times and headings.
    pub truth: Option<Trajectory>,
    /// What the search makes of the scans in the paper's form.
    pub plain: Option<Trajectory>,
    /// What the shipped configuration makes of them.
    pub refined: Option<Trajectory>,
}

impl Searches {
    /// Runs both on the recording's first `scans` scans, or neither if there are no two.
    pub fn run(source: &Source, scans: usize) -> Result<Self, Failure> {
        let truth = truth(source);
        let scans = source.scans().min(scans);
        if scans < 2 {
            return Ok(Self {
                truth,
                ..Self::default()
            });
        }
        let plain = Some(run(source, "f-raw, line 14", scans)?);
        let refined = Some(run(source, "Gyre", scans)?);
        Ok(Self {
            truth,
            plain,
            refined,
        })
    }

    /// Errors of a part of a trajectory that was found; `None` without truth that fits.
    pub fn errors(&self, found: &Option<Trajectory>, part: Part) -> Option<SearchErrors> {
        let found = part.of_trajectory(found.as_ref()?);
        let judged = judge(&found, self.truth.as_ref()?, Options::default())
            .inspect_err(|error| print::note(format_args!("not compared with the truth: {error}")))
            .ok()?;
        let rpe = judged.rpe.as_ref()?;
        Some(SearchErrors {
            motions: rpe.pairs.len(),
            path_m: judged.path_m,
            translation_rmse_m: rpe.translation_rmse_m,
            rotation_rmse_deg: rpe.rotation_rmse_deg,
            ate_m: judged.ate.rmse_m,
            seg_percent: judged.seg.as_ref().map(|seg| seg.percent),
        })
    }
}

fn truth(source: &Source) -> Option<Trajectory> {
    let path = find_ground_truth(&source.data)?;
    let truth = read_trajectory(&path);
    let truth = truth
        .inspect_err(|error| print::note(format_args!("not compared with the truth: {error}")))
        .ok()?;
    (truth.stamp_ns.is_some() && truth.has_heading()).then_some(truth)
}

/// Runs a row of Table III on the first `scans` scans.
fn run(source: &Source, row: &str, scans: usize) -> Result<Trajectory, Failure> {
    let rows = Rows::read()?;
    let mut changes = rows
        .named(row)
        .map_or_else(Vec::new, |row| row.changes(&rows, None));
    changes.push(format!("source.scans={scans}"));
    let (out, _) = source.sequence.run(row, &changes, &source.runs)?;
    Ok(read_trajectory(&out.join("trajectory.tum"))?)
}
