//! The counts over all queries.

use std::{collections::BTreeSet, time::Duration};

use gyre_slam::{LoopOutcome, estimation::places::{Candidate, Descriptor}};

use super::Checked;
use crate::{
    drive::Drive,
    report::{Record, Table, record},
};
use serde_json::json;

/// Places within these distances of the queried one are the same, m.
const NEAR_M: [f64; 2] = [5.0, 10.0];

/// The mean of some times.
#[derive(Default)]
pub struct Times {
    total: Duration,
    count: u32,
}

/// The counts over all queries.
pub struct Counts {
    describe: Duration,
    pub query: Times,
    pub verification: Times,
    /// Keyframes with an earlier one within each distance, and those that found one first or among
    /// the best five.
    revisits: [usize; 2],
    found: [[usize; 2]; 2],
    /// Keyframes with an earlier one within 5 m, and those with a right loop.
    near: BTreeSet<usize>,
    closed: BTreeSet<usize>,
    wrong: Vec<String>,
    /// Highest correlation of a wrong candidate that was aligned; lowest one of a right one within
    /// 5 m.
    correlations: [f64; 2],
    opposite: Errors,
    other: Errors,
}

/// Errors of right loops.
#[derive(Default)]
struct Errors {
    count: f64,
    sum: [f64; 3],
    squares: [f64; 3],
    nees: f64,
}

impl Times {
    pub fn add(&mut self, time: Duration) {
        self.total += time;
        self.count += 1;
    }

    fn mean_ms(&self) -> f64 {
        self.total.as_secs_f64() * 1e3 / f64::from(self.count.max(1))
    }
}

impl Counts {
    pub fn new(describe: Duration) -> Self {
        Self {
            describe,
            query: Times::default(),
            verification: Times::default(),
            revisits: [0; 2],
            found: [[0; 2]; 2],
            near: BTreeSet::new(),
            closed: BTreeSet::new(),
            wrong: Vec::new(),
            correlations: [0.0, 1.0],
            opposite: Errors::default(),
            other: Errors::default(),
        }
    }

    /// Counts whether a place near the queried one is among the candidates.
    pub fn recall(
        &mut self,
        drive: &Drive,
        query: usize,
        eligible: usize,
        candidates: &[Candidate],
    ) {
        let distance_m = |place: usize| drive.true_distance_m(query, place);
        let nearest_m = (0..eligible).map(distance_m).fold(f64::INFINITY, f64::min);
        for (k, near_m) in NEAR_M.into_iter().enumerate() {
            if nearest_m >= near_m {
                continue;
            }
            self.revisits[k] += 1;
            for (found, best) in self.found[k].iter_mut().zip([1, 5]) {
                let mut best = candidates.iter().take(best);
                *found += usize::from(best.any(|candidate| distance_m(candidate.place) < near_m));
            }
        }
        if nearest_m < NEAR_M[0] {
            self.near.insert(query);
        }
    }

    pub fn add(&mut self, drive: &Drive, checked: &Checked) {
        let found = &checked.verification;
        if checked.is_wrong {
            self.correlations[0] = self.correlations[0].max(found.correlation);
        } else if checked.distance_m < NEAR_M[0] {
            self.correlations[1] = self.correlations[1].min(found.correlation);
        }
        if found.outcome != LoopOutcome::Accepted {
            return;
        }
        if checked.is_wrong {
            let [query, place] = [checked.query, checked.place].map(|k| drive.keyframes[k].scan);
            let error_m = checked.error.xy().norm();
            self.wrong
                .push(format!("{query} in {place} ({error_m:.1} m)"));
            return;
        }
        self.closed.insert(checked.query);
        match checked.yaw_rad.cos() < -std::f64::consts::FRAC_1_SQRT_2 {
            true => self.opposite.add(checked),
            false => self.other.add(checked),
        }
    }

    /// The tables of the report.
    pub fn tables(&self, drive: &Drive) -> Vec<Table> {
        vec![self.recall_table(drive), self.loops_table()]
    }

    fn recall_table(&self, drive: &Drive) -> Table {
        let row = |k: usize| {
            let share = |found: usize| percent(found, self.revisits[k]);
            let [first, five] = self.found[k].map(share);
            record(
                json!({"within_m": NEAR_M[k], "revisits": self.revisits[k], "first": first, "five": five}),
            )
        };
        let count = drive.keyframes.len().max(1);
        let points = drive.keyframes.iter().map(|keyframe| keyframe.points.len());
        Table {
            title: "Recognition".to_owned(),
            columns: vec![
                ("within_m", "within m", 0),
                ("revisits", "revisits", 0),
                ("first", "recall@1 %", 1),
                ("five", "recall@5 %", 1),
            ],
            rows: vec![row(0), row(1)],
            legend: format!(
                "{} keyframes of {} points; {} bytes each, {} in the sieve. Described in {:.3} ms, queried in {:.3} ms, a \
                 candidate verified in {:.3} ms.",
                drive.keyframes.len(),
                points.sum::<usize>() / count,
                Descriptor::BYTES,
                Descriptor::SIEVE_BYTES,
                self.describe.as_secs_f64() * 1e3 / count as f64,
                self.query.mean_ms(),
                self.verification.mean_ms(),
            ),
            ..Table::default()
        }
    }

    fn loops_table(&self) -> Table {
        let closed = self.near.intersection(&self.closed).count();
        let closed = percent(closed, self.near.len()).unwrap_or(0.0);
        Table {
            title: "Loops".to_owned(),
            columns: vec![
                ("loops", "right loops", 0),
                ("count", "count", 0),
                ("forward_m", "forward m", 4),
                ("left_m", "left m", 4),
                ("yaw_deg", "yaw deg", 3),
                ("rms_m", "rms m", 3),
                ("yaw_rms_deg", "yaw rms deg", 3),
                ("nees", "NEES", 2),
            ],
            rows: vec![self.opposite.row("opposite"), self.other.row("other")],
            legend: format!(
                "Right loops for {closed:.1} % of the keyframes within 5 m of an earlier one. Wrong loops: {} {}\n\nCorrelation of \
                 wrong candidates at most {:.3}, of right ones within 5 m at least {:.3}.",
                self.wrong.len(),
                self.wrong.join(", "),
                self.correlations[0],
                self.correlations[1],
            ),
            ..Table::default()
        }
    }
}

fn percent(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

impl Errors {
    fn add(&mut self, checked: &Checked) {
        self.count += 1.0;
        for k in 0..3 {
            self.sum[k] += checked.error[k];
            self.squares[k] += checked.error[k].powi(2);
        }
        let covariance = checked.verification.motion.covariance;
        let inverse = covariance.try_inverse().unwrap_or_default();
        self.nees += checked.error.dot(&(inverse * checked.error)) / 3.0;
    }

    fn row(&self, name: &str) -> Record {
        let mean = |sum: f64| (self.count > 0.0).then(|| sum / self.count);
        let degrees = |value: Option<f64>| value.map(f64::to_degrees);
        record(json!({
            "loops": name,
            "count": self.count,
            "forward_m": mean(self.sum[0]),
            "left_m": mean(self.sum[1]),
            "yaw_deg": degrees(mean(self.sum[2])),
            "rms_m": mean(self.squares[0] + self.squares[1]).map(f64::sqrt),
            "yaw_rms_deg": degrees(mean(self.squares[2]).map(f64::sqrt)),
            "nees": mean(self.nees),
        }))
    }
}
